#include "experiments/registry.h"

#include <algorithm>

namespace arboretum {

const StructureEntry* Registry::structure(std::string_view name) const {
  const auto found =
      std::ranges::find_if(structures, [&](const StructureEntry& e) { return e.info.name == name; });
  return found == structures.end() ? nullptr : &*found;
}

const KernelRow* Registry::kernel(std::string_view structure, std::string_view leaf,
                                  std::string_view intersector, std::string_view box,
                                  std::string_view traversal, Isa isa) const {
  const auto found = std::ranges::find_if(kernels, [&](const KernelRow& row) {
    return row.structure == structure && row.leaf == leaf && row.intersector == intersector &&
           row.box == box && row.traversal == traversal && row.isa == isa;
  });
  return found == kernels.end() ? nullptr : &*found;
}

bool Registry::has(Isa isa) const {
  return std::ranges::find(isas, isa) != isas.end();
}

Registry this_registry() {
  Registry registry;
  registry.structures = all_structures();
  registry.kernels = kernel_table();
  registry.isas.assign(available_isas().begin(), available_isas().end());
  registry.default_leaf = default_leaf;
  registry.why_no_kernel = why_no_kernel;
  registry.build = build_structure;
  return registry;
}

}  // namespace arboretum
