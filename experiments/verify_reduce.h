// The smallest part of a mesh on which a cell still breaks its promise.
#pragma once

#include <optional>

#include "experiments/verification.h"

namespace arboretum {

/// `breach` was found on `mesh`. Takes triangles away as long as the same ray, alone, still breaks the promise,
/// whatever part of it; nothing where it does not even before, for meshes that move, and for large ones where the
/// triangles about the exact hit and the answer are not enough.
[[nodiscard]] std::optional<TriangleMesh> reduce(const VerifiedCell& cell, const Registry& registry,
                                                 const TriangleMesh& mesh, const Breach& breach);

}  // namespace arboretum
