// CrashNote: which cell was under way when the program crashed, in a kernel or builder of one's own for example.
#pragma once

#include <array>
#include <csignal>
#include <string>
#include <string_view>

namespace arboretum {

/// While it lives a crash writes one line to stderr that names what is under way (UnderWay), and ends the process as it
/// would without: by the same signal, or by whatever was to handle it before (a sanitizer's report). One at a time. A
/// stack that overflows in a thread other than the one that made the note is not told of.
class CrashNote {
 public:
  /// `after` ends the line; it must live as long.
  explicit CrashNote(std::string_view after);
  CrashNote(const CrashNote&) = delete;
  CrashNote& operator=(const CrashNote&) = delete;
  ~CrashNote();

  static constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
};

/// While it lives `what` is under way; then what was before.
class UnderWay {
 public:
  explicit UnderWay(std::string_view what);
  UnderWay(const UnderWay&) = delete;
  UnderWay& operator=(const UnderWay&) = delete;
  ~UnderWay();

 private:
  std::string before_;
};

}  // namespace arboretum
