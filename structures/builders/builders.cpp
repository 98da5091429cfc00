#include "structures/builders/builders.h"

#include <array>

#include "core/error.h"
#include "core/names.h"
#include "structures/builders/builder_parameters.h"
#include "structures/builders/embree_builders.h"
#include "structures/builders/fast_builders.h"
#include "structures/builders/reinsertion.h"
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
  BinaryBuilder (*on)(Isa);
  std::array<std::string_view, 4> reads = {};  ///< of BuilderParameters; reinsertion's apart
  unsigned reinserted_top = 0;                 ///< where reinsertion_top leaves it to the builder
};

/// Nodes that top-down builders reinsert: hardly more is gained by all (docs/performance.md).
constexpr unsigned kTop = 512, kMostTop = 65536;

constexpr Entry kBuilders[] = {
    {"binned_sah",
     on_each<isa_scalar::kBinnedSah, isa_sse::kBinnedSah, isa_avx2::kBinnedSah, isa_avx512::kBinnedSah>,
     {"bins"},
     kTop},
    {"sweep_sah", on_any<build_sweep_sah>, {}, kTop},
    {"spatial_sah",
     on_each<isa_scalar::kSpatialSah, isa_sse::kSpatialSah, isa_avx2::kSpatialSah, isa_avx512::kSpatialSah>,
     {"bins", "duplication_budget", "spatial_overlap", "spatial_gain"},
     kTop},
    {"morton", on_any<build_morton>, {"morton_bits"}},
    {"ploc", on_any<build_ploc>, {"morton_bits", "ploc_radius"}},
#ifdef ARBORETUM_HAVE_EMBREE
    {"embree_low", on_any<build_embree_low>, {"traversal_cost", "intersection_cost"}},
    {"embree_medium", on_any<build_embree_medium>, {"traversal_cost", "intersection_cost"}},
    {"embree_high", on_any<build_embree_high>, {"traversal_cost", "intersection_cost", "duplication_budget"}},
#endif
};

/// Every builder has a second key, this behind its own: its tree improved by reinsertion.
constexpr std::string_view kReinsertion = "_reinsertion";

}  // namespace

void require_budget(std::string_view builder, std::size_t triangles, float budget) {
  if (!(budget >= 0.0f && budget <= 4.0f))
    throw UserError("duplication_budget: " + std::to_string(budget) + " is not within 0 .. 4");
  if (double(triangles) * (1.0 + double(budget)) > double(kMaxReferences)) {
    throw UserError(std::string(builder) + ": " + std::to_string(triangles) +
                    " triangles and a duplication_budget of " + std::to_string(budget) +
                    " make more than 2^30 - 1 references; take a smaller duplication_budget or a smaller mesh");
  }
}

std::vector<std::string_view> binary_builder_parameters(std::string_view builder) {
  const bool reinserts = builder.ends_with(kReinsertion);
  if (reinserts) builder.remove_suffix(kReinsertion.size());
  for (const Entry& e : kBuilders) {
    if (e.name != builder) continue;
    std::vector<std::string_view> names{reinserts ? "reinsertion_rounds" : "reinsertion_top"};
    for (std::string_view name : e.reads)
      if (!name.empty()) names.push_back(name);
    return names;
  }
  return {};
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
                       BuildReport& report) {
  std::string_view builder = settings.builder;
  const bool reinserts = builder.ends_with(kReinsertion);
  if (reinserts) builder.remove_suffix(kReinsertion.size());
  const unsigned rounds = settings.parameters.reinsertion_rounds;
  if (reinserts && (rounds < 1 || rounds > 64))
    throw UserError("reinsertion_rounds: " + std::to_string(rounds) + " is not within 1 .. 64");
  const unsigned top = settings.parameters.reinsertion_top;
  if (top != BuilderParameters::kOwn && top > kMostTop)
    throw UserError("reinsertion_top: " + std::to_string(top) + " is not within 0 .. " + std::to_string(kMostTop));
  for (const Entry& e : kBuilders) {
    if (e.name != builder) continue;
    const bool splits = builder == "spatial_sah" || builder == "embree_high";
    require_budget(builder, mesh.size(), splits ? settings.parameters.duplication_budget : 0.0f);
    e.on(settings.isa)(mesh, settings.parameters, leaf_width, tree, report);
    if (reinserts) {
      reinsert(tree, rounds, leaf_width, report);
    } else {
      reinsert_top(tree, top == BuilderParameters::kOwn ? e.reinserted_top : top, report);
    }
    return;
  }
  const std::vector<std::string> names(binary_builder_names().begin(), binary_builder_names().end());
  throw UserError(unknown_name_message("builder", settings.builder, names));
}

}  // namespace arboretum
