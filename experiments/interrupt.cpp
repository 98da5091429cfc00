#include "experiments/interrupt.h"

#include <unistd.h>

#include <cstddef>
#include <string_view>

namespace arboretum {
namespace {

constexpr std::string_view kPlain =
    "arboretum: interrupted; what was measured is kept, and the same command with --resume goes on from there\n";
constexpr std::string_view kTerminal =  // over the progress
    "\r\033[K"
    "arboretum: interrupted; what was measured is kept, and the same command with --resume goes on from there\n";

/// Calls only what a signal handler may. The signal's own handler is back by then (SA_RESETHAND).
template <const std::string_view& kLine>
void tell(int signal) {
  static_cast<void>(!::write(STDERR_FILENO, kLine.data(), kLine.size()));
  ::raise(signal);
}

}  // namespace

InterruptNote::InterruptNote() {
  struct sigaction told {};
  told.sa_handler = ::isatty(STDERR_FILENO) == 1 ? tell<kTerminal> : tell<kPlain>;
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
