// Making rows of the kernel table: every leaf and intersector that this instruction set has tests for, with both box tests.
#pragma once

#include "core/type_list.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Adds the rows of one way of traversal. `Functions` makes a row's functions:
///   template <class Leaves, bool Padded> static RowFunctions timed();   template <bool Padded> static RowFunctions counting();
/// `Compiled...` are the CompiledLeaves (traversal/leaves.h) that get functions of their own; all others share those of CalledLeaves.
template <class Structure, class Functions, class... Compiled>
void add_rows(KernelRows& rows, std::string_view traversal, TypeList<Compiled...>) {
  const StructureInfo& info = Structure::static_info();
  const auto add = [&]<bool Padded>(const LeafTests& tests, Value<Padded>) {
    RowFunctions timed = Functions::template timed<CalledLeaves, Padded>();
    [[maybe_unused]] const auto compiled = [&]<class Leaves>(std::type_identity<Leaves>) {
      if (Leaves::Block::kName == tests.leaf && Leaves::Intersector::kName == tests.intersector) timed = Functions::template timed<Leaves, Padded>();
    };
    (compiled(std::type_identity<Compiled>{}), ...);
    rows.push_back({info.name, tests.leaf, tests.intersector, Padded ? "padded" : "fast", traversal, kIsa, &tests, timed,
                    Functions::template counting<Padded>()});
  };
  for (const LeafTests& tests : leaf_tests()) {
    if (tests.isa != kIsa || std::find(info.leaves.begin(), info.leaves.end(), tests.leaf) == info.leaves.end()) continue;
    add(tests, Value<false>{}), add(tests, Value<true>{});
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
