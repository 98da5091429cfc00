// Making rows of the kernel table: every leaf and intersector that this instruction set has tests for, with both box
// tests.
#pragma once

#include "core/type_list.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Calls visit(LeafTests) for every leaf of the structure and every intersector that reads it.
template <class Structure, class Visit>
void for_each_test(const Visit& visit) {
  const std::vector<std::string_view>& leaves = Structure::static_info().leaves;
  for (const LeafTests& tests : leaf_tests())
    if (tests.isa == kIsa && std::find(leaves.begin(), leaves.end(), tests.leaf) != leaves.end()) visit(tests);
}

/// Adds the rows of one way of traversal. `Functions` makes a row's functions:
///   template <class Leaves, bool Padded> static RowFunctions timed();
///   template <bool Padded> static RowFunctions counting();
/// `Compiled...` are the CompiledLeaves (traversal/leaves.h) that get functions of their own; all others share those of
/// CalledLeaves.
template <class Structure, class Functions, class... Compiled>
void add_rows(KernelRows& rows, std::string_view traversal, TypeList<Compiled...>) {
  const StructureInfo& info = Structure::static_info();
  const auto add = [&]<bool Padded>(const LeafTests& tests, Value<Padded>) {
    RowFunctions timed = Functions::template timed<CalledLeaves, Padded>();
    bool compiled_in = false;
    [[maybe_unused]] const auto compiled = [&]<class Leaves>(std::type_identity<Leaves>) {
      if (Leaves::Block::kName == tests.leaf && Leaves::Intersector::kName == tests.intersector)
        timed = Functions::template timed<Leaves, Padded>(), compiled_in = true;
    };
    (compiled(std::type_identity<Compiled>{}), ...);
    rows.push_back({info.name, tests.leaf, tests.intersector, Padded ? "padded" : "fast", traversal, kIsa, &tests,
                    timed, Functions::template counting<Padded>(), compiled_in});
  };
  for_each_test<Structure>([&](const LeafTests& tests) { add(tests, Value<false>{}), add(tests, Value<true>{}); });
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
