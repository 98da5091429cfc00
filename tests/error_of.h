// The line of an error.
#pragma once

#include <string>

#include "core/error.h"
#include "tests/catch.h"

namespace arboretum::test {

/// What the UserError says that `action` throws, which must be one line; empty where it throws none.
inline std::string error_of(const auto& action) {
  try {
    action();
  } catch (const UserError& error) {
    const std::string line = error.what();
    CHECK(line.find('\n') == std::string::npos);
    return line;
  }
  return {};
}

}  // namespace arboretum::test
