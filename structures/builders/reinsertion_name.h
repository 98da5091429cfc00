// How builders that are followed by reinsertion are called.
#pragma once

#include <string_view>

namespace arboretum {

/// Every builder of binary trees has a second key, this behind its own: its tree improved by reinsertion.
inline constexpr std::string_view kReinsertion = "_reinsertion";

}  // namespace arboretum
