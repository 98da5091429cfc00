#include "oracle/answer_check.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "core/exact/exact_predicate.h"
#include "oracle/sheared.h"

namespace arboretum {
namespace {

constexpr std::size_t kRaysATask = 4096;

struct Tally {
  AnswerCheck check;
  std::vector<float> t_errors, uv_errors;  // ulp, absolute
};

void expect_one_size(std::size_t rays, std::size_t truth, std::size_t answers) {
  if (rays != truth || rays != answers) {
    throw std::invalid_argument("oracle: as many exact and given answers as rays are needed");
  }
}

bool is_at_nearest_t(const TriangleMesh& mesh, const Ray& ray, FrameTime at, const ExactHit& truth,
                     std::uint32_t primitive) {
  if (primitive == truth.hit.primitive) return true;
  if (primitive >= mesh.size() || !truth.tie) return false;
  const Corners given = mesh.corners(primitive, at);
  if (!is_finite(given[0]) || !is_finite(given[1]) || !is_finite(given[2])) return false;
  ExactPredicate predicate(ray);
  Enclosure t;
  return predicate.meets(given, t) && predicate.compare_t(given, mesh.corners(truth.hit.primitive, at)) == 0;
}

/// Whether an answer farther away is not only the next triangle, taken for the nearest because both distances are
/// rounded.
bool is_behind(const TriangleMesh& mesh, const Ray& ray, FrameTime at, const ExactHit& truth, const Hit& answer) {
  if (answer.primitive >= mesh.size()) return true;
  const Sheared sheared(ray);
  const auto distance = [&](std::uint32_t id) {
    const auto c = mesh.corners(id, at);
    return rounded_distance(sheared, sheared(c[0]), sheared(c[1]), sheared(c[2]));
  };
  return distance(truth.hit.primitive).upper < distance(answer.primitive).lower;
}

/// NaN included, which no comparison holds for.
double uv_error(const Hit& exact, const Hit& answer) {
  const double u = std::fabs(double(answer.u) - exact.u), v = std::fabs(double(answer.v) - exact.v);
  constexpr double most = std::numeric_limits<float>::max();
  return u <= most && v <= most ? std::max(u, v) : most;
}

/// The smallest value that at least a share `p` of them does not exceed.
double quantile(std::vector<float>& values, double p) {
  const auto rank = static_cast<std::size_t>(std::ceil(p * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

double ulp_of(float x) noexcept {
  const float next = std::nextafter(x, std::numeric_limits<float>::infinity());
  return double(next) - double(x);
}

AnswerCheck& AnswerCheck::operator+=(const AnswerCheck& other) noexcept {
  rays += other.rays, hits += other.hits, missed_hits += other.missed_hits, false_hits += other.false_hits;
  wrong_surface += other.wrong_surface, wrong_primitive += other.wrong_primitive, cracks += other.cracks;
  wrong_uv += other.wrong_uv;
  return *this;
}

Judgement judge_closest_hit(const TriangleMesh& mesh, const Ray& ray, float time, const ExactHit& truth,
                            const Hit& answer, const std::function<const SurfaceAdjacency&()>& adjacency) {
  Judgement j;
  if (!truth.hit.is_hit()) {
    j.false_hit = answer.is_hit();
    return j;
  }
  const FrameTime at = frame_at(time, mesh.frames());
  bool something_behind = true;
  if (!answer.is_hit()) {
    j.missed = true;
  } else {
    // Where the exact t rounds to infinity, that is the right answer.
    const bool infinite = answer.t == truth.hit.t && std::isinf(answer.t);
    const double difference = infinite ? 0.0 : double(answer.t) - truth.t, tolerance = surface_tolerance(truth.t);
    j.wrong_surface = !(std::fabs(difference) <= tolerance);  // true for a NaN
    j.wrong_primitive = !is_at_nearest_t(mesh, ray, at, truth, answer.primitive);
    something_behind = difference > tolerance && j.wrong_primitive && is_behind(mesh, ray, at, truth, answer);
    if ((!j.wrong_surface || !j.wrong_primitive) && std::isfinite(truth.hit.t)) {
      const double error = std::fabs(difference) / ulp_of(truth.hit.t);
      constexpr double kMost = std::numeric_limits<float>::max();
      j.t_error_ulp = error <= kMost ? error : kMost;  // a NaN, too
    }
    if (answer.primitive == truth.hit.primitive) j.uv_error = uv_error(truth.hit, answer);
  }
  j.crack = something_behind && adjacency().passes_through(ray, at, truth.hit.primitive, answer.primitive);
  return j;
}

AnswerCheck check_closest_hits(const TriangleMesh& mesh, RayBatch rays, std::span<const ExactHit> truth,
                               std::span<const Hit> answers,
                               const std::function<const SurfaceAdjacency&()>& adjacency) {
  expect_one_size(rays.size(), truth.size(), answers.size());
  tbb::enumerable_thread_specific<Tally> tallies;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kRaysATask), [&](const auto& range) {
    Tally& tally = tallies.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const Judgement j = judge_closest_hit(mesh, rays[i], rays.time(i), truth[i], answers[i], adjacency);
      AnswerCheck& check = tally.check;
      check.hits += answers[i].is_hit(), check.missed_hits += j.missed, check.false_hits += j.false_hit;
      check.wrong_surface += j.wrong_surface, check.wrong_primitive += j.wrong_primitive, check.cracks += j.crack;
      if (j.t_error_ulp >= 0) tally.t_errors.push_back(static_cast<float>(j.t_error_ulp));
      if (j.uv_error >= 0) tally.uv_errors.push_back(static_cast<float>(j.uv_error));
      check.wrong_uv += j.uv_error > kWrongUv;
    }
  });
  AnswerCheck sum;
  std::vector<float> errors, uv_errors;
  for (const Tally& tally : tallies) {
    sum += tally.check;
    errors.insert(errors.end(), tally.t_errors.begin(), tally.t_errors.end());
    uv_errors.insert(uv_errors.end(), tally.uv_errors.begin(), tally.uv_errors.end());
  }
  sum.rays = rays.size();
  if (!errors.empty()) {
    sum.t_error_ulp_median = quantile(errors, 0.5);
    sum.t_error_ulp_p99 = quantile(errors, 0.99);
    sum.t_error_ulp_max = *std::max_element(errors.begin(), errors.end());
  }
  if (!uv_errors.empty()) {
    sum.uv_error_median = quantile(uv_errors, 0.5);
    sum.uv_error_p99 = quantile(uv_errors, 0.99);
    sum.uv_error_max = *std::max_element(uv_errors.begin(), uv_errors.end());
  }
  return sum;
}

AnswerCheck check_any_hits(RayBatch rays, std::span<const std::uint8_t> truth, std::span<const std::uint8_t> answers) {
  expect_one_size(rays.size(), truth.size(), answers.size());
  AnswerCheck sum;
  sum.rays = rays.size();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    // What is neither 0 nor 1 was left unwritten, and is wrong whatever the truth.
    sum.hits += answers[i] == 1;
    sum.missed_hits += truth[i] != 0 && answers[i] != 1;
    sum.false_hits += truth[i] == 0 && answers[i] != 0;
  }
  return sum;
}

}  // namespace arboretum
