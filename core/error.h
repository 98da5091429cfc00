// Errors that a user can mend: one clear line, and the exit status that goes with it.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace arboretum {

/// Exit statuses of the command line (docs/command-line.md).
enum class ExitStatus : int { kDone = 0, kWrongAnswers = 1, kUsage = 2, kRegression = 3, kNothingMeasured = 4 };

/// Thrown for whatever the user can mend: a missing file, a misspelt key. `what()` is one line that says what, where
/// and how to mend it; main() prints it as `arboretum: <what>` and exits with kUsage. Whatever the message quotes of
/// the user's, it stays one line: control characters are written as \n, \t or \x1b, and of a message of more than
/// kLongest characters the middle is left out.
class UserError : public std::runtime_error {
 public:
  static constexpr std::size_t kLongest = 4096;
  explicit UserError(const std::string& message);
};

}  // namespace arboretum
