#include "experiments/folder_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>

#include "core/error.h"

namespace arboretum {

// Locks of fcntl() rather than of flock(): the kernel then says who holds one.
FolderLock::FolderLock(const std::filesystem::path& folder, std::string_view mend)
    : descriptor_(::open((folder / ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
  struct flock whole {};
  whole.l_type = F_WRLCK, whole.l_whence = SEEK_SET;
  if (descriptor_ < 0 || ::fcntl(descriptor_, F_SETLK, &whole) == 0 || (errno != EACCES && errno != EAGAIN)) return;
  const bool known = ::fcntl(descriptor_, F_GETLK, &whole) == 0 && whole.l_type != F_UNLCK && whole.l_pid > 0;
  ::close(descriptor_);
  throw UserError(fmt::format("{}: another run writes here{}; {}", folder.string(),
                              known ? fmt::format(" (process {})", whole.l_pid) : "", mend));
}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace arboretum
