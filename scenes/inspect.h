// Inspect: what `info SCENE` says about a scene.
#pragma once

#include <vector>

#include "scenes/effects.h"
#include "scenes/scene.h"

namespace arboretum {

struct SceneInfo {
  std::size_t triangles = 0, vertices = 0;
  Bounds3f bounds;  ///< of all triangles
  /// What loading dropped, zero-area triangles among it; and images of used materials that cannot be read.
  LoadReport report;
  std::size_t duplicates = 0;  ///< triangles with the same three corner positions as an earlier one, in any order
  std::size_t slivers = 0;     ///< longest edge^2 / (2 area) > 100
  // Edges join vertices by exact position, so a mesh whose triangles share no vertices may be closed all the
  // same.
  std::size_t edges = 0;
  std::size_t boundary_edges = 0;      ///< of one triangle
  std::size_t non_manifold_edges = 0;  ///< of more than two
  bool closed = false;                 ///< neither of these
  std::size_t materials = 0;           ///< used by a triangle
  std::size_t emissive_triangles = 0;
  std::size_t lights = 0;
  std::size_t key_frames = 1;
  std::size_t moving_triangles = 0;  ///< with a corner that moves
  Shutter shutter;
  std::size_t instances = 0, prototypes = 0, prototype_triangles = 0;  ///< kept beside the mesh; 0 where none are
  /// In the scene file; all are laid out in the mesh, and kept beside it unless it moves.
  std::size_t named_instances = 0;
  std::vector<Effect> effects;
};

/// O(n log n), with all TBB threads allowed to the caller.
[[nodiscard]] SceneInfo inspect_scene(const Scene& scene);

}  // namespace arboretum
