// What the SAH builders that partition references share beside their splits: references of a mesh, nodes, leaves.
#pragma once

#include "structures/builders/sah_bins.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

/// A vertex as four lanes, the fourth of any value; the array's last vertex is not read beyond.
ARBORETUM_INLINE vf<4> vertex(const TriangleMesh& mesh, std::uint32_t v) {
  if (__builtin_expect(std::size_t{v} + 1 < mesh.vertices.size(), 1)) return vf<4>::load(&mesh.vertices[v]);
  const Vec3f p = mesh.vertices[v];
  const float lanes[4] = {p.x, p.y, p.z, 0.0f};
  return vf<4>::load(lanes);
}

/// Bounds of some references' boxes and of their (doubled) centroids.
struct Bounds {
  Box boxes, centroids;
  static Bounds none() { return {empty_box(), empty_box()}; }
  ARBORETUM_INLINE void extend(const Reference& r) {
    const vf<4> c = centroid(r);
    boxes = max_x86(Box::load(&r), boxes);
    centroids = max_x86(both_halves(-c, c), centroids);
  }
  void extend(const Bounds& b) { boxes = max_x86(b.boxes, boxes), centroids = max_x86(b.centroids, centroids); }
};

/// One reference a triangle, in order; returns their bounds.
inline Bounds make_references(const TriangleMesh& mesh, Reference* out) {
  const std::size_t n = mesh.size(), chunks = (n + kChunk - 1) / kChunk;
  MeteredVector<Bounds> partial(chunks);
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
    Bounds bounds = Bounds::none();
    for (std::size_t i = c * kChunk, end = std::min(n, i + kChunk); i < end; ++i) {
      const Triangle t = mesh.triangles[i];
      const vf<4> a = vertex(mesh, t.a), b = vertex(mesh, t.b), d = vertex(mesh, t.c);
      const vf<4> lower = min_x86(min_x86(a, b), d), upper = max_x86(max_x86(a, b), d);
      (-lower).store(out[i].neg_lower);
      upper.store(out[i].upper);
      out[i].id = std::uint32_t(i), out[i].zero = 0.0f;
      bounds.extend(out[i]);
    }
    partial[c] = bounds;
  });
  Bounds all = Bounds::none();
  for (const Bounds& p : partial) all.extend(p);
  return all;
}

/// Nodes and leaves of a tree that tasks build side by side.
class TreeWriter {
 public:
  using Share = NodePool::Share;

  /// For at most `references` references.
  TreeWriter(BinaryTree& tree, std::size_t references) : tree_(tree), pool_(tree, references, kOneTask) {}

  /// Two neighbouring nodes.
  [[nodiscard]] std::uint32_t take_pair(Share& share) noexcept { return pool_.take_pair(share); }

  void node(std::uint32_t index, Box box, std::size_t count, std::uint32_t left) {
    alignas(32) float b[8];
    box.store(b);
    tree_.nodes[index] = {{0.0f - b[0], 0.0f - b[1], 0.0f - b[2]}, left, {b[4], b[5], b[6]}, std::uint32_t(count)};
  }

  /// A leaf of references [r, end). Their ids go to `ids`, bytes in which the references themselves may lie, there or
  /// behind; `first` is what the leaf notes of that place.
  void leaf(std::uint32_t index, Box box, const Reference* r, const Reference* end, std::size_t first, void* ids) {
    node(index, box, std::size_t(end - r), 0);
    tree_.first[index] = std::uint32_t(first);
    auto* out = static_cast<std::byte*>(ids);
    for (; r < end; ++r, out += sizeof(r->id)) {
      const std::uint32_t id = r->id;
      std::memcpy(out, &id, sizeof id);
    }
  }

  /// To be called when the tree is done.
  void finish() noexcept { pool_.finish(); }

 private:
  BinaryTree& tree_;
  NodePool pool_;
};

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
