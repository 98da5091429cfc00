// Sanitising, in one place for loaders and generators: what cannot be traced is dropped and counted.
#pragma once

#include "core/zero_area.h"
#include "scenes/scene.h"

namespace arboretum {

/// Drops triangles with a corner that is not finite or beyond kMaxCoordinate and those of exactly zero area,
/// in any key frame (zero area: in all), keeps the order of the others and the instances in step, and counts into
/// `scene.report`. A scene without materials gets one grey. Vertices stay, since indices refer to them; unusable ones
/// are set to the origin. Throws UserError, led by `source`, when no triangle is left.
void sanitise(Scene& scene, const std::string& source);

/// "dropped 528 of 1056 triangles: 528 out of range": those of its reasons that there are; empty where none was
/// dropped.
[[nodiscard]] std::string dropped_in_words(const LoadReport& report);

}  // namespace arboretum
