// The phase of a build that is none: a library made ready, as Embree's device, which serves any number of builds.
#pragma once

#include <string_view>

namespace arboretum {

/// A structure's build() reports it like other phases; build_structure() takes it off the build's times and phases.
inline constexpr std::string_view kUntimedPhase = "untimed";

}  // namespace arboretum
