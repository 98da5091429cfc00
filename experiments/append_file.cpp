#include "experiments/append_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/error.h"

namespace arboretum {
namespace {

/// Bytes up to and with the last newline.
off_t whole_lines(int descriptor, const std::filesystem::path& path) {
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) cannot_write(path, errno, kGoesOn);
  off_t end = status.st_size;
  char c = 0;
  while (end > 0 && ::pread(descriptor, &c, 1, end - 1) == 1 && c != '\n') --end;
  return end;
}

}  // namespace

AppendFile::AppendFile(std::filesystem::path path, bool keep) : path_(std::move(path)) {
  descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | (keep ? 0 : O_TRUNC), 0666);
  if (descriptor_ < 0) cannot_write(path_, errno, kGoesOn);
  struct stat status {};
  if (keep && ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode) &&
      ::ftruncate(descriptor_, whole_lines(descriptor_, path_)) != 0) {
    cannot_write(path_, errno, kGoesOn);
  }
}

AppendFile::AppendFile(AppendFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

AppendFile& AppendFile::operator=(AppendFile&& other) noexcept {
  std::swap(path_, other.path_), std::swap(descriptor_, other.descriptor_);
  return *this;
}

AppendFile::~AppendFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void AppendFile::append(std::string_view line) {
  const off_t before = ::lseek(descriptor_, 0, SEEK_END);
  if (const int error = write_all(descriptor_, std::string(line) + "\n"); error != 0) {
    // Where this fails too, a torn last line is dropped when it is read.
    [[maybe_unused]] const int kept = before >= 0 ? ::ftruncate(descriptor_, before) : 0;
    cannot_write(path_, error, kGoesOn);
  }
}

std::vector<std::string> read_lines(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::status(path, ignored).type() == std::filesystem::file_type::not_found) return {};
  const std::string text = read_whole(path);
  std::vector<std::string> lines;
  for (std::size_t begin = 0;;) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) return lines;
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
}

void flush_output() {
  errno = 0;
  if (std::fflush(stdout) != 0 || std::ferror(stdout))
    throw std::system_error(errno != 0 ? errno : EIO, std::generic_category());
}

void make_output_folder(const std::filesystem::path& folder, std::string_view what, std::string_view mend) {
  std::error_code error, ignored;
  const bool taken = std::filesystem::exists(folder, ignored) && !std::filesystem::is_directory(folder, ignored);
  if (!taken) std::filesystem::create_directories(folder, error);
  if (taken || !std::filesystem::is_directory(folder, ignored)) {
    const std::string why = taken ? "there is a file of that name" : error ? error.message() : "it vanished";
    throw UserError(fmt::format("{}: {} cannot be made: {}; {}", folder.string(), what, why, mend));
  }
  if (::access(folder.c_str(), R_OK | W_OK | X_OK) != 0) {
    throw UserError(fmt::format("{}: {} cannot be used: {}; {}", folder.string(), what, std::strerror(errno), mend));
  }
  const std::filesystem::path probe = folder / ".arboretum-probe";
  const int descriptor = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) cannot_write(folder, errno);
  ::close(descriptor);
  ::unlink(probe.c_str());
}

}  // namespace arboretum
