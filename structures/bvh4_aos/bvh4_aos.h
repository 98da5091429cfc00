// bvh4_aos: a 4-wide BVH with its child boxes as array of structures, the node of Embree's kernels for Intel's MIC
// architecture (Benthin, Wald, Woop, Ernst, Mark 2012, "Combining Single and Packet-Ray Tracing for Arbitrary Ray
// Distributions on the Intel MIC Architecture", section 4.1; Woop, Benthin, Wald 2013).
#pragma once

#include "structures/bvh/bvh.h"

namespace arboretum::bvh4_aos {

/// Two cache lines: four minima, four maxima, each x y z w. A minimum's w is the child's reference; a maximum's is 0,
/// so that a test of whole lines reads a number there. A slot without a child has minimum = +inf, maximum = -inf;
/// children come first.
struct alignas(64) Node {
  struct Corner {
    float x, y, z;
    std::uint32_t w;
  };
  Corner lower[4];
  Corner upper[4];
};
static_assert(sizeof(Node) == 128);

struct AosNodes {
  static constexpr int kBranching = 4;
  static constexpr std::string_view kName = "bvh4_aos";
  static constexpr std::string_view kSummary =
      "4-wide bounding volume hierarchy, child boxes as array of structures (Xeon Phi's node: 16 lanes as 4 boxes)";
  static constexpr std::size_t kGranule = 64;
  using Node = bvh4_aos::Node;

  static void write(Node& node, const Bounds3f* boxes, const bvh::NodeReference* references, unsigned count) noexcept {
    for (unsigned i = 0; i < 4; ++i) {
      const Bounds3f b = i < count ? boxes[i] : Bounds3f{};
      node.lower[i] = {b.lower.x, b.lower.y, b.lower.z, i < count ? references[i] : 0};
      node.upper[i] = {b.upper.x, b.upper.y, b.upper.z, 0};
    }
  }
  static unsigned read(const Node& node, Bounds3f* boxes, bvh::NodeReference* references) noexcept {
    unsigned i = 0;
    for (; i < 4 && node.lower[i].x <= node.upper[i].x; ++i) {
      boxes[i] = {{node.lower[i].x, node.lower[i].y, node.lower[i].z},
                  {node.upper[i].x, node.upper[i].y, node.upper[i].z}};
      references[i] = node.lower[i].w;
    }
    return i;
  }
};

using Bvh4Aos = bvh::WideBvh<AosNodes>;
using Structures = TypeList<Bvh4Aos>;

}  // namespace arboretum::bvh4_aos
