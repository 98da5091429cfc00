#include "structures/bvh/bvh.h"

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh {

void BvhBase::set_scene(const TriangleMesh& mesh, const Bounds3f& bounds, float max_coordinate) noexcept {
  vertices_ = mesh.vertices.data(), triangles_ = mesh.size(), bounds_ = bounds, max_coordinate_ = max_coordinate;
}

template class WideBvh<SoaNodes<2>>;
template class WideBvh<SoaNodes<4>>;
template class WideBvh<SoaNodes<8>>;
template class WideBvh<SoaNodes<16>>;

}  // namespace arboretum::bvh
