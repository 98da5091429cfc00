#include "traversal/counting.h"

#include <algorithm>

namespace arboretum {

void WithCounters::met(unsigned hit) const noexcept {
  ++counters.nodes, counters.boxes_hit += hit;
  ++counters.children_hit[std::min<std::size_t>(hit, counters.children_hit.size() - 1)];
}

void WithCounters::box_tests(unsigned lanes, unsigned active) const noexcept {
  counters.boxes += active, counters.lanes_active += active, counters.lanes += lanes;
}

void WithCounters::at_depth(Depth depth, unsigned lanes, unsigned active) const {
  if (counters.depths.size() <= depth.value) counters.depths.resize(depth.value + 1);
  counters.depths[depth.value] += {1, lanes, active};
}

void WithCounters::Depths::push(std::ptrdiff_t begin, std::ptrdiff_t end) {
  const auto first = static_cast<std::size_t>(begin), last = static_cast<std::size_t>(end);
  if (waiting_.size() < last) waiting_.resize(last);
  for (std::size_t i = first; i < last; ++i) waiting_[i] = current_ + 1;
}

void WithCounters::blocks(const LeafForm& form, const std::byte* at, unsigned count) const noexcept {
  counters.blocks += count;
  counters.lanes += std::uint64_t(count) * form.width;
  for (unsigned i = 0; i < count; ++i) {
    const unsigned triangles = form.triangles(at + i * form.bytes);
    counters.triangles += triangles, counters.lanes_active += triangles;
  }
}

}  // namespace arboretum
