#include "core/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>

#include "core/error.h"
#include "core/parse_number.h"

namespace arboretum {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 16;
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
  const std::optional<int> number = parse_number<int>(path.filename().string());
  return number && std::filesystem::equivalent(path.parent_path(), "/proc/self/fd", ignored) ? *number : -1;
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

void write_in_place(const Target& target, std::string_view text, const std::filesystem::path& path,
                    std::string_view goes_on) {
  std::fflush(stdout);  // what was printed before comes first where both go to the same place
  const bool ours = target.descriptor >= 0;
  const int descriptor = ours ? target.descriptor : ::open(target.path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
  if (descriptor < 0) cannot_write(path, errno, goes_on);
  int error = write_all(descriptor, text);
  if (!ours && ::close(descriptor) != 0 && error == 0) error = errno;
  if (error != 0) cannot_write(path, error, goes_on);
}

/// Appends what is left of it. Returns errno, 0 where it went well.
int read_all(int descriptor, std::string& text) {
  for (;;) {
    const std::size_t before = text.size();
    text.resize(before + kPiece);
    const ssize_t count = ::read(descriptor, text.data() + before, kPiece);
    const int error = count < 0 ? errno : 0;
    text.resize(before + static_cast<std::size_t>(std::max(count, ssize_t{0})));
    if (count == 0 || (error != 0 && error != EINTR)) return error;
  }
}

[[noreturn]] void cannot_read(const std::filesystem::path& path, int error) {
  if (error == ENOENT) throw UserError(path.string() + ": no such file; check the path");
  if (error == EISDIR) throw UserError(path.string() + ": is a folder; a file is to stand there");
  throw UserError(path.string() + ": cannot be read: " + std::strerror(error) +
                  (error == EACCES ? "; check its permissions" : "; check the path and what it leads to"));
}

}  // namespace

int write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

void cannot_write(const std::filesystem::path& path, int error, std::string_view goes_on) {
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  throw UserError(path.string() + ": cannot be written: " + std::strerror(error) + "; " +
                  (full ? "free some space and start again" + std::string(goes_on)
                        : "name a file in a folder that exists and may be written to"));
}

void write_whole(const std::filesystem::path& path, std::string_view text, std::string_view goes_on) {
  const Target target = target_of(path);
  if (target.in_place) return write_in_place(target, text, path, goes_on);
  std::filesystem::path beside = target.path;
  beside += ".part";
  const int descriptor = ::open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) cannot_write(path, errno, goes_on);
  int error = write_all(descriptor, text);
  if (::close(descriptor) != 0 && error == 0) error = errno;
  if (error == 0 && ::rename(beside.c_str(), target.path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(beside.c_str());
    cannot_write(path, error, goes_on);
  }
}

std::string read_whole(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY);
  if (descriptor < 0) cannot_read(path, errno);
  std::string text;
  const int error = read_all(descriptor, text);
  ::close(descriptor);
  if (error != 0) cannot_read(path, error);
  return text;
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
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    const int error = errno;
    // Written in place, a failure would leave neither the old file nor the new one.
    if (::access(target.path.c_str(), W_OK) == 0)
      throw UserError(path.string() +
                      ": cannot be written: the file may be, but its folder may not, and a file is made " +
                      "whole beside the old one before it takes its place; name a file in another folder");
    cannot_write(path, error);
  }
  if (!std::filesystem::is_directory(folder, ignored)) cannot_write(path, ENOTDIR);
}

std::filesystem::path regular_file(const std::filesystem::path& path) {
  const Target target = target_of(path);
  if (target.in_place) throw UserError(path.string() + ": is no file that can be written anew; name another");
  return target.path;
}

}  // namespace arboretum
