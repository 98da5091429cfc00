// BuildJob: one build cell: the structure built again and again, each build timed by the structure itself.
#pragma once

#include "experiments/interleave.h"
#include "experiments/structure_pool.h"

namespace arboretum {

class BuildJob {
 public:
  BuildJob(const Cell& cell, const TriangleMesh& mesh, const Registry& registry)
      : cell_(cell), mesh_(mesh), registry_(registry) {}

  /// The first build is the warm-up, and its structure gives the facts; those after it say how many builds last
  /// `min_time` seconds of wall time, or kEnoughOfBuilds, without what is done around them. Throws what the build
  /// throws.
  void prepare(Json& facts, StructurePool& pool, const MeasureSettings& measure);
  [[nodiscard]] std::uint64_t builds() const noexcept { return builds_; }
  [[nodiscard]] Repetition measure(TimedLoop& loop) const;

 private:
  const Cell& cell_;
  const TriangleMesh& mesh_;
  const Registry& registry_;
  std::uint64_t builds_ = 1;
};

}  // namespace arboretum
