#include "structures/statistics.h"

#include <algorithm>

#include "structures/end_point_overlap.h"
#include "structures/leaf_count_variability.h"

namespace arboretum {
namespace {

constexpr std::size_t kMostFill = 32;  ///< fuller leaves share the histogram's last place

/// Writes down what the structure shows, in its order: parents before children.
class Recorder final : public StructureVisitor {
 public:
  explicit Recorder(const BuilderParameters& costs) : costs_(costs) {}

  void node(const NodeView& node) override {
    const double visits = node.steps > 0 ? node.steps : 1.0;
    add(node.bounds, node.depth, costs_.traversal_cost * visits, false);
    ++statistics.nodes;
    statistics.node_bytes += node.bytes;
    children_ += node.child_bounds.size();
    const double looked_at = node.steps > 0 ? node.steps : static_cast<double>(node.child_bounds.size());
    child_cost_ += share(node.bounds) * costs_.traversal_cost * looked_at;
  }

  void leaf(const LeafView& leaf) override {
    const double cost = double(costs_.intersection_cost) * leaf.blocks;
    add(leaf.bounds, leaf.depth, cost, true);
    references.insert(references.end(), leaf.primitives.begin(), leaf.primitives.end());
    ++statistics.leaves;
    statistics.leaf_bytes += leaf.bytes;
    statistics.blocks += leaf.blocks;
    lanes_ += std::size_t(leaf.blocks) * leaf.block_width;
    child_cost_ += share(leaf.bounds) * cost;
    statistics.depth = std::max(statistics.depth, leaf.depth);
    if (statistics.depth_histogram.size() <= leaf.depth) statistics.depth_histogram.resize(leaf.depth + 1);
    ++statistics.depth_histogram[leaf.depth];
    const std::size_t fill = std::min(leaf.primitives.size(), kMostFill);
    if (statistics.leaf_histogram.size() <= fill) statistics.leaf_histogram.resize(fill + 1);
    ++statistics.leaf_histogram[fill];
  }

  void finish(std::size_t triangles) {
    close(0);
    statistics.references = references.size();
    statistics.sah_cost = cost_;
    statistics.sah_child_cost = child_cost_;
    if (lanes_ > 0) statistics.leaf_fill = static_cast<double>(references.size()) / static_cast<double>(lanes_);
    if (triangles > 0) statistics.duplication = static_cast<double>(references.size()) / static_cast<double>(triangles);
    if (statistics.nodes > 0) {
      statistics.children_per_node = static_cast<double>(children_) / static_cast<double>(statistics.nodes);
    }
  }

  StructureStatistics statistics;
  std::vector<TreeRecord> records;
  std::vector<std::uint32_t> references;

 private:
  /// Chance that a ray through the root meets the box.
  [[nodiscard]] double share(const Bounds3f& bounds) const {
    const double root = records.front().bounds.area();
    return root > 0.0 ? bounds.area() / root : 1.0;
  }

  void add(const Bounds3f& bounds, unsigned depth, double cost, bool is_leaf) {
    close(depth);
    open_.push_back({static_cast<std::uint32_t>(records.size()), depth});
    records.push_back({bounds, cost, 0, static_cast<std::uint32_t>(references.size()), 0, is_leaf});
    cost_ += share(bounds) * cost;
  }

  /// Ends the subtrees that a record of this depth is no part of.
  void close(unsigned depth) {
    while (!open_.empty() && open_.back().depth >= depth) {
      TreeRecord& record = records[open_.back().index];
      record.end = static_cast<std::uint32_t>(records.size());
      record.end_reference = static_cast<std::uint32_t>(references.size());
      open_.pop_back();
    }
  }

  struct Open {
    std::uint32_t index;
    unsigned depth;
  };
  BuilderParameters costs_;
  std::vector<Open> open_;
  std::size_t children_ = 0, lanes_ = 0;
  double cost_ = 0.0, child_cost_ = 0.0;
};

}  // namespace

StructureStatistics compute_statistics(const Accel& accel, const TriangleMesh& mesh, const BuilderParameters& costs,
                                       bool slow_ones) {
  Recorder recorder(costs);
  StructureStatistics none;
  none.bytes = accel.bytes();
  if (!accel.visit(recorder)) return none;
  recorder.finish(mesh.size());
  StructureStatistics& statistics = recorder.statistics;
  statistics.available = true;
  statistics.bytes = accel.bytes();
  if (slow_ones) {
    const EndPointOverlap overlap = end_point_overlap(mesh, recorder.records, recorder.references);
    statistics.epo = overlap.value;
    statistics.epo_sampled = overlap.sampled;
    const LeafCounts counts = leaf_counts(recorder.records);
    statistics.lcv = counts.deviation, statistics.leaves_per_line = counts.mean, statistics.lcv_lines = counts.lines;
  }
  return statistics;
}

}  // namespace arboretum
