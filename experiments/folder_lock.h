// FolderLock: one writer at a time in a result folder.
#pragma once

#include <filesystem>
#include <string_view>

namespace arboretum {

/// Holds a folder for this process until the end of the object's life, or of the process: the kernel frees the lock
/// then, by kill -9 too. Advisory, on the file `.lock` in the folder, which stays. On a file system that knows no locks
/// it holds nothing.
class FolderLock {
 public:
  /// Throws UserError, with `mend`, where another process holds the folder.
  FolderLock(const std::filesystem::path& folder, std::string_view mend);
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock();

 private:
  int descriptor_;
};

}  // namespace arboretum
