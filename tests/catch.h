// Catch2, version 2 or 3; and one assertion for many rays.
#pragma once
#if __has_include(<catch2/catch_all.hpp>)
#include <catch2/catch_all.hpp>
#else
#include <catch2/catch.hpp>
#endif

#include <cstddef>

namespace arboretum::test {

/// Requires ok(i) for each i below `count`, as one assertion; describe(i) is text that is only asked for where one
/// fails. Catch takes a microsecond for an assertion with its messages, more than a ray takes.
template <class Ok, class Describe>
void require_each(std::size_t count, const Ok& ok, const Describe& describe) {
  std::size_t first = 0;
  while (first < count && ok(first)) ++first;
  if (first == count) {
    SUCCEED();
    return;
  }
  INFO("ray " << first << " of " << count << ": " << describe(first));
  REQUIRE(first == count);
}

}  // namespace arboretum::test
