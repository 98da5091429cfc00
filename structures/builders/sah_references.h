// What the SAH builders that partition references share beside their splits: references of a mesh, nodes, leaves.
#pragma once

#include "structures/builders/sah_bins.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

/// A vertex as four lanes, the fourth of any value; the array's last vertex is not read beyond.
ARBORETUM_INLINE vf<4> vertex(const TriangleMesh& mesh, std::uint32_t v) {
  if (__builtin_expect(v + 1 < mesh.vertices.size(), 1)) return vf<4>::load(&mesh.vertices[v]);
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

/// Gives out nodes and leaves of a tree that tasks build side by side. Node numbers depend on scheduling, the tree does not.
class TreeWriter {
 public:
  /// Node indices that one task may give out, so that a task's nodes lie together and the array's used part stays dense.
  struct Pool {
    std::uint32_t next = 0, end = 0;
  };

  /// For at most `references` references; `ids` are the bytes of a reference buffer, where leaves keep their ids until finish().
  TreeWriter(BinaryTree& tree, std::size_t references, Reference* ids) : tree_(tree), ids_(ids) {
    // Fewer than n / kParallel + 1 pools (both sides of a split into tasks are larger than that) leave a block unfinished each, and one a thread
    // where ranges that were set aside are built.
    const std::size_t pools = references / kParallel + 2 + std::size_t(tbb::this_task_arena::max_concurrency());
    tree.nodes.reserve(2 * references + pools * kBlock), tree.first.reserve(tree.nodes.size());
    hand_out(1);
  }

  /// Two neighbouring nodes.
  std::uint32_t take_pair(Pool& pool) {
    if (pool.next + 2 > pool.end) {
      pool.next = next_.fetch_add(kBlock, std::memory_order_relaxed), pool.end = pool.next + kBlock;
      hand_out(kBlock);
    }
    pool.next += 2;
    return pool.next - 2;
  }

  void node(std::uint32_t index, Box box, std::size_t count, std::uint32_t left) {
    alignas(32) float b[8];
    box.store(b);
    tree_.nodes[index] = {{0.0f - b[0], 0.0f - b[1], 0.0f - b[2]}, left, {b[4], b[5], b[6]}, std::uint32_t(count)};
  }

  /// A leaf of references [r, end). Their ids go to place `at` of the buffer of ids, of which [at, at + end - r) is theirs; the
  /// references may lie in it, at `at` or behind.
  void leaf(std::uint32_t index, Box box, const Reference* r, const Reference* end, std::size_t at) {
    node(index, box, std::size_t(end - r), 0);
    tree_.first[index] = std::uint32_t(at);
    auto* out = reinterpret_cast<std::byte*>(ids_ + at);
    for (; r < end; ++r, out += sizeof(r->id)) {
      const std::uint32_t id = r->id;
      std::memcpy(out, &id, sizeof id);
    }
  }

  /// Lines up the leaves' ids in tree.primitives, which has room for them.
  void finish() {
    tree_.node_count = next_.load();
    place(0, 0);
  }

 private:
  static constexpr std::uint32_t kBlock = 64;

  void hand_out(std::size_t n) { tree_.nodes.hand_out(n), tree_.first.hand_out(n); }

  void place(std::uint32_t index, std::uint32_t begin) {
    const BinaryNode& node = tree_.nodes[index];
    if (node.is_leaf()) {
      std::memcpy(tree_.primitives.data() + begin, ids_ + tree_.first[index], node.count * sizeof(std::uint32_t));
      tree_.first[index] = begin;
      return;
    }
    const std::uint32_t right = begin + tree_.nodes[node.left].count;
    if (node.count > kParallel) {
      tbb::parallel_invoke([&] { place(node.left, begin); }, [&] { place(node.left + 1, right); });
    } else {
      place(node.left, begin), place(node.left + 1, right);
    }
  }

  BinaryTree& tree_;
  Reference* ids_;
  std::atomic<std::uint32_t> next_{1};  // 0 is the root
};

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
