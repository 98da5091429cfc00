#include "scenes/file_bytes.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "core/error.h"

namespace arboretum {
namespace {

/// Opens the file, checks that it is one and holds something; returns its descriptor and size.
std::pair<int, std::size_t> open_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  // Without O_NONBLOCK the opening of a pipe waits for who writes into it.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    if (errno == ENOENT) throw UserError(name + ": no such file; check the path");
    throw UserError(name + ": cannot be read: " + std::strerror(errno));
  }
  struct stat status {};
  std::string fault;
  if (::fstat(descriptor, &status) != 0) {
    fault = std::string(": cannot be read: ") + std::strerror(errno);
  } else if (S_ISDIR(status.st_mode)) {
    fault = ": is a directory; name a model or scene file in it";
  } else if (!S_ISREG(status.st_mode)) {
    fault = ": is a pipe or a device; name a regular file";
  } else if (status.st_size == 0) {
    fault = ": the file is empty";
  }
  if (!fault.empty()) {
    ::close(descriptor);
    throw UserError(name + fault);
  }
  return {descriptor, std::size_t(status.st_size)};
}

}  // namespace

FileBytes::FileBytes(const std::filesystem::path& path) {
  const auto [descriptor, size] = open_file(path);
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  const int error = errno;
  ::close(descriptor);
  if (data == MAP_FAILED) throw UserError(path.string() + ": cannot be read: " + std::strerror(error));
  ::madvise(data, size, MADV_SEQUENTIAL);
  data_ = data, size_ = size;
}

FileBytes::~FileBytes() {
  if (data_) ::munmap(data_, size_);
}

std::string_view without_mark(std::string_view text) noexcept {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  return text.starts_with(kMark) ? text.substr(kMark.size()) : text;
}

void check_readable_file(const std::filesystem::path& path) { ::close(open_file(path).first); }

}  // namespace arboretum
