// Oracle: the exact answer of every ray, and the check of given answers against it.
//
// Inputs are float32 bit patterns, taken as exact numbers; every decision (hit or miss, which is nearest,
// which tie) is exact: a floating-point filter first, then exact arithmetic where it cannot decide. The
// search goes through the oracle's own tree, which shares no code with the structures under test and never
// leaves out a triangle that the exact ray touches.
//
// Where the mesh moves, a ray has a time, and the triangles that it meets have their corners where core/motion.h puts
// them at that time, as float32 numbers; from there on everything is exact as before.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

struct DecisionCounts;  // core/exact/exact_predicate.h

/// The exact answer of one closest-hit ray. `hit`: t, u, v rounded from the exact values to float32, and the
/// lowest id of those at the exact nearest t. `t` as a double has a relative error of at most 2^-50.
struct ExactHit {
  Hit hit;
  double t = 0.0;
  bool tie = false;  ///< more than one primitive shares the exact nearest t
};

/// u and v that are off by more are counted. Float intersectors give them to 2^-14 at 99 of 100 ordinary rays, to 2^-12
/// of hard ones, but lose digits without limit where a ray grazes or comes from far away: so a few in a million are
/// beyond where a kernel is right, and nearly all where it is not (u and v exchanged, or not written).
inline constexpr double kWrongUv = 0x1p-10;

/// Wrong answers of a batch, as docs/numerics.md defines them, and the error of t where the surface is right.
struct AnswerCheck {
  std::uint64_t rays = 0, hits = 0;  ///< `hits`: of the answers given
  std::uint64_t missed_hits = 0;     ///< exact hit, reported miss
  std::uint64_t false_hits = 0;      ///< exact miss, reported hit
  std::uint64_t wrong_surface = 0;  ///< both hit, t apart by more than 2^-12 relative, and not both infinite in float32
  /// Both hit, but the primitive is not one of those at the exact nearest t, be the surface right or wrong;
  /// no part of wrong_answers().
  std::uint64_t wrong_primitive = 0;
  /// Misses, or hits of something behind (by more than rounding may move t), through a closed surface and not past its
  /// silhouette, as SurfaceAdjacency::passes_through() has it. 0 for any hit.
  std::uint64_t cracks = 0;
  /// |t - exact t| in units of the last place of the exact t's float32, over the rays with the right surface
  /// or primitive; what is no number, or too large for one, counts as the largest float.
  double t_error_ulp_median = 0, t_error_ulp_p99 = 0, t_error_ulp_max = 0;
  /// Of hits of the exact answer's own primitive: u or v off by more than kWrongUv; no part of wrong_answers().
  std::uint64_t wrong_uv = 0;
  /// The larger of |u - exact u| and |v - exact v|, over the same hits; what is no number counts as the largest float.
  double uv_error_median = 0, uv_error_p99 = 0, uv_error_max = 0;
  [[nodiscard]] std::uint64_t wrong_answers() const noexcept { return missed_hits + false_hits + wrong_surface; }
  /// Adds the counts of other rays. Errors of t, u and v do not add up: they stay.
  AnswerCheck& operator+=(const AnswerCheck& other) noexcept;
};

/// What is wrong with the answer to one closest-hit ray, in AnswerCheck's words.
struct Judgement {
  bool missed = false, false_hit = false, wrong_surface = false, wrong_primitive = false, crack = false;
  double t_error_ulp = -1;  ///< negative: nothing to compare
  double uv_error = -1;     ///< likewise
  [[nodiscard]] bool wrong() const noexcept { return missed || false_hit || wrong_surface; }
};

class Oracle {
 public:
  /// Builds the search tree with all TBB threads allowed to the caller. The mesh must outlive the oracle.
  explicit Oracle(const TriangleMesh& mesh);
  ~Oracle();
  Oracle(Oracle&&) noexcept;
  Oracle& operator=(Oracle&&) noexcept;

  /// Both use all TBB threads allowed to the caller; the answers do not depend on their number. `counts`,
  /// where given, is added to: how many decisions each level of the predicate took.
  [[nodiscard]] std::vector<ExactHit> closest_hit(RayBatch rays, DecisionCounts* counts = nullptr) const;
  /// 1 where anything lies within the closed interval, else 0.
  [[nodiscard]] std::vector<std::uint8_t> any_hit(RayBatch rays, DecisionCounts* counts = nullptr) const;
  /// closest_hit of rays that begin at `origins` instead of their own: points with more digits than float32 has, such
  /// as hit points, each coordinate a multiple of 2^-149 below 2^128. Each ray passes through the primitive `left_out`
  /// of it, which may be kNoPrimitive. Throws std::invalid_argument where the sizes differ.
  [[nodiscard]] std::vector<ExactHit> closest_hit_from(std::span<const std::array<double, 3>> origins, RayBatch rays,
                                                       std::span<const std::uint32_t> left_out,
                                                       DecisionCounts* counts = nullptr) const;

  /// `truth` as closest_hit or any_hit gave it for the same rays. Throws std::invalid_argument where the
  /// sizes differ.
  [[nodiscard]] AnswerCheck check_closest_hit(RayBatch rays, std::span<const ExactHit> truth,
                                              std::span<const Hit> answers) const;
  [[nodiscard]] AnswerCheck check_any_hit(RayBatch rays, std::span<const std::uint8_t> truth,
                                          std::span<const std::uint8_t> answers) const;

  /// The same for one ray, from any thread.
  [[nodiscard]] Judgement judge(const Ray& ray, float time, const ExactHit& truth, const Hit& answer) const;
  /// Of a ray that hits: SurfaceAdjacency::passes_vertex() where it does, from any thread.
  [[nodiscard]] bool passes_vertex(const Ray& ray, float time, const ExactHit& truth) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace arboretum
