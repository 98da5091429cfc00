#include "structures/builders/builders.h"

#include "core/error.h"
#include "core/names.h"
#include "structures/builders/fast_builders.h"

namespace arboretum {

namespace isa_scalar { extern const BinaryBuilder kBinnedSah; }
namespace isa_sse { extern const BinaryBuilder kBinnedSah; }
namespace isa_avx2 { extern const BinaryBuilder kBinnedSah; }
namespace isa_avx512 { extern const BinaryBuilder kBinnedSah; }

namespace {

BinaryBuilder binned_sah(Isa isa) {
  switch (isa) {
    case Isa::scalar: return isa_scalar::kBinnedSah;
    case Isa::sse: return isa_sse::kBinnedSah;
    case Isa::avx2: return isa_avx2::kBinnedSah;
    case Isa::avx512: return isa_avx512::kBinnedSah;
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
};

constexpr Entry kBuilders[] = {
    {"binned_sah", binned_sah},
    {"morton", on_any<build_morton>},
};

}  // namespace

const std::vector<std::string_view>& binary_builder_names() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const Entry& e : kBuilders) list.push_back(e.name);
    return list;
  }();
  return names;
}

void build_binary_tree(const TriangleMesh& mesh, const BuildSettings& settings, unsigned leaf_width, BinaryTree& tree,
                       BuildReport& report) {
  for (const Entry& e : kBuilders) {
    if (e.name == settings.builder) return e.on(settings.isa)(mesh, settings.parameters, leaf_width, tree, report);
  }
  const std::vector<std::string> names(binary_builder_names().begin(), binary_builder_names().end());
  throw UserError(unknown_name_message("builder", settings.builder, names));
}

}  // namespace arboretum
