// Registry: what can be swept: structures, kernels and instruction sets. Tests hand in small ones of their
// own.
#pragma once

#include <functional>
#include <memory>
#include <optional>
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
  /// Names of what a structure's builder reads of BuilderParameters (structures/parameters_read.h); nullopt: it does
  /// not say. Left empty: none says.
  std::function<std::optional<std::vector<std::string_view>>(std::string_view structure, std::string_view builder,
                                                             std::string_view below)>
      parameters_read;
  /// One line on a builder of the structure; empty where there is none. Left empty: there is none on any.
  std::function<std::string(std::string_view structure, std::string_view builder)> builder_summary;

  /// nullptr where there is none.
  [[nodiscard]] const StructureEntry* structure(std::string_view name) const;
  [[nodiscard]] const KernelRow* kernel(std::string_view structure, std::string_view leaf, std::string_view intersector,
                                        std::string_view box, std::string_view traversal, Isa isa) const;
  [[nodiscard]] bool has(Isa isa) const;
  /// Whether a structure that is there reads the builder parameter; one that does not say does.
  [[nodiscard]] bool reads(std::string_view parameter, std::string_view structure, std::string_view builder,
                           std::string_view below) const;
  /// Who reads the builder parameter: "ploc (bvh2, bvh4); kdtree, octree", the latter with any builder. Of a list of
  /// more than `most` names the first, and how many more there are; then builders are named as by folded_builders().
  [[nodiscard]] std::string readers_of(std::string_view parameter, std::size_t most = kAll) const;
  static constexpr std::size_t kAll = ~std::size_t{0};
};

/// Builders as a person reads them, at most `most` by name: "ploc, morton, also as …_reinsertion; in_order": what is
/// there with reinsertion behind it, too, is named once.
[[nodiscard]] std::string folded_builders(std::span<const std::string_view> names, std::string_view separator,
                                          std::size_t most = Registry::kAll);

/// What this build and this machine have.
[[nodiscard]] Registry this_registry();

}  // namespace arboretum
