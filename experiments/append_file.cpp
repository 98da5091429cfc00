#include "experiments/append_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "core/error.h"

namespace arboretum {
namespace {

[[noreturn]] void cannot_write(const std::filesystem::path& path, int error) {
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  throw UserError(fmt::format("{}: cannot be written: {}; {}", path.string(), std::strerror(error),
                              full ? "free some space and start again (a run goes on with --resume)"
                                   : "name a file in a folder that exists and may be written to"));
}

/// Bytes up to and with the last newline.
off_t whole_lines(int descriptor, const std::filesystem::path& path) {
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) cannot_write(path, errno);
  off_t end = status.st_size;
  char c = 0;
  while (end > 0 && ::pread(descriptor, &c, 1, end - 1) == 1 && c != '\n') --end;
  return end;
}

int write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

constexpr int kMostLinks = 40;  // the kernel's own bound

/// Where a file's text goes: into what is there, or over it.
struct Target {
  std::filesystem::path path;  ///< behind all symbolic links
  int descriptor = -1;         ///< of this process, where `path` names one, as /dev/stdout does
  bool in_place = false;
};

/// The descriptor that an entry of /proc/self/fd stands for. Such an entry is a link that leads nowhere by its text,
/// and opening it anew would begin at the start of the file.
int own_descriptor(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::string name = path.filename().string();
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const bool is_number = error == std::errc{} && end == name.data() + name.size();
  return is_number && std::filesystem::equivalent(path.parent_path(), "/proc/self/fd", ignored) ? number : -1;
}

Target target_of(std::filesystem::path path) {
  std::error_code error;
  for (int links = 0; links < kMostLinks; ++links) {
    if (const int descriptor = own_descriptor(path); descriptor >= 0) return {path, descriptor, true};
    const std::filesystem::path next = std::filesystem::read_symlink(path, error);
    if (error) break;
    path = path.parent_path() / next;  // an absolute one takes the place of all
  }
  const auto status = std::filesystem::status(path, error);
  return {path, -1, std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)};
}

void write_in_place(const Target& target, std::string_view text, const std::filesystem::path& path) {
  std::fflush(stdout);  // what was printed before comes first where both go to the same place
  const bool ours = target.descriptor >= 0;
  const int descriptor = ours ? target.descriptor : ::open(target.path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
  if (descriptor < 0) cannot_write(path, errno);
  int error = write_all(descriptor, text);
  if (!ours && ::close(descriptor) != 0 && error == 0) error = errno;
  if (error != 0) cannot_write(path, error);
}

}  // namespace

AppendFile::AppendFile(std::filesystem::path path, bool keep) : path_(std::move(path)) {
  descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | (keep ? 0 : O_TRUNC), 0666);
  if (descriptor_ < 0) cannot_write(path_, errno);
  struct stat status {};
  if (keep && ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode) &&
      ::ftruncate(descriptor_, whole_lines(descriptor_, path_)) != 0) {
    cannot_write(path_, errno);
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
    if (before >= 0 && ::ftruncate(descriptor_, before) != 0)
      errno = error;  // a torn last line is dropped when it is read
    cannot_write(path_, error);
  }
}

std::vector<std::string> read_lines(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
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

void write_whole(const std::filesystem::path& path, std::string_view text) {
  const Target target = target_of(path);
  if (target.in_place) return write_in_place(target, text, path);
  std::filesystem::path beside = target.path;
  beside += ".part";
  const int descriptor = ::open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) cannot_write(path, errno);
  int error = write_all(descriptor, text);
  if (::close(descriptor) != 0 && error == 0) error = errno;
  if (error == 0 && ::rename(beside.c_str(), target.path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(beside.c_str());
    cannot_write(path, error);
  }
}

void require_writable(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) cannot_write(path, EISDIR);
  const Target target = target_of(path);
  if (target.descriptor >= 0 && ::fcntl(target.descriptor, F_GETFL) < 0) cannot_write(path, errno);
  if (target.in_place && target.descriptor < 0 && ::access(target.path.c_str(), W_OK) != 0) cannot_write(path, errno);
  if (target.in_place) return;
  const std::filesystem::path folder =
      target.path.has_parent_path() ? target.path.parent_path() : std::filesystem::path(".");
  if (::access(folder.c_str(), W_OK | X_OK) != 0) cannot_write(path, errno);
  if (!std::filesystem::is_directory(folder, ignored)) cannot_write(path, ENOTDIR);
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
