// Verification: cells' answers to hard rays, judged ray by ray against the exact ones and against what the cells
// promise.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "experiments/cell.h"
#include "experiments/registry.h"
#include "experiments/verify_tally.h"
#include "intersectors/promises.h"

namespace arboretum {

/// Rays on a mesh with their exact answers.
struct VerifyBatch {
  const TriangleMesh& mesh;
  const Oracle& oracle;
  const HardRays& rays;
  std::vector<ExactHit> truth;
  std::uint64_t first = 0;  ///< number of the first ray
};

/// The structures of one mesh, each built when it is first asked for.
class StructureShelf {
 public:
  /// Both must outlive it. `threads` build.
  StructureShelf(const TriangleMesh& mesh, const Registry& registry, unsigned threads)
      : mesh_(mesh), registry_(registry), threads_(threads) {}
  /// Throws UserError as build_structure() does. The reference holds until the next call: beyond kMostBytes all others
  /// are dropped, and always those that were expected and have been got as often.
  [[nodiscard]] const Accel& get(const Cell& cell);
  /// get() will be called for the cell so many times more. A structure that nothing was ever expected of is kept.
  void expect(const Cell& cell, std::uint64_t times);
  /// How many structures are held.
  [[nodiscard]] std::size_t size() const noexcept { return built_.size(); }

  static constexpr std::size_t kMostBytes = std::size_t{6} << 30;

 private:
  using Key = std::tuple<std::string, std::string, std::string, Isa>;

  [[nodiscard]] Isa built_for(const Cell& cell) const;
  [[nodiscard]] Key key_of(const Cell& cell) const;
  void drop_spent(const Key& but);

  const TriangleMesh& mesh_;
  const Registry& registry_;
  unsigned threads_;
  std::map<Key, std::unique_ptr<Accel>> built_;
  std::map<Key, std::uint64_t> expected_;  ///< calls of get() to come
  std::size_t bytes_ = 0;
};

/// Whether the cell's promise speaks of this ray: the numbers of ray and scene, whose largest coordinate this is, are
/// within its range.
[[nodiscard]] bool is_within(const Promise& promise, const Ray& ray, float largest) noexcept;

/// Traces closest and any hit of the whole batch, in blocks on all TBB threads allowed to the caller, and counts, one
/// tally for each kind of kHardKindNames. `hits` becomes the cell's answers; `reference`, where it is not empty, those
/// of another cell.
[[nodiscard]] std::vector<VerifyTally> verify_cell(const Cell& cell, const Accel& accel, const VerifyBatch& batch,
                                                   std::vector<Hit>& hits, std::span<const Hit> reference);

/// A cell and what was counted of it: tallies[variant][kind].
struct VerifiedCell {
  Cell cell;
  Promise promise;
  std::vector<std::vector<VerifyTally>> tallies;
  std::vector<std::string> wrong_cases;  ///< of a cases file: ids that it gets wrong
  Breach newest{};                       ///< the first of what was added last

  [[nodiscard]] VerifyTally sum() const;
  void add(std::size_t variant, const std::vector<VerifyTally>& by_kind);
};

/// Rays that are traced together, the one at `place` for its answer.
struct Company {
  std::vector<Ray> rays;
  std::size_t place = 0;
};

/// verify_cell() for all cells, with the first of each intersector, box and ISA as the others' reference. `company`: of
/// a batch of one ray, which is then traced among these as well where the traversal takes several at a time, and held
/// to the same answer.
void verify_all(std::vector<VerifiedCell>& cells, std::size_t variant, StructureShelf& shelf, const VerifyBatch& batch,
                const Company* company = nullptr);

}  // namespace arboretum
