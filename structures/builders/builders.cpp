#include "structures/builders/builders.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "core/error.h"
#include "core/names.h"
#include "structures/builders/builder_parameters.h"
#include "structures/builders/collapse.h"
#include "structures/builders/embree_builders.h"
#include "structures/builders/portable_builders.h"
#include "structures/builders/reinsertion.h"
#include "structures/builders/reinsertion_name.h"
#include "structures/builders/top_reinsertion.h"

namespace arboretum {

namespace isa_scalar {
extern const BinaryBuilder kBinnedSah, kSpatialSah;
}
namespace isa_sse {
extern const BinaryBuilder kBinnedSah, kSpatialSah;
}
namespace isa_avx2 {
extern const BinaryBuilder kBinnedSah, kSpatialSah;
}
namespace isa_avx512 {
extern const BinaryBuilder kBinnedSah, kSpatialSah;
}

namespace {

/// A builder that is compiled for each instruction set.
template <const BinaryBuilder& Scalar, const BinaryBuilder& Sse, const BinaryBuilder& Avx2, const BinaryBuilder& Avx512>
BinaryBuilder on_each(Isa isa) {
  switch (isa) {
    case Isa::scalar: return Scalar;
    case Isa::sse: return Sse;
    case Isa::avx2: return Avx2;
    case Isa::avx512: return Avx512;
  }
  return nullptr;
}

/// A builder that is written once for all instruction sets.
template <BinaryBuilder Build>
BinaryBuilder on_any(Isa) {
  return Build;
}

struct Entry {
  std::string_view name;
  std::string_view summary;
  BinaryBuilder (*on)(Isa);
  std::array<std::string_view, 4> reads = {};  ///< of BuilderParameters; reinsertion's apart
  unsigned reinserted_top = 0;                 ///< where reinsertion_top leaves it to the builder
  /// The builder where it may fill leaf blocks as well.
  void (*in_blocks)(const TriangleMesh&, const BuilderParameters&, unsigned, LeafBlocks&, BinaryTree&,
                    BuildReport&) = nullptr;
};

/// Nodes that top-down builders reinsert: hardly more is gained by all (docs/performance.md).
constexpr unsigned kTop = 512;

constexpr Entry kBuilders[] = {
    {"binned_sah",
     "top-down, surface area heuristic over bins of centroids, then collapsed to the structure's width",
     on_each<isa_scalar::kBinnedSah, isa_sse::kBinnedSah, isa_avx2::kBinnedSah, isa_avx512::kBinnedSah>,
     {"bins"},
     kTop},
    {"sweep_sah", "top-down, surface area heuristic at every candidate plane", on_any<build_sweep_sah>, {}, kTop},
    {"spatial_sah",
     "binned SAH with spatial splits (references may be duplicated)",
     on_each<isa_scalar::kSpatialSah, isa_sse::kSpatialSah, isa_avx2::kSpatialSah, isa_avx512::kSpatialSah>,
     {"bins", "duplication_budget", "spatial_overlap", "spatial_gain"},
     kTop},
    {"morton",
     "sorted along a Morton curve (linear BVH)",
     on_any<build_morton>,
     {"morton_bits"},
     0,
     build_morton_in_blocks},
    {"ploc", "bottom-up, parallel locally-ordered clustering", on_any<build_ploc>, {"morton_bits", "ploc_radius"}},
#ifdef ARBORETUM_HAVE_EMBREE
    {"embree_low",
     "Embree's Morton builder, for our BVHs",
     on_any<build_embree_low>,
     {"traversal_cost", "intersection_cost"}},
    {"embree_medium",
     "Embree's binned SAH builder, for our BVHs",
     on_any<build_embree_medium>,
     {"traversal_cost", "intersection_cost"}},
    {"embree_high",
     "Embree's builder with spatial splits, for our BVHs",
     on_any<build_embree_high>,
     {"traversal_cost", "intersection_cost", "duplication_budget"}},
#endif
};

struct Found {
  const Entry* entry = nullptr;  ///< null: no builder has the key
  bool reinserts = false;
  [[nodiscard]] bool reads(std::string_view parameter) const {
    return std::ranges::find(entry->reads, parameter) != entry->reads.end();
  }
};

Found find_builder(std::string_view key) {
  Found found;
  found.reinserts = key.ends_with(kReinsertion);
  if (found.reinserts) key.remove_suffix(kReinsertion.size());
  const Entry* const entry = std::ranges::find(kBuilders, key, &Entry::name);
  if (entry != std::end(kBuilders)) found.entry = entry;
  return found;
}

}  // namespace

void require_budget(std::string_view builder, std::size_t triangles, float budget) {
  if (double(triangles) * (1.0 + double(budget)) > double(kMaxReferences)) {
    throw UserError(std::string(builder) + ": " + std::to_string(triangles) +
                    " triangles and a duplication_budget of " + std::to_string(budget) +
                    " make more than 2^30 - 1 references; take a smaller duplication_budget or a smaller mesh");
  }
}

std::vector<std::string_view> binary_builder_parameters(std::string_view builder) {
  const Found found = find_builder(builder);
  if (!found.entry) return {};
  std::vector<std::string_view> names{"reinsertion_top"};
  if (found.reinserts)
    names.insert(names.end(), {"reinsertion_rounds", "traversal_cost", "intersection_cost", "max_leaf_blocks"});
  for (std::string_view name : found.entry->reads)
    if (!name.empty()) names.push_back(name);
  return names;
}

std::string binary_builder_summary(std::string_view builder) {
  const Found found = find_builder(builder);
  if (!found.entry) return {};
  return std::string(found.entry->summary) +
         (found.reinserts ? "; then subtrees reinserted where they cost least" : "");
}

const std::vector<std::string_view>& binary_builder_names() {
  static const std::vector<std::string> reinserted = [] {
    std::vector<std::string> list;
    for (const Entry& e : kBuilders) list.push_back(std::string(e.name) + std::string(kReinsertion));
    return list;
  }();
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const Entry& e : kBuilders) list.push_back(e.name);
    list.insert(list.end(), reinserted.begin(), reinserted.end());
    return list;
  }();
  return names;
}

void build_binary_tree(const TriangleMesh& mesh, const BuildSettings& settings, unsigned leaf_width, BinaryTree& tree,
                       BuildReport& report, const TreeUse& use) {
  const BuilderParameters& p = settings.parameters;
  const Found found = find_builder(settings.builder);
  if (!found.entry) {
    const std::vector<std::string> names(binary_builder_names().begin(), binary_builder_names().end());
    throw UserError(unknown_name_message("builder", settings.builder, names));
  }
  check_parameters(p);
  const bool own_top = p.reinsertion_top == BuilderParameters::kOwn;
  const unsigned top = own_top ? found.entry->reinserted_top : p.reinsertion_top;
  const bool splits = found.reads("duplication_budget");
  require_budget(found.entry->name, mesh.size(), splits ? p.duplication_budget : 0.0f);
  if (mesh.size() == 0) {
    tree = {};
    return;
  }

  if (use.blocks && found.entry->in_blocks && top == 0 && !found.reinserts)
    return found.entry->in_blocks(mesh, p, leaf_width, *use.blocks, tree, report);
  found.entry->on(settings.isa)(mesh, p, leaf_width, tree, report);
  reinsert_top(tree, top, report);
  if (!found.reinserts) return;
  // A wide node stands for log2(branching) levels of binary ones.
  const ReinsertionCosts costs{p.traversal_cost / std::log2(float(use.branching)), kLeafVisit * p.intersection_cost,
                               p.intersection_cost, leaf_width,
                               std::min(leaf_width * p.max_leaf_blocks, kMaxMergedReferences)};
  const auto as_it_is = [&](const BinaryTree& t) {
    return sah_cost(t, {use.branching, leaf_width, p.max_leaf_blocks, p.traversal_cost, p.intersection_cost});
  };
  reinsert(tree, p.reinsertion_rounds, costs, use.cost ? use.cost : as_it_is, report);
}

}  // namespace arboretum
