// Refit of a wide BVH: leaves and boxes for moved vertices, the tree's shape as it was.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "core/error.h"
#include "core/mesh_check.h"
#include "structures/box_pads.h"
#include "structures/builders/collapse.h"
#include "structures/bvh/bvh.h"
#include "structures/leaves/leaf_form.h"

namespace arboretum::bvh {

template <class Format>
class Refitter {
 public:
  Refitter(const TriangleMesh& mesh, const LeafForm& form, const BoxPads& pads, std::byte* base)
      : mesh_(mesh), form_(form), pads_(pads), base_(base) {}

  /// The new box of what is below `reference`.
  Bounds3f subtree(NodeReference reference, unsigned depth) const {
    std::byte* const at = base_ + offset_of(reference);
    if (is_leaf(reference)) return leaf(at, block_count(reference));
    auto& node = *reinterpret_cast<typename Format::Node*>(at);
    Bounds3f boxes[kMaxBranching];
    NodeReference references[kMaxBranching] = {};
    const unsigned count = Format::read(node, boxes, references);
    const auto descend = [&](unsigned i) { boxes[i] = subtree(references[i], depth + 1); };
    if (depth < kForkLevels) {
      tbb::parallel_for(0u, count, descend);
    } else {
      for (unsigned i = 0; i < count; ++i) descend(i);
    }
    Bounds3f box;
    for (unsigned i = 0; i < count; ++i) box.extend(boxes[i]), boxes[i] = pads_.widened(boxes[i]);
    Format::write(node, boxes, references, count);
    return box;
  }

 private:
  /// So many levels make some 256 tasks.
  static constexpr unsigned kForkLevels = 8 / unsigned(std::bit_width(unsigned(Format::kBranching)) - 1);

  /// Block by block, since any of a leaf's blocks may have empty lanes.
  Bounds3f leaf(std::byte* at, unsigned blocks) const {
    Box4 box;
    std::vector<std::uint32_t> ids;
    for (unsigned b = 0; b < blocks; ++b, at += form_.bytes) {
      ids.clear();
      form_.append(at, 1, ids);
      form_.fill_and_extend(at, mesh_, ids, box);
    }
    return {to_vec3f(box.lower), to_vec3f(box.upper)};
  }

  const TriangleMesh& mesh_;
  const LeafForm& form_;
  const BoxPads& pads_;
  std::byte* base_;
};

template <class Format>
void WideBvh<Format>::refit(const TriangleMesh& mesh) {
  if (mesh.size() != triangles_) {
    throw UserError(std::string(kName) + " was built from " + std::to_string(triangles_) +
                    " triangles and cannot be refitted to " + std::to_string(mesh.size()) + "; build it anew");
  }
  check_triangles(mesh);
  check_one_moment(mesh, kName);
  // A leaf's box is made of its triangles: of whole ones, whatever builders split.
  const Bounds3f all = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, mesh.size(), std::size_t{1} << 14), Bounds3f{},
      [&](const tbb::blocked_range<std::size_t>& range, Bounds3f box) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) box.extend(mesh.bounds(i));
        return box;
      },
      [](Bounds3f a, const Bounds3f& b) { return a.extend(b), a; });
  const BoxPads pads(mesh, all);
  const Bounds3f bounds = Refitter<Format>(mesh, *find_leaf_form(leaf_), pads, arena_.data()).subtree(root_, 0);
  set_scene(mesh, pads.widened(bounds), pads.common());
}

}  // namespace arboretum::bvh
