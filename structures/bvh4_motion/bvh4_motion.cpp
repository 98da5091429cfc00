// Why a box holds its triangles at every time. Let K be the number of key frames, u = 2^-24, m the largest |coordinate|
// of a triangle in any frame, and c(t) one coordinate of a corner, exactly linear between key frames.
// - linear_bounds() fits a line L through the first and last frame's smallest coordinate and lowers it by the most that
//   any key frame lies below it. So L(t_k) <= c(t_k) at every key time t_k = k / (K - 1), and as both are linear in
//   between, L <= c on [0, 1].
// - A corner is computed as a (1 - w) + b w, where w is off by u (K - 1) at most (the rounding of time * (K - 1)): that
//   moves it by
//     (K - 1) u |b - a| <= 2 (K - 1) u m;
//   the roundings of 1 - w, of two products and a sum add less than 4.1 u m. The line is lowered by (2 K + 8) u m,
//   which also covers the double arithmetic of the fit and a time that rounds across a key frame (c is continuous).
// - Lines are rounded down to float at both ends. A node stores p = L(0) and q <= L(1) - p, rounded down:
//     p + q t <= L(t) on [0, 1].
// - Union: the minimum of the ends of two lines is a line that is below both.
// Upper planes are the mirror image. What the kernel's evaluation of p + q t adds is part of the box test's pad
// (bvh4_motion_kernels.h).
#include "structures/bvh4_motion/bvh4_motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/memory_meter.h"
#include "core/rounding.h"
#include "core/timer.h"
#include "intersectors/blocks.h"
#include "structures/archive.h"
#include "structures/box_pads.h"
#include "structures/builders/builders.h"

namespace arboretum::bvh4_motion {
namespace {

using Block = IndexBlock<4>;
using bvh::NodeReference;

/// Where a node's unused bytes begin.
constexpr std::size_t kNodePadding = offsetof(Node, child) + sizeof(Node::child);

constexpr std::size_t round_up(std::size_t bytes) noexcept { return (bytes + 31) / 32 * 32; }

Bounds3f at_half_time(const LinearBounds& b) noexcept {
  return {b.at0.lower * 0.5f + b.at1.lower * 0.5f, b.at0.upper * 0.5f + b.at1.upper * 0.5f};
}

/// Copies a tree of still boxes into one of moving boxes.
class Converter {
 public:
  Converter(const TriangleMesh& mesh, const bvh::Bvh4& from) : from_(from) {
    bounds_.resize(mesh.size());
    tbb::parallel_for(std::size_t{0}, mesh.size(),
                      [&](std::size_t i) { bounds_[i] = linear_bounds(mesh, std::uint32_t(i)); });
    Bounds3f at_any_time;
    for (const LinearBounds& b : bounds_) at_any_time.extend(b.at0), at_any_time.extend(b.at1);
    pads_ = BoxPads(mesh, at_any_time);
  }
  [[nodiscard]] const BoxPads& pads() const noexcept { return pads_; }
  /// The box as a node has it.
  [[nodiscard]] LinearBounds widened(const LinearBounds& box) const noexcept {
    const double pad = pads_.pad(std::max(largest_coordinate(box.at0), largest_coordinate(box.at1)));
    return pad > 0.0 ? LinearBounds{BoxPads::widened(box.at0, pad), BoxPads::widened(box.at1, pad)} : box;
  }

  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = 0;
    std::vector<NodeReference> stack{from_.root()};
    while (!stack.empty()) {
      const NodeReference reference = stack.back();
      stack.pop_back();
      sum += size_of(reference);
      if (bvh::is_leaf(reference)) continue;
      Bounds3f boxes[4];
      NodeReference children[4];
      const unsigned count = read(reference, boxes, children);
      stack.insert(stack.end(), children, children + count);
    }
    return sum;
  }

  /// Writes the subtree from `next` on (a node, its leaves, then its inner children), and moves `next` behind it.
  NodeReference write(std::byte* base, NodeReference reference, std::size_t& next, LinearBounds& bounds) const {
    const std::size_t offset = next;
    next += size_of(reference);
    if (bvh::is_leaf(reference)) {
      const std::byte* leaf = from_.base() + bvh::offset_of(reference);
      const unsigned blocks = bvh::block_count(reference);
      std::memcpy(base + offset, leaf, blocks * sizeof(Block));
      for (unsigned b = 0; b < blocks; ++b) {
        for (const std::uint32_t id : reinterpret_cast<const Block*>(leaf)[b].id) bounds.extend(bounds_[id]);
      }
      return NodeReference(offset) | (reference & (bvh::kLeafBit | bvh::kBlockMask));
    }
    Bounds3f boxes[4];
    NodeReference children[4], written[4] = {};
    LinearBounds child[4];
    const unsigned count = read(reference, boxes, children);
    for (const bool leaves : {true, false}) {
      for (unsigned i = 0; i < count; ++i)
        if (bvh::is_leaf(children[i]) == leaves) written[i] = write(base, children[i], next, child[i]);
    }
    Node& node = *new (base + offset) Node;
    std::memset(base + offset + kNodePadding, 0, sizeof(Node) - kNodePadding);
    for (unsigned i = 0; i < 4; ++i) {
      const LinearBounds box = widened(child[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float lower = box.at0.lower[axis], upper = box.at0.upper[axis];
        node.planes[2 * axis][i] = lower, node.planes[2 * axis + 1][i] = upper;
        node.motion[2 * axis][i] = i < count ? rounded_down(double(box.at1.lower[axis]) - lower) : 0.0f;
        node.motion[2 * axis + 1][i] = i < count ? rounded_up(double(box.at1.upper[axis]) - upper) : 0.0f;
      }
      node.child[i] = written[i];
      if (i < count) bounds.extend(child[i]);
    }
    return NodeReference(offset);
  }

 private:
  static std::size_t size_of(NodeReference reference) noexcept {
    return bvh::is_leaf(reference) ? round_up(bvh::block_count(reference) * sizeof(Block)) : sizeof(Node);
  }
  unsigned read(NodeReference reference, Bounds3f* boxes, NodeReference* children) const {
    return bvh::SoaNodes<4>::read(*reinterpret_cast<const bvh::Node<4>*>(from_.base() + bvh::offset_of(reference)),
                                  boxes, children);
  }

  const bvh::Bvh4& from_;
  MeteredVector<LinearBounds> bounds_;  // of each triangle
  BoxPads pads_;
};

}  // namespace

LinearBounds linear_bounds(const TriangleMesh& mesh, std::uint32_t triangle) noexcept {
  const Triangle t = mesh.triangles[triangle];
  const std::size_t frames = mesh.frames();
  LinearBounds result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto lowest = [&](std::size_t k, double sign) {
      const std::vector<Vec3f>& f = mesh.frame(k);
      return std::min({sign * f[t.a][axis], sign * f[t.b][axis], sign * f[t.c][axis]});
    };
    for (const double sign : {1.0, -1.0}) {  // -1: the upper plane, mirrored
      const double first = lowest(0, sign), last = lowest(frames - 1, sign);
      double below = 0.0, size = 0.0;
      for (std::size_t k = 0; k < frames; ++k) {
        const double time = frames > 1 ? double(k) / double(frames - 1) : 0.0, line = first + (last - first) * time;
        below = std::max(below, line - lowest(k, sign));
        size = std::max({size, std::fabs(lowest(k, 1.0)), std::fabs(lowest(k, -1.0))});
      }
      const double pad = frames > 1 ? below + double(2 * frames + 8) * 0x1p-24 * size : 0.0;
      const float at0 = rounded_down(first - pad), at1 = rounded_down(last - pad);
      if (sign > 0.0) {
        result.at0.lower[axis] = at0, result.at1.lower[axis] = at1;
      } else {
        result.at0.upper[axis] = -at0, result.at1.upper[axis] = -at1;
      }
    }
  }
  return result;
}

const StructureInfo& Bvh4Motion::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "4-wide BVH of a moving scene: boxes and triangles interpolated at the ray's time (BVH4MB)";
    i.builders = binary_builder_names();
    i.leaves = {Block::kName};
    i.holds_motion = i.needs_motion = true;
    return i;
  }();
  return info;
}

void Bvh4Motion::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  if (settings.leaf != Block::kName)
    throw UserError("bvh4_motion has no leaf '" + settings.leaf + "'; it has triangle4i");
  mesh_ = &mesh;
  bvh::Bvh4 still;
  TriangleMesh half_time;
  if (mesh.moves()) half_time = pose(mesh, 0.5f);
  still.build(mesh.moves() ? half_time : mesh, settings, report);

  const double start = wall_seconds();
  const Converter converter(mesh, still);
  const std::size_t bytes = converter.bytes();
  if (bytes > std::numeric_limits<NodeReference>::max())
    throw UserError("bvh4_motion would take " + std::to_string(bytes >> 20) +
                    " MiB; its 32-bit references reach 4 GiB: use a smaller mesh");
  arena_ = Arena();
  arena_ = Arena(bytes);
  leaf_ = settings.leaf;
  LinearBounds bounds;
  std::size_t next = 0;
  root_ = converter.write(arena_.data(), still.root(), next, bounds);
  stack_entries_ = still.stack_entries();
  set_scene(mesh, at_half_time(converter.widened(bounds)), converter.pads().common());
  report.phases.emplace_back("moving_boxes", wall_seconds() - start);
}

void Bvh4Motion::archive(Archive& archive) {
  archive.expect(sizeof(Node));
  archive(leaf_, arena_, root_, stack_entries_, max_coordinate_, bounds_);
  mesh_ = &archive.mesh();
  vertices_ = mesh_->vertices.data(), triangles_ = mesh_->size();
}

bool Bvh4Motion::visit(StructureVisitor& visitor) const {
  struct Entry {
    NodeReference reference;
    Bounds3f bounds;
    unsigned depth;
  };
  std::vector<Entry> stack{{root_, bounds_, 0}};
  std::vector<std::uint32_t> primitives;
  while (!stack.empty()) {
    const Entry e = stack.back();
    stack.pop_back();
    const std::byte* at = base() + bvh::offset_of(e.reference);
    if (bvh::is_leaf(e.reference)) {
      const unsigned blocks = bvh::block_count(e.reference);
      primitives.clear();
      append_primitives(reinterpret_cast<const Block*>(at), blocks, primitives);
      visitor.leaf({e.bounds, primitives, e.depth, blocks, unsigned(Block::kWidth), round_up(blocks * sizeof(Block))});
      continue;
    }
    const auto& node = *reinterpret_cast<const Node*>(at);
    Bounds3f boxes[4];
    unsigned count = 0;
    for (; count < 4 && node.planes[0][count] <= node.planes[1][count]; ++count) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        boxes[count].lower[axis] = node.planes[2 * axis][count] + 0.5f * node.motion[2 * axis][count];
        boxes[count].upper[axis] = node.planes[2 * axis + 1][count] + 0.5f * node.motion[2 * axis + 1][count];
      }
    }
    visitor.node({e.bounds, {boxes, count}, e.depth, sizeof(Node)});
    for (unsigned i = count; i-- > 0;) stack.push_back({node.child[i], boxes[i], e.depth + 1});
  }
  return true;
}

}  // namespace arboretum::bvh4_motion
