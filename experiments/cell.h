// Cell: one combination of the sweep, and the name that results are known by.
#pragma once

#include <string>
#include <vector>

#include "core/isa.h"
#include "rendering/self_intersection.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum {

struct Cell {
  enum class Metric { trace, build } metric = Metric::trace;
  std::size_t scene_index = 0;  ///< of the experiment's scenes
  std::string scene, structure, builder, leaf, intersector, box, traversal, workload;
  Isa isa = Isa::scalar;
  unsigned threads = 1;
  BuilderParameters parameters;
  std::string parameter_label;  ///< what of `parameters` is swept: ":bins=16"; part of the name
  TraversalSettings settings;
  std::string call = "batch";  ///< how many rays the kernel gets a call (experiments/call_axis.h)
  /// what of `settings` is swept, and a call other than `batch`: ":hybrid_threshold=2:call=ray"; part of the name
  std::string setting_label;
  SurfaceStart start;                 ///< of workloads whose rays start on surfaces
  std::string start_label;            ///< where it is swept: ":self_intersection=none"; part of the name
  const KernelRow* kernel = nullptr;  ///< of a trace cell

  /// `metric/scene/structure/builder/leaf/intersector/box/traversal/isa/workload/threads:N`; `-` where an
  /// axis does not apply; what is swept follows what it is of: `binned_sah:bins=16`, `hybrid8:hybrid_threshold=2`,
  /// `single:call=ray`, `diffuse:self_intersection=none`.
  [[nodiscard]] std::string name() const;
  [[nodiscard]] std::string builder_name() const { return builder + parameter_label; }
  [[nodiscard]] std::string traversal_name() const { return traversal + setting_label; }
  [[nodiscard]] std::string workload_name() const { return workload + start_label; }
};

/// Ratios on a shared machine are of thread CPU time, as long as each cell of a run that traces has one thread; else
/// rays a second of all of them are by wall time, which alone compares threads. Builds are by wall time.
[[nodiscard]] inline bool allows_cpu_time(const Cell& cell) noexcept {
  return cell.metric == Cell::Metric::build || cell.threads == 1;
}
[[nodiscard]] inline const char* rate_unit(bool cpu) noexcept { return cpu ? "Mray/s CPU" : "Mray/s wall"; }

struct SkippedCell {
  std::string name, reason;
};

[[nodiscard]] inline std::string_view to_string(Cell::Metric metric) noexcept {
  return metric == Cell::Metric::trace ? "trace" : "build";
}

}  // namespace arboretum
