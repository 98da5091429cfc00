// CrashNote: which cell was under way when the program crashed, in a kernel or builder of one's own for example.
#pragma once

#include <array>
#include <csignal>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>

namespace arboretum {

/// While it lives a crash writes one line to stderr that names what is under way (UnderWay), and ends the process as it
/// would without: by the same signal, or by whatever was to handle it before (a sanitizer's report). One at a time. A
/// stack that overflows in a thread other than the one that made the note is not told of.
class CrashNote {
 public:
  /// `after` ends the line; it must live as long. A file `record` gets a line, too: what was under way.
  explicit CrashNote(std::string_view after, const std::filesystem::path& record = {});
  CrashNote(const CrashNote&) = delete;
  CrashNote& operator=(const CrashNote&) = delete;
  ~CrashNote();

  static constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
};

/// That of a run, in its folder.
inline constexpr const char* kCrashFile = "crashes.txt";
/// What such a file has; nothing where there is none.
[[nodiscard]] std::set<std::string, std::less<>> recorded_crashes(const std::filesystem::path& record);

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
