// Calling rows of the kernel table from tests: the rows that can run here, the structures they need, whole
// batches.
#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "core/isa.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum::test {

[[nodiscard]] inline std::string name_of(const KernelRow& row) {
  std::string name(row.structure);
  for (std::string_view part : {row.leaf, row.intersector, row.box, row.traversal, to_string(row.isa)})
    name.append("/").append(part);
  return name;
}

/// The rows of the ISAs that are available here, without most that are other rows' code put together anew: an
/// intersector is compiled once and called by every structure and traversal through the same pointers. The two that
/// most kernels are run with are there everywhere; `pluecker` and `exact` for single rays everywhere and in one mode of
/// each kind; the others with a BVH, a kd-tree and the reference. Leaves that are called by the same functions are all
/// there for single rays in bvh8, elsewhere once. Scalar ways of traversal are there with bvh8.
[[nodiscard]] inline std::vector<KernelRow> runnable_rows() {
  std::vector<KernelRow> rows;
  std::set<std::tuple<std::string_view, std::string_view, std::string_view, std::string_view, Isa, ClosestHitFunction>>
      seen;
  for (const KernelRow& row : kernel_table()) {
    if (!is_available(row.isa)) continue;
    const bool single = row.traversal == "single",
               reference = row.structure == "bvh8" || row.structure == "brute_force";
    const bool common = row.intersector == "moller_trumbore" || row.intersector == "watertight";
    if (row.isa == Isa::scalar && !single && !reference) continue;
    const bool mode = single || (row.structure == "bvh8" && (row.traversal == "packet64" || row.traversal == "queued"));
    if (!common && !mode) continue;
    if (!common && row.intersector != "pluecker" && row.intersector != "exact" && !reference &&
        row.structure != "kdtree")
      continue;
    const bool first =
        seen.insert({row.structure, row.intersector, row.box, row.traversal, row.isa, row.timed.closest_hit}).second;
    if (first || (single && row.structure == "bvh8")) rows.push_back(row);
  }
  return rows;
}

/// The structures of one mesh, each built once with its default builder.
class Structures {
 public:
  explicit Structures(const TriangleMesh& mesh) : mesh_(mesh) {}

  [[nodiscard]] const Accel& get(const KernelRow& row) {
    const StructureInfo& info = find_structure(row.structure)->info;
    BuildSettings settings;
    settings.builder = info.builders.front(), settings.leaf = row.leaf;
    settings.isa = info.build_depends_on_isa ? row.isa : best_isa();
    std::unique_ptr<Accel>& accel = built_[{row.structure, row.leaf, settings.isa}];
    BuildReport report;
    if (!accel) accel = build_structure(row.structure, mesh_, settings, report);
    return *accel;
  }

 private:
  const TriangleMesh& mesh_;
  std::map<std::tuple<std::string_view, std::string_view, Isa>, std::unique_ptr<Accel>> built_;
};

/// The number in the name of the row's traversal: `packet8`, `queued16`.
[[nodiscard]] inline unsigned rays_of(const KernelRow& row) {
  return unsigned(std::stoul(std::string(row.traversal.substr(row.traversal.find_first_of("0123456789")))));
}

/// With `counters`, the counting kernel. Answers that the kernel leaves unwritten are marked: t is NaN, an id
/// 0xdeadbeef.
[[nodiscard]] inline std::vector<Hit> closest_hit(const KernelRow& row, const Accel& accel, std::span<const Ray> rays,
                                                  TraversalSettings settings, Counters* counters = nullptr) {
  std::vector<Hit> hits(rays.size(), Hit{std::numeric_limits<float>::quiet_NaN(), 0, 0, 0xdeadbeefu});
  RayBatch batch(rays);
  batch.settings = settings;
  row.closest_hit(accel, batch, hits, counters);
  return hits;
}
[[nodiscard]] inline std::vector<Hit> closest_hit(const KernelRow& row, const Accel& accel, std::span<const Ray> rays,
                                                  Counters* counters = nullptr) {
  return closest_hit(row, accel, rays, TraversalSettings{}, counters);
}

[[nodiscard]] inline std::vector<std::uint8_t> any_hit(const KernelRow& row, const Accel& accel,
                                                       std::span<const Ray> rays, TraversalSettings settings,
                                                       Counters* counters = nullptr) {
  std::vector<std::uint8_t> occluded(rays.size(), 0xee);
  RayBatch batch(rays);
  batch.settings = settings;
  row.any_hit(accel, batch, occluded, counters);
  return occluded;
}
[[nodiscard]] inline std::vector<std::uint8_t> any_hit(const KernelRow& row, const Accel& accel,
                                                       std::span<const Ray> rays, Counters* counters = nullptr) {
  return any_hit(row, accel, rays, TraversalSettings{}, counters);
}

/// The best ISA that runs here and that this build has kernels for (ARBORETUM_ISAS may leave some out).
[[nodiscard]] inline Isa tested_isa() {
  static const Isa best = [] {
    Isa found = Isa::scalar;
    for (const KernelRow& row : kernel_table())
      if (is_available(row.isa)) found = std::max(found, row.isa);
    return found;
  }();
  return best;
}

/// What the counting kernel of the one or the other query counts.
[[nodiscard]] inline Counters counted(const KernelRow& row, const Accel& accel, std::span<const Ray> rays, bool any) {
  Counters counters;
  if (any) {
    (void)any_hit(row, accel, rays, &counters);
  } else {
    (void)closest_hit(row, accel, rays, &counters);
  }
  return counters;
}

/// What rows of the table answer to the same rays, each asked once however many others are held against it.
class Answers {
 public:
  struct Both {
    std::vector<Hit> closest;
    std::vector<std::uint8_t> any;
  };

  Answers(Structures& structures, std::span<const Ray> rays) : structures_(structures), rays_(rays) {}

  /// `row`: a row of kernel_table() itself.
  [[nodiscard]] const Both& of(const KernelRow& row) {
    const auto [entry, is_new] = known_.try_emplace(&row);
    if (is_new)
      entry->second = {closest_hit(row, structures_.get(row), rays_), any_hit(row, structures_.get(row), rays_)};
    return entry->second;
  }

 private:
  Structures& structures_;
  std::span<const Ray> rays_;
  std::map<const KernelRow*, Both> known_;
};

/// A hit for a message.
[[nodiscard]] inline std::string text(const Hit& hit) {
  std::ostringstream out;
  out << "t " << hit.t << ", primitive " << hit.primitive;
  return out.str();
}

/// -0 and 0, and any two NaNs of different bits, are told apart.
[[nodiscard]] inline bool same_bits(std::span<const Hit> a, std::span<const Hit> b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

}  // namespace arboretum::test
