#include "traversal/kernel_table.h"

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

#include "core/missing_isa.h"
#include "core/error.h"
#include "intersectors/blocks.h"
#include "structures/leaves/leaf_form.h"
#include "structures/registry.h"

namespace arboretum {
namespace {

using Key = std::tuple<std::string_view, std::string_view, std::string_view, std::string_view, std::string_view, Isa>;

[[nodiscard]] Key key_of(const KernelRow& r) { return {r.structure, r.leaf, r.intersector, r.box, r.traversal, r.isa}; }

const std::map<Key, const KernelRow*>& index() {
  static const std::map<Key, const KernelRow*> map = [] {
    std::map<Key, const KernelRow*> m;
    for (const KernelRow& row : kernel_table()) m.emplace(key_of(row), &row);
    return m;
  }();
  return map;
}

/// What a row must have; an empty key, or no instruction set, is any.
struct RowFilter {
  std::string_view structure = {}, leaf = {}, intersector = {}, box = {}, traversal = {};
  std::optional<Isa> isa = {};
};
[[nodiscard]] bool any_row(const RowFilter& wanted) {
  const auto agrees = [](std::string_view key, std::string_view value) { return key.empty() || key == value; };
  return std::ranges::any_of(kernel_table(), [&](const KernelRow& r) {
    return agrees(wanted.structure, r.structure) && agrees(wanted.leaf, r.leaf) &&
           agrees(wanted.intersector, r.intersector) && agrees(wanted.box, r.box) &&
           agrees(wanted.traversal, r.traversal) && (!wanted.isa || *wanted.isa == r.isa);
  });
}

/// The values that `key` has in the rows that are `wanted`: " single, packet8".
template <class Wanted>
[[nodiscard]] std::string values_of(std::string_view KernelRow::*key, const Wanted& wanted) {
  std::vector<std::string_view> seen;
  std::string words;
  for (const KernelRow& r : kernel_table()) {
    if (!wanted(r) || std::ranges::find(seen, r.*key) != seen.end()) continue;
    words.append(seen.empty() ? " " : ", ").append(r.*key);
    seen.push_back(r.*key);
  }
  return words;
}

/// Whether kernels of an instruction set with registers of W lanes, 1 for scalar, take blocks of `width` triangles.
template <int W>
[[nodiscard]] bool takes_blocks(unsigned width) {
  bool takes = false;
  for_each_type(BlocksOfWidth<EdgeBlock, W>{},
                [&]<class Block>(std::type_identity<Block>) { takes = takes || unsigned(Block::kWidth) == width; });
  return takes;
}

[[nodiscard]] bool takes_blocks(Isa isa, unsigned width) {
  switch (isa) {
    case Isa::scalar: return takes_blocks<1>(width);
    case Isa::sse: return takes_blocks<4>(width);
    case Isa::avx2: return takes_blocks<8>(width);
    case Isa::avx512: return takes_blocks<16>(width);
  }
  return false;
}

/// The instruction sets, this machine's or not, whose kernels read the leaf: " avx2, avx512".
[[nodiscard]] std::string isas_of_leaf(unsigned width) {
  std::string words;
  for (Isa isa : kAllIsas)
    if (takes_blocks(isa, width)) words.append(words.empty() ? " " : ", ").append(to_string(isa));
  return words;
}

/// Of a leaf for which the structure has no row of that way of traversal on that instruction set.
[[nodiscard]] std::string why_no_leaf(std::string_view structure, std::string_view leaf, std::string_view traversal,
                                      Isa isa) {
  const std::string s(structure), l(leaf), t(traversal);
  const StructureEntry* entry = find_structure(structure);
  const LeafForm* form = find_leaf_form(leaf);
  const bool taken = entry && std::ranges::find(entry->info.leaves, leaf) != entry->info.leaves.end();
  if (taken && form && !takes_blocks(isa, form->width))
    return s + " has " + l + " with" + isas_of_leaf(form->width) + " only";
  const std::string leaves = values_of(&KernelRow::leaf, [&](const KernelRow& r) {
    return r.structure == structure && r.traversal == traversal && r.isa == isa;
  });
  return s + " has no leaf " + l + (taken ? " for " + t + ": that has" : ": it has") + leaves;
}

/// Of a way of traversal that the structure has no row of.
[[nodiscard]] std::string why_no_traversal(std::string_view structure, std::string_view traversal) {
  if (const StructureEntry* entry = find_structure(structure)) {
    if (!entry->info.only_single_rays.empty()) return std::string(entry->info.only_single_rays);
    // Others are Embree's
    const bool ours = traversal == "stream" || traversal == "stream_sorted" || traversal == "stream_lists";
    if (ours && !entry->info.no_streams.empty()) return std::string(entry->info.no_streams);
    if (traversal.starts_with("queued") && !entry->info.no_queue.empty()) return std::string(entry->info.no_queue);
    if (entry->info.library.empty() && !traversal.ends_with("coherent")) return "not built";
  }
  const std::string owners =
      values_of(&KernelRow::structure, [&](const KernelRow& r) { return r.traversal == traversal; });
  return owners.empty() ? "no structure of this build has it on this machine" : "that is for" + owners;
}

}  // namespace

Counters& Counters::operator+=(const Counters& o) {
  rays += o.rays, nodes += o.nodes, boxes += o.boxes, boxes_hit += o.boxes_hit, leaves += o.leaves, blocks += o.blocks;
  triangles += o.triangles, lanes += o.lanes, lanes_active += o.lanes_active;
  nodes_shared += o.nodes_shared, leaves_shared += o.leaves_shared, interval_tests += o.interval_tests;
  for (std::size_t i = 0; i < children_hit.size(); ++i) children_hit[i] += o.children_hit[i];
  depths.resize(std::max(depths.size(), o.depths.size()));
  for (std::size_t i = 0; i < o.depths.size(); ++i) depths[i] += o.depths[i];
  packets += o.packets, rays_in_packets += o.rays_in_packets, rays_in_streams += o.rays_in_streams;
  rays_in_flight += o.rays_in_flight, switches += o.switches, rays_alone += o.rays_alone;
  queue_rounds += o.queue_rounds, nodes_queued += o.nodes_queued, leaves_queued += o.leaves_queued;
  return *this;
}

Counters::Depth& Counters::Depth::operator+=(const Depth& o) noexcept {
  visits += o.visits, lanes += o.lanes, lanes_active += o.lanes_active;
  return *this;
}

std::span<const KernelRow> kernel_table() {
  static const std::vector<KernelRow> rows = registered_kernels();
  return rows;
}

const KernelRow* find_kernel(std::string_view structure, std::string_view leaf, std::string_view intersector,
                             std::string_view box, std::string_view traversal, Isa isa) {
  const auto it = index().find(Key{structure, leaf, intersector, box, traversal, isa});
  return it == index().end() ? nullptr : it->second;
}

std::string_view default_leaf(std::string_view structure, std::string_view intersector, Isa isa) {
  // Eight triangles a block trace 5 to 7 % faster than four where a register holds eight (docs/performance.md); edges
  // where the intersector takes them, else vertices, else the form that was made for it.
  const bool wide = native_width(isa) >= 8;
  // One that the machine lacks has no rows; leaves are alike.
  const std::optional<Isa> of = cpu_supports(isa) ? std::optional(isa) : std::nullopt;
  for (std::string_view leaf :
       {wide ? "triangle8" : "triangle4", wide ? "triangle8v" : "triangle4v", "triangle4", "triangle4v",
        wide ? "triangle8w" : "triangle4w", wide ? "triangle8h" : "triangle4h", wide ? "triangle8p" : "triangle4p"}) {
    if (any_row({.structure = structure, .leaf = leaf, .intersector = intersector, .isa = of})) return leaf;
  }
  for (const KernelRow& r : kernel_table()) {
    if (r.structure == structure && r.intersector == intersector && (!of || r.isa == isa)) return r.leaf;
  }
  return {};
}

std::string why_no_kernel(std::string_view structure, std::string_view leaf, std::string_view intersector,
                          std::string_view box, std::string_view traversal, Isa isa) {
  if (find_kernel(structure, leaf, intersector, box, traversal, isa)) return {};
  if (!cpu_supports(isa)) return missing_isa_reason(isa);
  const std::string s(structure), l(leaf), i(intersector), b(box), t(traversal), a(to_string(isa));
  if (!any_row({.structure = structure})) return "no kernels for " + s;
  if (!any_row({.structure = structure, .isa = isa})) return s + " has no " + a + " kernels";
  if (!any_row({.structure = structure, .traversal = traversal}))
    return s + " has no " + t + " traversal: " + why_no_traversal(structure, traversal);
  if (!any_row({.structure = structure, .traversal = traversal, .isa = isa}))
    return s + " has no " + t + " traversal on " + a;
  if (!any_row({.structure = structure, .intersector = intersector, .traversal = traversal, .isa = isa}))
    return s + " has no " + i + " kernels for " + t + ": it has" +
           values_of(&KernelRow::intersector, [&](const KernelRow& r) {
             return r.structure == structure && r.traversal == traversal && r.isa == isa;
           });
  if (!any_row({.structure = structure, .leaf = leaf, .traversal = traversal, .isa = isa}))
    return why_no_leaf(structure, leaf, traversal, isa);
  if (!any_row(
          {.structure = structure, .leaf = leaf, .intersector = intersector, .traversal = traversal, .isa = isa})) {
    std::string others;
    for (const KernelRow& r : kernel_table()) {
      std::string other = " ";
      other.append(r.leaf).append(",");
      if (r.structure == structure && r.intersector == intersector && r.traversal == traversal && r.isa == isa &&
          others.find(other) == std::string::npos) {
        others += other;
      }
    }
    others.pop_back();
    return i + " cannot read leaf " + l + " in " + s + ": use" + others;
  }
  // A box test that only some ways of traversal, or some structures, have.
  const bool elsewhere = !any_row({.structure = structure, .box = box, .traversal = traversal});
  if (const std::string ways = values_of(&KernelRow::traversal,
                                         [&](const KernelRow& r) { return r.box == box && r.structure == structure; });
      elsewhere && !ways.empty())
    return s + " has the box test " + b + " for" + ways + " alone, not for " + t;
  if (const std::string others = values_of(&KernelRow::structure, [&](const KernelRow& r) { return r.box == box; });
      elsewhere && !others.empty())
    return s + " has no box test " + b + ":" + others + " have it";
  return s + " with " + l + " and " + i + " has no box test " + b + " for " + t;
}

const AxisValues& axis_values() {
  static const AxisValues values = [] {
    AxisValues v;
    const auto add = [](std::vector<std::string_view>& list, std::string_view value) {
      if (std::ranges::find(list, value) == list.end()) list.push_back(value);
    };
    for (const KernelRow& r : kernel_table()) {
      add(v.structures, r.structure), add(v.leaves, r.leaf), add(v.intersectors, r.intersector);
      add(v.boxes, r.box), add(v.traversals, r.traversal);
    }
    return v;
  }();
  return values;
}

}  // namespace arboretum
