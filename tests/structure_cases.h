// What the structure-level cases B01 to B30 share: every structure x every builder that it takes, with the default leaf
// on the best ISA that runs here, and the comparison of its answers with brute_force's and with exact arithmetic.
//
// Embree is left out: it promises none of this (ties, padded boxes), and Debian's build aborts by assertion on some of
// it.
#pragma once

#include <iostream>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "intersectors/promises.h"
#include "oracle/oracle.h"
#include "structures/accel.h"
#include "structures/statistics.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "tests/small_meshes.h"

namespace arboretum::test {

/// A structure with one of its builders, and the rows of the kernel table that trace it.
struct Combination {
  const StructureEntry* entry = nullptr;
  std::string builder, leaf;
  std::vector<const KernelRow*> rows;

  [[nodiscard]] std::string name() const { return std::string(entry->info.name) + "/" + builder + "/" + leaf; }
  [[nodiscard]] bool is(std::string_view structure) const { return entry->info.name == structure; }
  [[nodiscard]] std::unique_ptr<Accel> build(const TriangleMesh& mesh, BuildReport* out = nullptr) const {
    BuildSettings settings;
    settings.builder = builder, settings.leaf = leaf, settings.isa = tested_isa(), settings.threads = 2;
    BuildReport report;
    auto accel = build_structure(entry->info.name, mesh, settings, report);
    if (out) *out = report;
    return accel;
  }
};

/// Single rays with four intersectors; with `modes` the other ways of traversal, too, with `watertight`. A tree is at
/// stake here, not an intersector: those are called by all structures through the same pointers.
[[nodiscard]] inline std::vector<const KernelRow*> rows_of(std::string_view structure, std::string_view leaf,
                                                           bool modes) {
  std::vector<const KernelRow*> rows;
  for (const KernelRow& row : kernel_table()) {
    if (row.structure != structure || row.leaf != leaf || row.isa != tested_isa()) continue;
    const bool single = row.traversal == "single", crack_free = row.intersector == "watertight";
    const bool common = crack_free || row.intersector == "moller_trumbore" || row.intersector == "pluecker" ||
                        row.intersector == "exact";
    if (single ? common : modes && crack_free) rows.push_back(&row);
  }
  return rows;
}

/// A structure of the table without a builder or a row would be left out silently: the first group counts them.
[[nodiscard]] inline const std::vector<Combination>& combinations() {
  static const std::vector<Combination> all = [] {
    std::vector<Combination> list;
    for (const StructureEntry& entry : all_structures()) {
      if (entry.info.name == "embree") continue;
      const std::string leaf(default_leaf(entry.info.name, "watertight", tested_isa()));
      for (std::string_view builder : entry.info.builders)
        // What stands above others hands the builder on: one stands for all, with the default structure below.
        if (!entry.info.takes_below || builder == entry.info.builders.front())
          list.push_back({&entry, std::string(builder), leaf,
                          rows_of(entry.info.name, leaf, builder == entry.info.builders.front())});
    }
    return list;
  }();
  return all;
}

/// References, depth and the like, and that every triangle with an area is in a leaf.
inline StructureStatistics statistics_of(const Accel& accel, const TriangleMesh& mesh) {
  struct Seen final : StructureVisitor {
    explicit Seen(std::size_t triangles) : in_leaf(triangles, false) {}
    void node(const NodeView& node) override {
      for (const Bounds3f& box : node.child_bounds) boxes_are_full = boxes_are_full && !box.empty();
    }
    void leaf(const LeafView& leaf) override {
      for (std::uint32_t id : leaf.primitives) in_leaf.at(id) = true;
    }
    std::vector<bool> in_leaf;
    bool boxes_are_full = true;
  } seen(mesh.size());
  REQUIRE(accel.visit(seen));
  CHECK(seen.boxes_are_full);
  std::size_t lost = 0;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto c = mesh.corners(i);
    lost += !seen.in_leaf[i] && c[0] != c[1] && c[1] != c[2] && c[2] != c[0];
  }
  CHECK(lost == 0);
  return compute_statistics(accel, mesh, {}, false);
}

/// Exact answers and brute_force's to the same rays; one set of the latter for each intersector.
class Reference {
 public:
  Reference(const TriangleMesh& mesh, std::vector<Ray> rays) : mesh_(mesh), rays_(std::move(rays)), oracle_(mesh) {
    truth_ = oracle_.closest_hit(rays_);
  }

  [[nodiscard]] const std::vector<Ray>& rays() const noexcept { return rays_; }
  [[nodiscard]] const std::vector<ExactHit>& truth() const noexcept { return truth_; }
  [[nodiscard]] const std::vector<Hit>& brute_force(std::string_view intersector) {
    auto [entry, fresh] = answers_.try_emplace(std::string(intersector));
    if (!fresh) return entry->second;
    const std::string leaf(default_leaf("brute_force", intersector, tested_isa()));
    const KernelRow* row = find_kernel("brute_force", leaf, intersector, "padded", "single", tested_isa());
    REQUIRE(row);
    BuildSettings settings;
    settings.builder = "in_order", settings.leaf = leaf;
    BuildReport report;
    const auto accel = build_structure("brute_force", mesh_, settings, report);
    return entry->second = closest_hit(*row, *accel, rays_);
  }
  [[nodiscard]] AnswerCheck check(std::span<const Hit> hits) const {
    return oracle_.check_closest_hit(rays_, truth_, hits);
  }

  /// With padded boxes: brute_force's hits, bit for bit, and any hit as closest hit. Where an
  /// intersector is structure-independent that holds for every ray; others may take a triangle that the exact ray
  /// passes by, which a structure need not find, so they are compared where brute_force has the exact primitive. Other
  /// boxes may lose hits, but give no other ids.
  void check(const Combination& combination, const Accel& accel) {
    for (const KernelRow* row : combination.rows) {
      INFO(name_of(*row) << ", " << combination.builder);
      const std::vector<Hit> hits = closest_hit(*row, accel, rays_);
      const std::vector<std::uint8_t> any = test::any_hit(*row, accel, rays_);
      const std::vector<Hit>& expected = brute_force(row->intersector);
      const auto agrees = [&](std::size_t i) {
        const bool right =
            expected[i].is_hit() == truth_[i].hit.is_hit() && expected[i].primitive == truth_[i].hit.primitive;
        if (!is_structure_independent(row->intersector) && !right) return true;
        if (row->box != "padded") return !hits[i].is_hit() || hits[i].primitive < mesh_.size();
        return same_bits(std::span(&hits[i], 1), std::span(&expected[i], 1)) &&
               any[i] == std::uint8_t(expected[i].is_hit());
      };
      require_each(rays_.size(), agrees, [&](std::size_t i) {
        return text(hits[i]) + ", any hit " + std::to_string(any[i]) + "; brute_force: " + text(expected[i]);
      });
    }
  }

 private:
  const TriangleMesh& mesh_;
  std::vector<Ray> rays_;
  Oracle oracle_;
  std::vector<ExactHit> truth_;
  std::map<std::string, std::vector<Hit>, std::less<>> answers_;
};

/// Where rays are aimed at edges that bound the surface, a float test may take the other side of what is exact.
enum class Silhouettes { none, aimed_at };

/// Every combination on the mesh: complete, and with brute_force's answers, whose `watertight` must be right on every
/// ray that is not aimed at a silhouette. `f(combination, accel, statistics)` may look closer.
template <class F>
void for_each_combination(const TriangleMesh& mesh, std::vector<Ray> rays, F&& f,
                          Silhouettes silhouettes = Silhouettes::none) {
  Reference reference(mesh, std::move(rays));
  const AnswerCheck brute = reference.check(reference.brute_force("watertight"));
  CAPTURE(brute.missed_hits, brute.false_hits, brute.wrong_surface);
  if (silhouettes == Silhouettes::none) CHECK(brute.wrong_answers() == 0);
  for (const Combination& combination : combinations()) {
    INFO(combination.name());
    const auto accel = combination.build(mesh);
    const StructureStatistics statistics = statistics_of(*accel, mesh);
    reference.check(combination, *accel);
    f(combination, *accel, statistics);
  }
}
inline void for_each_combination(const TriangleMesh& mesh, std::vector<Ray> rays,
                                 Silhouettes silhouettes = Silhouettes::none) {
  for_each_combination(
      mesh, std::move(rays), [](const Combination&, const Accel&, const StructureStatistics&) {}, silhouettes);
}

/// A ray from `from` through `to`.
[[nodiscard]] inline Ray through(Vec3f from, Vec3f to) { return {from, 0.0f, to - from, kInfinity}; }

}  // namespace arboretum::test
