#include "experiments/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/timer.h"

namespace arboretum {
namespace {

std::size_t terminal_width() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 20 ? size.ws_col : 80;
}

}  // namespace

std::string format_duration(double seconds) {
  const auto s = static_cast<long>(std::lround(std::max(seconds, 0.0)));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

Progress::Progress(std::size_t cells, std::size_t units)
    : terminal_(::isatty(STDERR_FILENO) == 1), cells_(cells), units_(std::max<std::size_t>(units, 1)),
      begin_(wall_seconds()), said_(begin_) {}

Progress::~Progress() { wipe(); }

std::string Progress::time_left() const {
  if (units_done_ == 0 || units_done_ == units_) return "";
  const double elapsed = wall_seconds() - begin_;
  return format_duration(elapsed / static_cast<double>(units_done_) * static_cast<double>(units_ - units_done_)) +
         " left";
}

std::string Progress::with_time_left(const std::string& line) const {
  const std::string left = time_left();
  return left.empty() ? line : line + "  " + left;
}

void Progress::wipe() {
  if (terminal_) fmt::print(stderr, "\r\033[K");
}

/// A plain line where none has been written for long: preparing many structures takes minutes.
void Progress::say_where() {
  constexpr double kSilence = 30.0;
  if (wall_seconds() - said_ > kSilence)
    note(with_time_left(fmt::format("[{}/{}] {} is under way", cells_done_, cells_, cell_)));
}

void Progress::draw() {
  if (!terminal_) return say_where();
  const double now = wall_seconds();
  if (now - drawn_ < 0.1) return;
  drawn_ = now;
  constexpr std::size_t kWidth = 20;
  const std::size_t filled = kWidth * units_done_ / units_;
  std::string line = fmt::format("[{:<{}}] {:3}% {:>15}  {}", std::string(filled, '#'), kWidth,
                                 100 * units_done_ / units_, time_left(), cell_);
  if (const std::size_t width = terminal_width() - 1; line.size() > width) line.resize(width);
  fmt::print(stderr, "\r\033[K{}", line);
  std::fflush(stderr);
}

void Progress::note(const std::string& line) {
  wipe();
  fmt::print(stderr, "{}\n", line);
  std::fflush(stderr);
  said_ = wall_seconds();
}

void Progress::step(const std::string& cell, std::size_t units) {
  units_done_ = std::min(units_done_ + units, units_);
  cell_ = cell;
  draw();
}

void Progress::cell_done(const std::string& cell, const std::string& outcome) {
  ++cells_done_;
  if (!terminal_) note(with_time_left(fmt::format("[{}/{}] {}  {}", cells_done_, cells_, cell, outcome)));
}

}  // namespace arboretum
