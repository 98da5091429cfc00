// The comparison of given answers with the exact ones, ray by ray.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>

#include "oracle/oracle.h"
#include "oracle/surface_adjacency.h"

namespace arboretum {

/// Difference of t beyond which a hit is on the wrong surface: relative, and not less than the least denormal float,
/// since rounding moves a t that is no normal number by up to half of that.
[[nodiscard]] inline double surface_tolerance(double exact_t) noexcept {
  return std::max(0x1p-12 * std::fabs(exact_t), 0x1p-149);
}

/// The unit of the last place: from x to the next float above it.
[[nodiscard]] double ulp_of(float x) noexcept;

/// One ray of a batch; `adjacency` as below.
[[nodiscard]] Judgement judge_closest_hit(const TriangleMesh& mesh, const Ray& ray, float time, const ExactHit& truth,
                                          const Hit& answer, const std::function<const SurfaceAdjacency&()>& adjacency);

/// `adjacency` is called, from any thread, only when an answer could be a crack.
[[nodiscard]] AnswerCheck check_closest_hits(const TriangleMesh& mesh, RayBatch rays, std::span<const ExactHit> truth,
                                             std::span<const Hit> answers,
                                             const std::function<const SurfaceAdjacency&()>& adjacency);
[[nodiscard]] AnswerCheck check_any_hits(RayBatch rays, std::span<const std::uint8_t> truth,
                                         std::span<const std::uint8_t> answers);

}  // namespace arboretum
