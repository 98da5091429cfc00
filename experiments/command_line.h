// The whole `arboretum` program as a function: what its main() calls, and that of executables with structures of their
// own.
#pragma once

namespace arboretum {

/// Runs the command that the words name. Errors are one line on stderr; returns the exit status (ExitStatus in
/// core/error.h). Ignores SIGXFSZ and SIGPIPE from then on: a failed write is told as an error.
[[nodiscard]] int command_line(int argc, char** argv);

}  // namespace arboretum
