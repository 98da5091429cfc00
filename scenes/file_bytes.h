// FileBytes: a file's bytes, mapped read-only; what cannot be read is one clear line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace arboretum {

class FileBytes {
 public:
  /// Throws UserError where `path` is missing, a directory, a pipe or device, unreadable or empty.
  explicit FileBytes(const std::filesystem::path& path);
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  ~FileBytes();
  [[nodiscard]] std::string_view text() const noexcept { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

/// The text without the byte-order mark that some editors put before UTF-8.
[[nodiscard]] std::string_view without_mark(std::string_view text) noexcept;
/// The checks of FileBytes alone, for files that a library opens.
void check_readable_file(const std::filesystem::path& path);

}  // namespace arboretum
