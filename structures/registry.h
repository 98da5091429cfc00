// What an executable has: its structures, what they say of their builders, and their kernels. The functions stand in a
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
#include "structures/parameter_limits.h"

namespace arboretum {

struct KernelRow;

[[nodiscard]] std::vector<StructureEntry> registered_structures();
[[nodiscard]] std::vector<KernelRow> registered_kernels();
/// What a structure says of its builders (parameters_read.h); a function is nullptr where it does not.
struct StructureBuilders {
  std::vector<std::string_view> (*reads)(std::string_view builder) = nullptr;
  std::string_view (*summary)(std::string_view builder) = nullptr;
  std::vector<OwnParameter> own{};
  /// Of a structure of that kind: sets the parameter that is so many in `own`.
  void (*set)(Accel& accel, std::size_t parameter, const ParameterValue& value) = nullptr;
};
/// One for each of registered_structures(), in their order.
[[nodiscard]] std::vector<StructureBuilders> registered_builders();

/// An entry for each type of the list, in order.
template <class... Types>
[[nodiscard]] std::vector<StructureEntry> structure_entries(TypeList<Types...>) {
  std::vector<StructureEntry> list;
  (list.push_back({Types::static_info(), []() -> std::unique_ptr<Accel> { return std::make_unique<Types>(); }}), ...);
  return list;
}

/// Not inlined, like the next: where GCC sees that a set has no word, it warns of what would read one.
template <class Set>
[[nodiscard, gnu::noinline]] ParameterValue value_of(const Set& set, const Parameter<Set>& parameter) {
  return std::visit([&](auto member) -> ParameterValue { return set.*member; }, parameter.member);
}
/// The value is of the parameter's type.
template <class Set>
[[gnu::noinline]] void set_value(Set& set, const Parameter<Set>& parameter, const ParameterValue& value) {
  std::visit([&]<class T>(T Set::*member) { set.*member = std::get<T>(value); }, parameter.member);
}

/// The class has a member `parameters`.
template <class Structure>
concept HasParameters = requires {
  sizeof(Structure::parameters);
};
/// Its <name>_parameters.h says what they are.
template <class Structure>
concept SaysParameters = requires {
  own_parameters(std::type_identity<Structure>{});
};

template <class Structure>
[[nodiscard]] StructureBuilders builders_entry() {
  using Type = std::type_identity<Structure>;
  static_assert(!HasParameters<Structure> || SaysParameters<Structure>,
                "The class has a member `parameters`, but no own_parameters() says what they are: declare it in "
                "<name>_parameters.h beside <name>.h (docs/add-a-structure.md).");
  StructureBuilders entry;
  if constexpr (requires(std::string_view builder) { builder_parameters(Type{}, builder); }) {
    entry.reads = [](std::string_view builder) -> std::vector<std::string_view> {
      return builder_parameters(Type{}, builder);
    };
  }
  if constexpr (requires(std::string_view builder) { builder_summary(Type{}, builder); })
    entry.summary = [](std::string_view builder) -> std::string_view { return builder_summary(Type{}, builder); };
  if constexpr (SaysParameters<Structure>) {
    using Set = decltype(Structure::parameters);
    for (const Parameter<Set>& p : own_parameters(Type{}))
      entry.own.push_back({p.name, p.summary, value_of(Set{}, p), p.limits, p.choices, p.words});
    entry.set = [](Accel& accel, std::size_t parameter, const ParameterValue& value) {
      set_value(static_cast<Structure&>(accel).parameters, own_parameters(Type{})[parameter], value);
    };
  }
  return entry;
}

template <class... Types>
[[nodiscard]] std::vector<StructureBuilders> builders_entries(TypeList<Types...>) {
  return {builders_entry<Types>()...};
}

}  // namespace arboretum
