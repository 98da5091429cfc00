#include "oracle/oracle.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>

#include "oracle/answer_check.h"
#include "oracle/exact_predicate.h"
#include "oracle/search_tree.h"

namespace arboretum {
namespace {

constexpr std::size_t kGrain = 512;  // rays of one task

/// The exact nearest hit among those shown so far: `t` encloses its t, and an order that enclosures do not
/// settle is exact.
struct Nearest {
  std::uint32_t id = kNoPrimitive;
  Corners corners;
  Enclosure t;
  bool tie = false;

  void offer(std::uint32_t candidate, const Corners& candidate_corners, const Enclosure& candidate_t,
             ExactPredicate& predicate) {
    if (id != kNoPrimitive) {
      if (candidate_t.lower > t.upper) return;
      if (!(candidate_t.upper < t.lower)) {
        const int order = predicate.compare_t(candidate_corners, corners);
        if (order > 0) return;
        if (order == 0) {
          tie = true;
          t = {std::max(t.lower, candidate_t.lower), std::min(t.upper, candidate_t.upper)};
          if (candidate < id) id = candidate, corners = candidate_corners;
          return;
        }
      }
    }
    id = candidate, corners = candidate_corners, t = candidate_t, tie = false;
  }
};

ExactHit closest(const SearchTree& tree, const Ray& ray, DecisionCounts& counts) {
  ExactHit result;
  if (!is_valid(ray)) return result;
  ExactPredicate predicate(ray);
  Nearest nearest;
  tree.search(ray, [&](std::uint32_t id, const Corners& corners, double& limit) {
    Enclosure t;
    if (predicate.meets(corners, t)) {
      nearest.offer(id, corners, t, predicate);
      limit = std::min(limit, nearest.t.upper);
    }
    return false;
  });
  if (nearest.id != kNoPrimitive) {
    const RoundedPoint point = predicate.round(nearest.corners);
    result = {Hit{point.t_rounded, point.u, point.v, nearest.id}, point.t, nearest.tie};
  }
  counts += predicate.counts();
  return result;
}

bool any(const SearchTree& tree, const Ray& ray, DecisionCounts& counts) {
  if (!is_valid(ray)) return false;
  ExactPredicate predicate(ray);
  bool found = false;
  tree.search(ray, [&](std::uint32_t, const Corners& corners, double&) {
    Enclosure t;
    return found = predicate.meets(corners, t);
  });
  counts += predicate.counts();
  return found;
}

template <class Result, class Trace>
std::vector<Result> trace_all(std::span<const Ray> rays, DecisionCounts* counts, const Trace& trace) {
  std::vector<Result> results(rays.size());
  tbb::enumerable_thread_specific<DecisionCounts> local;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kGrain), [&](const auto& range) {
    DecisionCounts& mine = local.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) results[i] = trace(rays[i], mine);
  });
  if (counts != nullptr) {
    for (const DecisionCounts& c : local) *counts += c;
  }
  return results;
}

}  // namespace

struct Oracle::Implementation {
  explicit Implementation(const TriangleMesh& m) : mesh(m), tree(m) {}

  const SurfaceAdjacency& surface() const {
    std::call_once(adjacency_made, [this] { adjacency = std::make_unique<SurfaceAdjacency>(mesh); });
    return *adjacency;
  }

  const TriangleMesh& mesh;
  SearchTree tree;
  mutable std::once_flag adjacency_made;
  mutable std::unique_ptr<SurfaceAdjacency> adjacency;
};

Oracle::Oracle(const TriangleMesh& mesh) : implementation_(std::make_unique<Implementation>(mesh)) {}
Oracle::~Oracle() = default;
Oracle::Oracle(Oracle&&) noexcept = default;
Oracle& Oracle::operator=(Oracle&&) noexcept = default;

std::vector<ExactHit> Oracle::closest_hit(std::span<const Ray> rays, DecisionCounts* counts) const {
  return trace_all<ExactHit>(rays, counts, [this](const Ray& ray, DecisionCounts& c) {
    return closest(implementation_->tree, ray, c);
  });
}

std::vector<std::uint8_t> Oracle::any_hit(std::span<const Ray> rays, DecisionCounts* counts) const {
  return trace_all<std::uint8_t>(rays, counts, [this](const Ray& ray, DecisionCounts& c) {
    return static_cast<std::uint8_t>(any(implementation_->tree, ray, c));
  });
}

AnswerCheck Oracle::check_closest_hit(std::span<const Ray> rays, std::span<const ExactHit> truth,
                                      std::span<const Hit> answers) const {
  return check_closest_hits(implementation_->mesh, rays, truth, answers,
                            [this]() -> const SurfaceAdjacency& { return implementation_->surface(); });
}

AnswerCheck Oracle::check_any_hit(std::span<const Ray> rays, std::span<const std::uint8_t> truth,
                                  std::span<const std::uint8_t> answers) const {
  return check_any_hits(rays, truth, answers);
}

}  // namespace arboretum
