#include "structures/octree/octree_builder.h"

#include <algorithm>
#include <bit>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "structures/builders/one_task.h"
#include "structures/builders/phase_clock.h"
#include "structures/leaves/triangle_overlap.h"

namespace arboretum::octree {
namespace {

using Index3 = std::array<std::uint32_t, 3>;
using Ids = MeteredVector<std::uint32_t>;

/// A subtree in depth-first order: for an inner node the mask of its children, for a leaf kLeaf + its number
/// of references.
struct Subtree {
  static constexpr std::uint64_t kLeaf = 256;
  MeteredVector<std::uint64_t> shape;
  Ids ids;
  double cost = 0.0;
};

class Grower {
 public:
  Grower(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, unsigned depth,
         const Cube& cube, float max_coordinate)
      : mesh_(mesh), parameters_(parameters), width_(leaf_width), depth_(depth), cube_(cube),
        slack_(0x1p-40 * max_coordinate + 0x1p-120) {}

  /// Appends the subtree of a cell with these triangles; it may hold `budget` references. Cost is that of a
  /// ray which meets the cell.
  void grow(Ids& ids, unsigned level, const Index3& at, double budget, Subtree& out) const {
    const double leaf_cost = parameters_.intersection_cost * double((ids.size() + width_ - 1) / width_);
    if (ids.size() <= width_ || level >= depth_) return leaf(ids, leaf_cost, out);
    Ids children[8];
    split(ids, level, at, children);
    double references = 0;
    std::uint64_t mask = 0;
    for (unsigned c = 0; c < 8; ++c)
      references += double(children[c].size()), mask |= std::uint64_t(!children[c].empty()) << c;
    if (references > budget) return leaf(ids, leaf_cost, out);

    const std::size_t shapes = out.shape.size(), first_id = out.ids.size();
    out.shape.push_back(mask);
    double below = 0;  // a child's faces have a quarter of the cell's area
    const auto child = [&](unsigned c, Subtree& into) {
      const double share = budget * double(children[c].size()) / references;
      grow(children[c], level + 1, {2 * at[0] + (c & 1), 2 * at[1] + (c >> 1 & 1), 2 * at[2] + (c >> 2)}, share, into);
      Ids().swap(children[c]);
    };
    if (ids.size() > kOneTask) {
      Subtree parts[8];
      tbb::parallel_for(0u, 8u, [&](unsigned c) {
        if (mask >> c & 1) child(c, parts[c]);
      });
      for (unsigned c = 0; c < 8; ++c) {
        out.shape.insert(out.shape.end(), parts[c].shape.begin(), parts[c].shape.end());
        out.ids.insert(out.ids.end(), parts[c].ids.begin(), parts[c].ids.end());
        below += 0.25 * parts[c].cost;
      }
    } else {
      for (unsigned c = 0; c < 8; ++c) {
        if (mask >> c & 1) child(c, out), below += 0.25 * out.cost;
      }
    }
    out.cost = parameters_.traversal_cost + below;
    if (out.cost >= leaf_cost) {
      out.shape.resize(shapes), out.ids.resize(first_id);
      leaf(ids, leaf_cost, out);
    }
  }

 private:
  static void leaf(const Ids& ids, double cost, Subtree& out) {
    out.shape.push_back(Subtree::kLeaf + ids.size());
    out.ids.insert(out.ids.end(), ids.begin(), ids.end());
    out.cost = cost;
  }

  void split(const Ids& ids, unsigned level, const Index3& at, Ids (&children)[8]) const {
    double face[3][3], center[3][2], half[3][2];
    for (std::size_t a = 0; a < 3; ++a) {
      for (unsigned i = 0; i < 3; ++i) face[a][i] = cube_.face(a, level + 1, 2 * at[a] + i);
      for (unsigned i = 0; i < 2; ++i)
        center[a][i] = 0.5 * (face[a][i] + face[a][i + 1]), half[a][i] = 0.5 * (face[a][i + 1] - face[a][i]) + slack_;
    }
    for (std::uint32_t id : ids) {
      const auto corners = mesh_.corners(id);
      unsigned sides[3];  // bit 0: touches the lower half, bit 1: the upper
      for (std::size_t a = 0; a < 3; ++a) {
        const float low = std::min({corners[0][a], corners[1][a], corners[2][a]}),
                    high = std::max({corners[0][a], corners[1][a], corners[2][a]});
        sides[a] = unsigned(low <= face[a][1] + slack_) | unsigned(high >= face[a][1] - slack_) << 1;
      }
      const unsigned count = unsigned(std::popcount(sides[0]) * std::popcount(sides[1]) * std::popcount(sides[2]));
      const auto is_candidate = [&](unsigned c) {
        return (sides[0] >> (c & 1) & sides[1] >> (c >> 1 & 1) & sides[2] >> (c >> 2) & 1) != 0;
      };
      if (count == 1) {
        for (unsigned c = 0; c < 8; ++c)
          if (is_candidate(c)) children[c].push_back(id);
        continue;
      }
      const TriangleOverlap triangle(corners);
      bool any = false;
      for (unsigned c = 0; c < 8; ++c) {
        const unsigned x = c & 1, y = c >> 1 & 1, z = c >> 2;
        if (is_candidate(c) &&
            triangle.touches({center[0][x], center[1][y], center[2][z]}, {half[0][x], half[1][y], half[2][z]})) {
          children[c].push_back(id), any = true;
        }
      }
      // A triangle that only just touches the cell: the halves' slack is the cell's, so this does not happen;
      // and if it did, nothing is lost.
      for (unsigned c = 0; c < 8 && !any; ++c)
        if (is_candidate(c)) children[c].push_back(id);
    }
  }

  const TriangleMesh& mesh_;
  const BuilderParameters& parameters_;
  unsigned width_, depth_;
  Cube cube_;
  double slack_;
};

/// From depth-first order to siblings next to each other.
class Layout {
 public:
  Layout(const Subtree& from, Tree& tree) : from_(from), tree_(tree) {
    tree.nodes.resize(from.shape.size());
    place(0);
    tree.lists.begin.push_back(std::uint32_t(from.ids.size()));
  }

 private:
  void place(std::uint32_t slot) {
    const std::uint64_t shape = from_.shape[at_++];
    if (shape >= Subtree::kLeaf) {
      tree_.nodes[slot] = {std::uint32_t(tree_.lists.begin.size()), 0};
      tree_.lists.begin.push_back(std::uint32_t(id_)), id_ += shape - Subtree::kLeaf;
      return;
    }
    const std::uint32_t first = next_;
    next_ += std::uint32_t(std::popcount(shape));
    tree_.nodes[slot] = {first, std::uint32_t(shape)};
    for (std::uint32_t k = first, end = next_; k < end; ++k) place(k);
  }

  const Subtree& from_;
  Tree& tree_;
  std::size_t at_ = 0, id_ = 0;
  std::uint32_t next_ = 1;
};

}  // namespace

void build_tree(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, Tree& tree,
                BuildReport& report) {
  PhaseClock phase(report);
  const Bounds3f bounds = mesh.bounds();
  const float largest = largest_coordinate(bounds);
  float half = 0x1p-101f;
  for (std::size_t a = 0; a < 3; ++a) {
    tree.cube.lower[a] = bounds.lower[a];
    half = std::max(half, 0.5f * bounds.upper[a] - 0.5f * bounds.lower[a]);
    while (bounds.lower[a] + 2.0f * half < bounds.upper[a])
      half = std::nextafter(half, std::numeric_limits<float>::infinity());
  }
  tree.cube.half = half, tree.max_coordinate = largest;
  // Cells of less than 16 ulps of the largest coordinate would have faces that fall together.
  unsigned depth = parameters.max_depth == 0 ? kMostLevels : parameters.max_depth;
  while (depth > 0 && tree.cube.child_size(depth - 1) < 0x1p-19f * largest) --depth;

  Ids ids(mesh.size());
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = std::uint32_t(i);
  Subtree whole;
  const Grower grower(mesh, parameters, leaf_width, depth, tree.cube, largest);
  grower.grow(ids, 0, {0, 0, 0}, double(kMostReferences) * double(mesh.size()), whole);
  if (whole.ids.size() > 0xfffffff0u || whole.shape.size() > 0xfffffff0u) {
    throw UserError("octree: " + std::to_string(whole.ids.size()) +
                    " references pass 2^32: use a smaller max_depth or wider leaf blocks");
  }
  phase.ends("tree");
  Layout(whole, tree);
  tree.lists.ids = std::move(whole.ids);
  phase.ends("layout");
}

}  // namespace arboretum::octree
