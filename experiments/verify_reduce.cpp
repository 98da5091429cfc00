#include "experiments/verify_reduce.h"

#include <algorithm>
#include <array>

#include "core/error.h"

namespace arboretum {
namespace {

constexpr std::size_t kLarge = 2048;  // triangles: a mesh above it is not tried whole

using Ids = std::vector<std::uint32_t>;

TriangleMesh part_of(const TriangleMesh& mesh, const Ids& ids) {
  TriangleMesh part;
  for (std::uint32_t id : ids) {
    const auto first = static_cast<std::uint32_t>(part.vertices.size());
    for (Vec3f p : mesh.corners(id)) part.vertices.push_back(p);
    part.triangles.push_back({first, first + 1, first + 2});
  }
  return part;
}

class Reducer {
 public:
  Reducer(const VerifiedCell& cell, const Registry& registry, const TriangleMesh& mesh, const Breach& breach)
      : cell_(cell), registry_(registry), mesh_(mesh) {
    rays_.rays = {breach.given}, rays_.kinds = {breach.kind}, rays_.sources = {kNoPrimitive};
  }

  bool is_broken(const Ids& ids) const {
    if (ids.empty()) return false;
    const TriangleMesh part = part_of(mesh_, ids);
    const Oracle oracle(part);
    VerifyBatch batch{part, oracle, rays_, oracle.closest_hit(rays_.batch())};
    StructureShelf shelf(part, registry_, 1);
    std::vector<Hit> hits;
    for (const VerifyTally& t : verify_cell(cell_.cell, shelf.get(cell_.cell), batch, hits, {}))
      if (t.broken > 0) return true;
    return false;
  }

  /// Takes away as much as may go: halves, then quarters, down to single triangles.
  Ids smallest(Ids ids) const {
    for (std::size_t step = std::max<std::size_t>(ids.size() / 2, 1); step > 0; step /= 2) {
      for (std::size_t begin = 0; begin < ids.size();) {
        Ids fewer(ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(begin));
        fewer.insert(fewer.end(), ids.begin() + static_cast<std::ptrdiff_t>(std::min(begin + step, ids.size())),
                     ids.end());
        if (is_broken(fewer))
          ids = std::move(fewer);
        else
          begin += step;
      }
    }
    return ids;
  }

 private:
  const VerifiedCell& cell_;
  const Registry& registry_;
  const TriangleMesh& mesh_;
  HardRays rays_;
};

/// Those that share a corner's position with the exact hit or the answer.
Ids about(const TriangleMesh& mesh, const Breach& breach) {
  std::vector<Vec3f> corners;
  for (std::uint32_t id : {breach.truth.hit.primitive, breach.answer.primitive}) {
    if (id >= mesh.size()) continue;
    for (Vec3f p : mesh.corners(id)) corners.push_back(p);
  }
  Ids ids;
  for (std::uint32_t i = 0; i < mesh.size(); ++i)
    if (std::ranges::any_of(mesh.corners(i), [&](Vec3f p) { return std::ranges::find(corners, p) != corners.end(); }))
      ids.push_back(i);
  return ids;
}

}  // namespace

std::optional<TriangleMesh> reduce(const VerifiedCell& cell, const Registry& registry, const TriangleMesh& mesh,
                                   const Breach& breach) {
  if (mesh.moves()) return std::nullopt;
  const Reducer reducer(cell, registry, mesh, breach);
  Ids ids = about(mesh, breach);
  if (ids.size() > kLarge || !reducer.is_broken(ids)) {
    if (mesh.size() > kLarge) return std::nullopt;
    ids.resize(mesh.size());
    for (std::uint32_t i = 0; i < mesh.size(); ++i) ids[i] = i;
    if (!reducer.is_broken(ids)) return std::nullopt;
  }
  return part_of(mesh, reducer.smallest(std::move(ids)));
}

}  // namespace arboretum
