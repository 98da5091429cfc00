// What an executable has: its structures and their kernels. Both functions stand in a generated registry.cpp
// (cmake/ArboretumStructures.cmake): that of the library arboretum_registry, or one of an executable's own which names more
// structures. The linker takes the executable's, and then never looks for the library's.
#pragma once

#include <memory>
#include <type_traits>
#include <vector>

#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum {

struct KernelRow;

[[nodiscard]] std::vector<StructureEntry> registered_structures();
[[nodiscard]] std::vector<KernelRow> registered_kernels();

/// An entry for each type of the list, in order.
template <class... Types>
[[nodiscard]] std::vector<StructureEntry> structure_entries(TypeList<Types...>) {
  std::vector<StructureEntry> list;
  (list.push_back({Types::static_info(), []() -> std::unique_ptr<Accel> { return std::make_unique<Types>(); }}), ...);
  return list;
}

}  // namespace arboretum
