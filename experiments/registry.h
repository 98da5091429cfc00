// Registry: what can be swept: structures, kernels and instruction sets. Tests hand in small ones of their
// own.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/isa.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum {

struct Registry {
  std::span<const StructureEntry> structures;
  std::span<const KernelRow> kernels;
  std::vector<Isa> isas;  ///< those that can be used here
  std::function<std::string_view(std::string_view structure, std::string_view intersector, Isa)> default_leaf;
  std::function<std::string(std::string_view structure, std::string_view leaf, std::string_view intersector,
                            std::string_view box, std::string_view traversal, Isa)>
      why_no_kernel;
  std::function<std::unique_ptr<Accel>(std::string_view structure, const TriangleMesh&, const BuildSettings&,
                                       BuildReport&)>
      build;

  /// nullptr where there is none.
  [[nodiscard]] const StructureEntry* structure(std::string_view name) const;
  [[nodiscard]] const KernelRow* kernel(std::string_view structure, std::string_view leaf,
                                        std::string_view intersector, std::string_view box,
                                        std::string_view traversal, Isa isa) const;
  [[nodiscard]] bool has(Isa isa) const;
};

/// What this build and this machine have.
[[nodiscard]] Registry this_registry();

}  // namespace arboretum
