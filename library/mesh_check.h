// What a mesh that comes from a program must be before structures build over it.
#pragma once

#include "core/mesh.h"

namespace arboretum {

/// Throws UserError, which names triangle, vertex, key frame or instance, where an index is beyond what it points into,
/// key frames have different numbers of vertices, a vertex of a triangle is not finite or beyond kMaxCoordinate (2^40),
/// or instances do not lay the prototypes' triangles out one after the other as core/instances.h says.
void check_mesh(const TriangleMesh& mesh);

}  // namespace arboretum
