// What structures show visitors, which sizes, depths, SAH cost and end-point overlap are computed from: of every
// structure and builder, held to what must be so of any tree.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "structures/accel.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Counts what is wrong with what it is shown. Child boxes of `quantised` nodes are up to two steps of a node's grid
/// larger than what is in them, and a step is at most 2 / 1023 of the node.
class Checker final : public StructureVisitor {
 public:
  Checker(const TriangleMesh& mesh, bool quantised)
      : mesh_(mesh), beyond_(quantised ? 4.0 / 1023 : 0.0), seen_(mesh.size()) {
    const Bounds3f box = mesh.bounds();
    for (std::size_t a = 0; a < 3; ++a)
      pad_ = std::max({pad_, 0x1p-14 * std::fabs(double(box.lower[a])), 0x1p-14 * std::fabs(double(box.upper[a]))});
  }

  void node(const NodeView& node) override {
    take(node.bounds, node.depth);
    no_bytes_ += node.bytes == 0;
    no_children_ += node.child_bounds.empty() && mesh_.size() > 0;
    for (const Bounds3f& child : node.child_bounds) {
      ++waiting_[key(child, node.depth + 1)];
      outside_ += !within(child, node.bounds);
    }
    bytes_ += node.bytes;
  }
  void leaf(const LeafView& leaf) override {
    take(leaf.bounds, leaf.depth);
    too_full_ += leaf.primitives.size() > std::size_t(leaf.blocks) * leaf.block_width;
    for (std::uint32_t primitive : leaf.primitives) {
      apart_ += !meet(leaf.bounds, mesh_.bounds(primitive));
      seen_[primitive] = true;
    }
    bytes_ += leaf.bytes;
  }

  void check(std::size_t bytes) const {
    CHECK(orphans_ == 0);
    std::size_t lost = 0;
    for (const auto& [box, count] : waiting_) lost += count;
    CHECK(lost == 0);
    CHECK(outside_ == 0);
    CHECK(no_children_ == 0);
    CHECK(too_full_ == 0);
    CHECK(no_bytes_ == 0);
    CHECK(apart_ == 0);
    CHECK(std::ranges::count(seen_, false) == 0);
    CHECK(bytes_ <= bytes);
    CHECK(2 * bytes_ + 4096 >= bytes);
  }

 private:
  using Key = std::tuple<float, float, float, float, float, float, unsigned>;
  static Key key(const Bounds3f& b, unsigned depth) {
    return {b.lower.x, b.lower.y, b.lower.z, b.upper.x, b.upper.y, b.upper.z, depth};
  }
  /// But for what quantised planes, and the faces of grids within cells, are rounded by.
  [[nodiscard]] bool within(const Bounds3f& part, const Bounds3f& all) const {
    for (std::size_t a = 0; a < 3; ++a) {
      const double more = beyond_ * (double(all.upper[a]) - all.lower[a]) + pad_ / 256;
      if (part.lower[a] < all.lower[a] - more || part.upper[a] > all.upper[a] + more) return false;
    }
    return true;
  }
  /// But for what cells are widened by when they are filled.
  [[nodiscard]] bool meet(const Bounds3f& a, const Bounds3f& b) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (a.upper[k] < b.lower[k] - pad_ || b.upper[k] < a.lower[k] - pad_) return false;
    return true;
  }
  /// The root, or what a parent that was shown before has as a child.
  void take(const Bounds3f& bounds, unsigned depth) {
    if (depth == 0) {
      orphans_ += std::exchange(has_root_, true);
      return;
    }
    const auto found = waiting_.find(key(bounds, depth));
    if (found == waiting_.end() || found->second == 0) {
      ++orphans_;
    } else {
      --found->second;
    }
  }

  const TriangleMesh& mesh_;
  const double beyond_;
  double pad_ = 0;
  std::vector<bool> seen_;
  std::map<Key, std::size_t> waiting_;  ///< children that are still to be shown
  bool has_root_ = false;
  std::size_t orphans_ = 0, outside_ = 0, no_children_ = 0, too_full_ = 0, no_bytes_ = 0, apart_ = 0, bytes_ = 0;
};

}  // namespace

TEST_CASE("every structure shows a tree: children where their parents say, leaves with what they hold, its bytes") {
  std::size_t shown = 0;
  for (const KernelScene& scene : kernel_scenes()) {
    for (const StructureEntry& entry : all_structures()) {
      if (entry.info.takes_below) continue;  // without instances, what is below it
      for (std::string_view builder : entry.info.builders) {
        INFO(entry.info.name << ", " << builder << ": " << scene.name);
        BuildSettings settings;
        settings.builder = builder, settings.leaf = entry.info.leaves.front(), settings.isa = best_isa();
        BuildReport report;
        const auto accel = build_structure(entry.info.name, scene.mesh, settings, report);
        Checker checker(scene.mesh, entry.info.name.find("quantised") != std::string_view::npos);
        if (!accel->visit(checker)) continue;
        checker.check(accel->bytes());
        ++shown;
      }
    }
  }
  CHECK(shown > 100);
}
