// What a mesh that comes from a program must be before structures build over it. All throw UserError, which names
// triangle, vertex, key frame or instance.
#pragma once

#include <string_view>

#include "core/mesh.h"

namespace arboretum {

/// Largest |coordinate| that a check lets pass: promises hold up to kMaxCoordinate (2^40), structures build of all that
/// is finite.
enum class Largest { max_coordinate, finite };

/// Key frames have equally many vertices, indices are below their number, and a triangle's vertices are in every frame
/// finite and no larger than `largest` says.
void check_triangles(const TriangleMesh& mesh, Largest largest = Largest::max_coordinate);
/// No key frames, which `structure` does not hold.
void check_one_moment(const TriangleMesh& mesh, std::string_view structure);
/// Instances lay the prototypes' triangles out one after the other as core/instances.h says, prototypes are themselves
/// what check_triangles() takes, maps are finite with a determinant that is neither 0 nor overflows, and every corner
/// of the flat mesh is where its instance's map puts it: within 2^-20 of the sum of the products' magnitudes, which
/// leaves room for a layout in float. A mesh without instances is none of its concern.
void check_instances(const TriangleMesh& mesh, Largest largest = Largest::max_coordinate);

}  // namespace arboretum
