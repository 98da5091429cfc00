// Instances: meshes that stand at several places of a scene. TriangleMesh holds them laid out in one flat mesh; beside
// it stands what a structure of two levels needs: each prototype once, and where it is placed.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh.h"

namespace arboretum {

/// x' = m[.][0..2] x + m[.][3], row by row; the identity as it is made.
struct AffineMap {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  friend bool operator==(const AffineMap&, const AffineMap&) = default;
};

[[nodiscard]] inline bool is_identity(const AffineMap& map) noexcept { return map == AffineMap{}; }
/// The image of a point, computed in double and rounded to float: how flat meshes are made, with the same bits
/// everywhere.
[[nodiscard]] Vec3f transform_point(const AffineMap& map, Vec3f p) noexcept;
/// The same for a direction: no translation.
[[nodiscard]] Vec3f transform_direction(const AffineMap& map, Vec3f d) noexcept;
/// Of the linear part.
[[nodiscard]] double determinant(const AffineMap& map) noexcept;
/// The determinant must not be 0.
[[nodiscard]] AffineMap inverse(const AffineMap& map) noexcept;
/// || |L| |L^-1| ||, largest row sum: how much the map and its inverse can magnify rounding (Skeel). 1 for a scaled
/// permutation of the axes, at most 3 for a rotation; infinite where the inverse overflows.
[[nodiscard]] double condition(const AffineMap& map) noexcept;

struct Instance {
  std::uint32_t prototype = 0;
  /// Id in the flat mesh of the prototype's triangle 0; the others follow in order.
  std::uint32_t first_primitive = 0;
  AffineMap to_world;
};

/// All triangles of the flat mesh belong to exactly one instance; instances are in the order of their first primitive.
struct Instancing {
  std::vector<TriangleMesh> prototypes;  ///< in object space; no prototype moves or has instances
  std::vector<Instance> instances;
};

}  // namespace arboretum
