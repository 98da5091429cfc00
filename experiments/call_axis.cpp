#include "experiments/call_axis.h"

#include <fmt/format.h>

#include "experiments/rendered_rays.h"
#include "traversal/kernel_keys.h"

namespace arboretum {
std::size_t rays_a_call(const Cell& cell) {
  if (cell.call == "packet") return packet_width(cell.traversal);
  return cell.call == "ray" ? 1 : 0;
}

std::string why_no_call(const Cell& cell) {
  if (cell.call == kCalls.front()) return {};
  if (is_rendered(cell.workload)) return fmt::format("the renderer of {} calls with batches alone", cell.workload);
  if (cell.call == "packet" && packet_width(cell.traversal) == 0)
    return fmt::format("{} names no width: call packet is for packet4 to packet64 and hybrid4 to hybrid16",
                       cell.traversal);
  if (cell.call == "ray" && (cell.traversal.starts_with("queued") || cell.traversal.starts_with("stream")))
    return fmt::format("{} needs rays beside each other: call ray is for single rays, packets, hybrids and auto",
                       cell.traversal);
  return {};
}

}  // namespace arboretum
