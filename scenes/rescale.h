// Rescaling: a scene whose coordinates are too large or too small for the promises of intersectors, brought into range
// by an exact power of two.
#pragma once

#include "scenes/scene.h"

namespace arboretum {

/// Multiplies the scene by a power of two where its largest coordinate lies below 2^-40, or where more than one in a
/// hundred of its triangles have one beyond kMaxCoordinate: what is larger is then below 1, or as much above as keeps
/// every coordinate exact, none of them becoming subnormal. A scene that spans too much for that stays as it is, and so
/// does one with a few stray triangles far out: sanitise() drops those. Camera, lights, key frames and instances
/// follow, and what a Layout placed is laid out again where it grows; the power of two stands in `scene.report` and in
/// a warning, led by `source`.
void rescale(Scene& scene, const std::string& source);

}  // namespace arboretum
