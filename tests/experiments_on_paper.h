// What tests of plans and results share: structures and kernels that exist on paper alone.
#pragma once

#include <string>
#include <vector>

#include "experiments/config.h"
#include "experiments/plan.h"
#include "tests/error_of.h"
#include "tests/folder.h"

namespace arboretum::test {

// Two structures and a handful of kernels that exist on paper alone: what a plan needs.
inline const StructureEntry kStructures[] = {
    {{.name = "tree", .summary = "a tree", .builders = {"binned_sah", "morton"}, .leaves = {"triangle4", "triangle8"}},
     nullptr},
    {{.name = "list", .summary = "a list", .builders = {"none"}, .leaves = {"triangle4"}, .uses_parameters = false},
     nullptr},
};

inline std::vector<KernelRow> paper_kernels() {
  std::vector<KernelRow> rows;
  for (Isa isa : kAllIsas) {
    for (std::string_view intersector : {"moller_trumbore", "watertight"})
      for (std::string_view box : {"fast", "padded"})
        for (std::string_view leaf : {"triangle4", "triangle8"})
          for (std::string_view traversal : {"single", "packet4", "packet8", "packet16"})
            rows.push_back({.structure = "tree",
                            .leaf = leaf,
                            .intersector = intersector,
                            .box = box,
                            .traversal = traversal,
                            .isa = isa});
    rows.push_back({.structure = "list",
                    .leaf = "triangle4",
                    .intersector = "moller_trumbore",
                    .box = "fast",
                    .traversal = "single",
                    .isa = isa});
  }
  return rows;
}

inline Registry paper_registry(std::vector<Isa> isas = {Isa::scalar, Isa::sse, Isa::avx2}) {
  static const std::vector<KernelRow> rows = paper_kernels();
  Registry registry;
  registry.structures = kStructures;
  registry.kernels = rows;
  registry.isas = std::move(isas);
  registry.default_leaf = [](std::string_view structure, std::string_view, Isa isa) -> std::string_view {
    return structure == "tree" && isa >= Isa::avx2 ? "triangle8" : "triangle4";
  };
  registry.why_no_kernel = [](std::string_view structure, auto, std::string_view intersector, auto, auto, Isa) {
    return std::string(structure) + " has no " + std::string(intersector);
  };
  return registry;
}

/// Of the configuration that the text is.
inline Plan planned(const Folder& folder, const Registry& registry, const std::string& yaml) {
  return make_plan(read_experiment(folder.write("plan.yaml", yaml), registry), registry);
}

inline std::vector<std::string> names(const Plan& plan, Cell::Metric metric) {
  std::vector<std::string> list;
  for (const Cell& cell : plan.cells)
    if (cell.metric == metric) list.push_back(cell.name());
  return list;
}

/// A sweep of one cell.
inline constexpr const char* kSmall = R"(
scenes: [{generate: sphere, triangles: 500}]
axes: {structure: [tree], isa: [sse], intersector: [moller_trumbore]}
)";

}  // namespace arboretum::test
