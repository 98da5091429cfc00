#include "experiments/plotting.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <system_error>

#include "core/data_folder.h"
#include "core/error.h"
#include "experiments/append_file.h"

extern char** environ;

namespace arboretum {
namespace {

std::string read_all(int descriptor) {
  std::string text;
  char part[4096];
  for (;;) {
    const ssize_t got = ::read(descriptor, part, sizeof part);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return text;
    text.append(part, static_cast<std::size_t>(got));
  }
}

/// Exit status, or -1 when the program could not be started or died. What it writes to stderr goes to `errors`.
int run_program(std::vector<std::string> words, bool quiet_out, std::string& errors) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (quiet_out) posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return posix_spawn_file_actions_destroy(&actions), -1;
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  if (error == 0) errors = read_all(ends[0]);
  ::close(ends[0]);
  int status = 0;
  if (error != 0 || ::waitpid(pid, &status, 0) != pid || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

/// ARBORETUM_PYTHON; empty: not set.
std::string chosen_python() {
  const char* chosen = std::getenv("ARBORETUM_PYTHON");
  return chosen ? chosen : "";
}

std::string python_problem() {
  return fmt::format(
      "ARBORETUM_PYTHON is '{}', which cannot be started or has no matplotlib and numpy; name an interpreter that has "
      "them, or unset it",
      chosen_python());
}

/// Of a script's stderr: its `error: …`, or how Python ends a trace.
std::string last_line(std::string text) {
  while (text.ends_with('\n')) text.pop_back();
  text.erase(0, text.rfind('\n') + 1);
  constexpr std::string_view kHead = "error: ";
  return text.starts_with(kHead) ? text.substr(kHead.size()) : text;
}

/// What plot.py ends with where it drew all figures but some.
constexpr int kSomeFailed = 3;

/// Runs a script of plots/ with its arguments. One line that says why not, or empty.
std::string run_script(const char* name, const std::vector<std::string>& arguments, bool quiet) {
  const std::filesystem::path script = data_folder() / "plots" / name;
  if (!std::filesystem::exists(script)) return fmt::format("no plots: {} is missing; install again", script.string());
  const std::optional<std::string> python = find_plot_python();
  if (!python && !chosen_python().empty()) return python_problem();
  if (!python)
    return "no plots: no python3 here has matplotlib; apt-get install python3-matplotlib, then `plot` the results";
  std::vector<std::string> words{*python, script.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::string errors;
  const int status = run_program(words, quiet, errors);
  if (status == 0) return fmt::print(stderr, "{}", errors), "";
  const std::string why = last_line(errors);
  if (status == kSomeFailed) {
    fmt::print(stderr, "{}", std::string_view(errors).substr(0, errors.rfind("error: ")));
    return "figures that " + why;
  }
  return fmt::format("no plots: {}", why.empty() ? fmt::format("{} ended with status {}", name, status) : why);
}

}  // namespace

std::optional<std::string> find_plot_python() {
  std::vector<std::string> candidates{"/usr/bin/python3", "python3"};
  if (std::string chosen = chosen_python(); !chosen.empty()) candidates = {std::move(chosen)};
  for (const std::string& python : candidates) {
    const char* kTry =
        "import sys, importlib.util as u; sys.exit(not (u.find_spec('matplotlib') and u.find_spec('numpy')))";
    std::string ignored;
    if (run_program({python, "-c", kTry}, true, ignored) == 0) return python;
  }
  return std::nullopt;
}

void require_chosen_python() {
  if (!chosen_python().empty() && !find_plot_python()) throw UserError(python_problem());
}

std::string draw_plots(const std::filesystem::path& results, const std::vector<std::string>& figures, bool quiet) {
  std::vector<std::string> words;
  if (!figures.empty()) words = {"--only", fmt::format("{}", fmt::join(figures, ","))};
  words.insert(words.end(), {"--", results.string()});  // whose name may begin with a dash
  return run_script("plot.py", words, quiet);
}

std::string draw_ratios(const std::string& comparison_json, const std::filesystem::path& file) {
  std::filesystem::path beside = file;
  beside += ".json.part";
  write_whole(beside, comparison_json);
  const std::string problem = run_script("ratios.py", {beside.string(), file.string()}, false);
  std::error_code ignored;
  std::filesystem::remove(beside, ignored);
  return problem;
}

}  // namespace arboretum
