#include "traversal/counting.h"

namespace arboretum {

void WithCounters::node(unsigned boxes, unsigned lanes, unsigned hit) const noexcept {
  ++counters.nodes;
  counters.boxes += boxes, counters.lanes_active += boxes;
  counters.boxes_hit += hit, counters.lanes += lanes;
}

void WithCounters::leaf(const LeafForm& form, const std::byte* blocks, unsigned count) const noexcept {
  ++counters.leaves;
  counters.blocks += count;
  counters.lanes += std::uint64_t(count) * form.width;
  for (unsigned i = 0; i < count; ++i) {
    const unsigned triangles = form.triangles(blocks + i * form.bytes);
    counters.triangles += triangles, counters.lanes_active += triangles;
  }
}

}  // namespace arboretum
