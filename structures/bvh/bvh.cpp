#include "structures/bvh/bvh.h"

#include <cmath>

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh {

void BvhBase::set_scene(const TriangleMesh& mesh, const Bounds3f& bounds) noexcept {
  vertices_ = mesh.vertices.data(), triangles_ = mesh.size(), bounds_ = bounds, max_coordinate_ = 0.0f;
  if (bounds.empty()) return;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    max_coordinate_ = std::max({max_coordinate_, std::fabs(bounds.lower[axis]), std::fabs(bounds.upper[axis])});
  }
}

template class WideBvh<SoaNodes<2>>;
template class WideBvh<SoaNodes<4>>;
template class WideBvh<SoaNodes<8>>;
template class WideBvh<SoaNodes<16>>;

}  // namespace arboretum::bvh
