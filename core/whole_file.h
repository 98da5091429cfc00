// Files that are written and read as a whole: every write and read is checked, and a failed write leaves what was there
// before whole.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace arboretum {

/// Writes beside `path` and renames over it, so that a failure leaves the old file; a symbolic link stays and what it
/// leads to is written. What is there and is no regular file (a device, a FIFO, /dev/stdout, /dev/fd/63) is written to
/// as it stands. Throws UserError; `goes_on`: what to do about a full disk beside freeing space.
void write_whole(const std::filesystem::path& path, std::string_view text, std::string_view goes_on = "");
/// All bytes of a file, of a pipe or a device too. Throws UserError.
[[nodiscard]] std::string read_whole(const std::filesystem::path& path);
/// Throws UserError where write_whole could not write to `path`, as far as can be seen without writing.
void require_writable(const std::filesystem::path& path);
/// The regular file, there or not, that `path` leads to by symbolic links, for who writes beside it and renames over
/// it. Throws UserError where it is something else.
[[nodiscard]] std::filesystem::path regular_file(const std::filesystem::path& path);

/// Of the system, as write() does it, but all of it. Returns errno, 0 where it went well.
[[nodiscard]] int write_all(int descriptor, std::string_view text);
/// Throws the UserError of a write to `path` that failed with `error` (errno). `goes_on` as of write_whole().
[[noreturn]] void cannot_write(const std::filesystem::path& path, int error, std::string_view goes_on = "");

}  // namespace arboretum
