// What an executable has: its structures, what their builders read, and their kernels. The functions stand in a
// generated registry.cpp (cmake/ArboretumStructures.cmake): that of the library arboretum_registry, or one of an
// executable's own which names more structures. The linker takes the executable's, and then never looks for the
// library's.
#pragma once

#include <memory>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum {

struct KernelRow;

[[nodiscard]] std::vector<StructureEntry> registered_structures();
[[nodiscard]] std::vector<KernelRow> registered_kernels();
/// The members of BuilderParameters that a structure's builder reads, by name.
using BuilderParametersOf = std::vector<std::string_view> (*)(std::string_view builder);
/// One for each of registered_structures(), in their order; nullptr where the structure does not say
/// (parameters_read.h).
[[nodiscard]] std::vector<BuilderParametersOf> registered_parameters();

/// An entry for each type of the list, in order.
template <class... Types>
[[nodiscard]] std::vector<StructureEntry> structure_entries(TypeList<Types...>) {
  std::vector<StructureEntry> list;
  (list.push_back({Types::static_info(), []() -> std::unique_ptr<Accel> { return std::make_unique<Types>(); }}), ...);
  return list;
}

template <class Structure>
[[nodiscard]] BuilderParametersOf parameters_entry() {
  if constexpr (requires(std::string_view builder) { builder_parameters(std::type_identity<Structure>{}, builder); }) {
    return [](std::string_view builder) -> std::vector<std::string_view> {
      return builder_parameters(std::type_identity<Structure>{}, builder);
    };
  } else {
    return nullptr;
  }
}

template <class... Types>
[[nodiscard]] std::vector<BuilderParametersOf> parameters_entries(TypeList<Types...>) {
  return {parameters_entry<Types>()...};
}

}  // namespace arboretum
