// Files that results go into: every write is checked, and a failed one leaves what was there before whole.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/whole_file.h"

namespace arboretum {

/// What the message of a full disk says of a run's files.
inline constexpr std::string_view kGoesOn = " (a run goes on with --resume)";

/// A file of lines that only grows. Each line is handed to the operating system at once, so that a killed
/// process loses no line that it had appended.
class AppendFile {
 public:
  AppendFile() = default;
  /// Opens or creates. With `keep`, what the file holds stays, but for a last line cut off in the middle.
  /// Throws UserError.
  AppendFile(std::filesystem::path path, bool keep);
  AppendFile(AppendFile&& other) noexcept;
  AppendFile& operator=(AppendFile&& other) noexcept;
  ~AppendFile();

  /// Appends `line` and a newline. When that fails (a full disk), takes the part that was written back and
  /// throws UserError.
  void append(std::string_view line);

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

/// Whole lines of a file; a last line without its newline is left out. Empty where there is no such file; throws
/// UserError where it cannot be read.
[[nodiscard]] std::vector<std::string> read_lines(const std::filesystem::path& path);
/// Hands what was printed to the operating system. Throws std::system_error where it does not go there: the reader has
/// left (EPIPE), the disk is full.
void flush_output();
/// Creates the folder, if need be, and tries whether files can be made in it. Throws UserError: `what` cannot be,
/// `mend`.
void make_output_folder(const std::filesystem::path& folder, std::string_view what = "the output folder",
                        std::string_view mend = "choose another with --out");

}  // namespace arboretum
