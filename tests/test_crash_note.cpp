// What a crash says: in a process of its own, which then ends as it would without.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <functional>
#include <string>

#include "experiments/crash_note.h"
#include "tests/catch.h"
#include "tests/folder.h"

using namespace arboretum;

namespace {

struct End {
  int status = 0;
  std::string said;
};

/// What becomes of a process that does this.
End end_of(const std::function<void()>& work) {
  int ends[2];
  REQUIRE(::pipe(ends) == 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    ::dup2(ends[1], STDERR_FILENO);
    for (int s : CrashNote::kSignals) std::signal(s, SIG_DFL);  // Catch's and a sanitizer's have no say here
    work();
    ::_exit(0);
  }
  ::close(ends[1]);
  End end;
  char text[512];
  for (ssize_t n; (n = ::read(ends[0], text, sizeof text)) > 0;) end.said.append(text, std::size_t(n));
  ::close(ends[0]);
  ::waitpid(child, &end.status, 0);
  return end;
}

// Sanitizers would tell of these in their own words.
#define ARBORETUM_UNCHECKED __attribute__((noinline, no_sanitize("undefined", "address")))

ARBORETUM_UNCHECKED int overflow(int depth) {
  if (depth < 0) return 0;
  volatile char frame[4096];
  frame[depth % 4096] = char(depth);
  return overflow(depth + 1) + frame[0];
}

ARBORETUM_UNCHECKED void write_nowhere() {
  volatile int* volatile nowhere = nullptr;
  *nowhere = 1;
}

ARBORETUM_UNCHECKED void divide_by_zero() {
  volatile int one = 1, zero = 0;
  one = one / zero;
}

}  // namespace

TEST_CASE("a crash names what is under way, once, and ends the process by its signal") {
  struct Crash {
    int signal;
    std::string name;
    void (*crash)();
  };
  const Crash crashes[] = {
      {SIGSEGV, "SIGSEGV", write_nowhere},        {SIGSEGV, "SIGSEGV", [] { (void)overflow(0); }},
      {SIGFPE, "SIGFPE", divide_by_zero},         {SIGILL, "SIGILL", [] { __asm__ volatile("ud2"); }},
      {SIGABRT, "SIGABRT", [] { std::abort(); }}, {SIGBUS, "SIGBUS", [] { ::raise(SIGBUS); }},
  };
  for (const Crash& c : crashes) {
    INFO(c.name);
    const End end = end_of([&] {
      const CrashNote note("; so it goes");
      const UnderWay outer("the cell");
      { const UnderWay inner("its build"); }
      c.crash();
    });
    CHECK(WIFSIGNALED(end.status));
    CHECK(WTERMSIG(end.status) == c.signal);
    CHECK(end.said == "arboretum: crashed (" + c.name + ") in the cell; so it goes\n");
  }
}

TEST_CASE("without anything under way a crash says so; after the note's life it says nothing") {
  const End between = end_of([] {
    const CrashNote note("");
    { const UnderWay ended("the cell"); }
    std::abort();
  });
  CHECK(between.said == "arboretum: crashed (SIGABRT) between cells\n");
  const End after = end_of([] {
    { const CrashNote note(""); }
    std::abort();
  });
  CHECK(after.said.empty());
  CHECK(WTERMSIG(after.status) == SIGABRT);
}

TEST_CASE("what crashed is recorded, a line a crash, and read again") {
  const test::Folder folder;
  const std::filesystem::path record = folder.path() / kCrashFile;
  CHECK(recorded_crashes(record).empty());
  for (const char* what : {"a cell", "the build for another"}) {
    const End end = end_of([&] {
      const CrashNote note("", record);
      const UnderWay cell(what);
      std::abort();
    });
    CHECK(WTERMSIG(end.status) == SIGABRT);
  }
  (void)end_of([&] {
    const CrashNote note("", record);
    std::abort();  // between cells: nothing can be left out
  });
  CHECK(recorded_crashes(record) == std::set<std::string, std::less<>>{"a cell", "the build for another"});
}

TEST_CASE("of a name that is too long its beginning is said") {
  const End end = end_of([] {
    const CrashNote note("");
    const UnderWay cell(std::string(100'000, 'x'));
    std::abort();
  });
  CHECK(end.said.size() > 4000);
  CHECK(end.said.size() < 5000);
  CHECK(end.said.back() == '\n');
}
