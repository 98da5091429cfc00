#include "experiments/interrupt.h"

#include <unistd.h>

#include <cstddef>
#include <string_view>

namespace arboretum {
namespace {

constexpr std::string_view kOverProgress = "\r\033[K";  // on a terminal
constexpr std::string_view kLine =
    "arboretum: interrupted; what was measured is kept, and the same command with --resume goes on from there\n";

void write_out(std::string_view text) { static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size())); }

/// Calls only what a signal handler may. The signal's own handler is back by then (SA_RESETHAND).
template <bool Terminal>
void tell(int signal) {
  if (Terminal) write_out(kOverProgress);
  write_out(kLine);
  ::raise(signal);
}

}  // namespace

InterruptNote::InterruptNote() {
  struct sigaction told {};
  told.sa_handler = ::isatty(STDERR_FILENO) == 1 ? tell<true> : tell<false>;
  told.sa_flags = static_cast<int>(SA_RESETHAND);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &before_[i]);
    if (before_[i].sa_handler == SIG_DFL) ::sigaction(kSignals[i], &told, nullptr);
  }
}

InterruptNote::~InterruptNote() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &before_[i], nullptr);
}

}  // namespace arboretum
