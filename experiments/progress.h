// Progress: on a terminal a bar with the cell's name and the time left, else plain lines, one a cell and one in half a
// minute at least while cells are under way. Goes to stderr.
#pragma once

#include <cstddef>
#include <string>

namespace arboretum {

class Progress {
 public:
  /// `cells` and `units` that lie ahead; a unit is about one repetition.
  Progress(std::size_t cells, std::size_t units);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress();

  /// A line that stays.
  void note(const std::string& line);
  /// `units` more are done; `cell` is under way.
  void step(const std::string& cell, std::size_t units);
  /// A cell is done; `outcome` is a few words.
  void cell_done(const std::string& cell, const std::string& outcome);

 private:
  void draw();
  void wipe();
  void say_where();
  [[nodiscard]] std::string time_left() const;
  [[nodiscard]] std::string with_time_left(const std::string& line) const;

  bool terminal_;
  std::size_t cells_, units_, cells_done_ = 0, units_done_ = 0;
  double begin_, drawn_ = 0.0, said_;
  std::string cell_;
};

/// "1 h 05 min", "3 min 20 s", "12 s".
[[nodiscard]] std::string format_duration(double seconds);

}  // namespace arboretum
