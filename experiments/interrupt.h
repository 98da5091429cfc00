// InterruptNote: what Ctrl-C, or a batch system's SIGTERM, says of a run that it ends.
#pragma once

#include <array>
#include <csignal>

namespace arboretum {

/// While it lives these signals write one line to stderr, that --resume goes on from there, and end the process as they
/// would without. A signal that is ignored (nohup, a shell's background) stays so.
class InterruptNote {
 public:
  InterruptNote();
  InterruptNote(const InterruptNote&) = delete;
  InterruptNote& operator=(const InterruptNote&) = delete;
  ~InterruptNote();

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM};
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace arboretum
