#include "experiments/crash_note.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <vector>

namespace arboretum {
namespace {

constexpr std::size_t kMost = 4000;  // of a cell's name; what is longer is cut
constexpr std::size_t kStack = std::size_t{64} << 10;

/// All that a signal handler can reach is global, and must be there before it is needed.
struct State {
  std::array<char, kMost> what{};
  std::atomic<std::size_t> length{0};  ///< of `what`; 0 while it is written
  std::string_view after;
  std::array<char, 4096> record{};  ///< a path, or nothing
  bool terminal = false;
  std::array<struct sigaction, CrashNote::kSignals.size()> before{};
  stack_t stack_before{};
};
State state;
static_assert(std::atomic<std::size_t>::is_always_lock_free);

std::string_view name_of(int signal) {
  switch (signal) {
    case SIGSEGV: return "SIGSEGV";
    case SIGBUS: return "SIGBUS";
    case SIGFPE: return "SIGFPE";
    case SIGILL: return "SIGILL";
    default: return "SIGABRT";
  }
}

/// Calls only what a signal handler may.
void tell(int signal, siginfo_t* info, void*) {
  std::array<char, kMost + 500> line;
  std::size_t size = 0;
  const auto add = [&](std::string_view text) {
    const std::size_t count = std::min(text.size(), line.size() - size);
    std::memcpy(line.data() + size, text.data(), count);
    size += count;
  };
  if (state.terminal) add("\r\033[K");  // over the progress bar
  add("arboretum: crashed (");
  add(name_of(signal));
  const std::size_t length = state.length;
  add(length > 0 ? ") in " : ") between cells");
  add({state.what.data(), length});
  add(state.after);
  add("\n");
  static_cast<void>(!::write(STDERR_FILENO, line.data(), size));
  if (length > 0 && state.record[0] != 0) {
    const int file = ::open(state.record.data(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    size = 0, add({state.what.data(), length}), add("\n");
    if (file >= 0) static_cast<void>(!::write(file, line.data(), size)), ::close(file);
  }
  for (std::size_t i = 0; i < CrashNote::kSignals.size(); ++i)
    if (CrashNote::kSignals[i] == signal) ::sigaction(signal, &state.before[i], nullptr);
  // A fault comes again when its instruction does; one that was sent has to be sent again.
  if (info->si_code <= 0) ::raise(signal);
}

void set_under_way(std::string_view what) {
  state.length = 0;
  const std::size_t length = std::min(what.size(), kMost);
  std::memcpy(state.what.data(), what.data(), length);
  state.length = length;
}

}  // namespace

CrashNote::CrashNote(std::string_view after, const std::filesystem::path& record) {
  static std::vector<char> stack(kStack);
  const std::string path = record.empty() ? std::string() : std::filesystem::absolute(record).string();
  state.record.fill(0);
  if (path.size() < state.record.size()) std::ranges::copy(path, state.record.begin());
  state.after = after, state.terminal = ::isatty(STDERR_FILENO) == 1;
  stack_t own{};
  own.ss_sp = stack.data(), own.ss_size = stack.size();
  ::sigaltstack(&own, &state.stack_before);
  struct sigaction told {};
  told.sa_sigaction = tell;
  told.sa_flags = SA_SIGINFO | SA_ONSTACK;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &state.before[i]);
    if (state.before[i].sa_handler != SIG_IGN) ::sigaction(kSignals[i], &told, nullptr);
  }
}

CrashNote::~CrashNote() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &state.before[i], nullptr);
  ::sigaltstack(&state.stack_before, nullptr);
  set_under_way({});
}

std::set<std::string, std::less<>> recorded_crashes(const std::filesystem::path& record) {
  std::set<std::string, std::less<>> crashes;
  std::ifstream file(record);
  for (std::string line; std::getline(file, line);) crashes.insert(line);
  return crashes;
}

UnderWay::UnderWay(std::string_view what) : before_(state.what.data(), state.length) { set_under_way(what); }

UnderWay::~UnderWay() { set_under_way(before_); }

}  // namespace arboretum
