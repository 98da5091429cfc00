#include "oracle/oracle.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>
#include <stdexcept>

#include "oracle/answer_check.h"
#include "core/exact/exact_predicate.h"
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

/// The triangles of a mesh as a ray of a time sees them: the tree's own corners while nothing moves.
class CornersAt {
 public:
  CornersAt(const TriangleMesh& mesh, float time) : mesh_(mesh), at_(frame_at(time, mesh.frames())) {}
  [[nodiscard]] Corners operator()(std::uint32_t id, const Corners& first) const {
    return mesh_.moves() ? mesh_.corners(id, at_) : first;
  }

 private:
  const TriangleMesh& mesh_;
  FrameTime at_;
};

/// A ray of a batch: where it begins, and the triangle that it passes through, or kNoPrimitive.
struct Query {
  const Ray& ray;
  std::array<double, 3> origin;
  std::uint32_t left_out;
};

Query usual(const Ray& ray) { return {ray, {ray.origin.x, ray.origin.y, ray.origin.z}, kNoPrimitive}; }

ExactHit closest(const SearchTree& tree, const CornersAt& corners_at, const Query& query, DecisionCounts& counts) {
  ExactHit result;
  if (!is_valid(query.ray)) return result;
  ExactPredicate predicate(query.ray, query.origin);
  Nearest nearest;
  tree.search(query.ray, query.origin, [&](std::uint32_t id, const Corners& first, double& limit) {
    if (id == query.left_out) return false;
    const Corners corners = corners_at(id, first);
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

bool any(const SearchTree& tree, const CornersAt& corners_at, const Query& query, DecisionCounts& counts) {
  if (!is_valid(query.ray)) return false;
  ExactPredicate predicate(query.ray, query.origin);
  bool found = false;
  tree.search(query.ray, query.origin, [&](std::uint32_t id, const Corners& first, double&) {
    if (id == query.left_out) return false;
    Enclosure t;
    return found = predicate.meets(corners_at(id, first), t);
  });
  counts += predicate.counts();
  return found;
}

template <class Result, class Trace>
std::vector<Result> trace_all(const TriangleMesh& mesh, RayBatch rays, DecisionCounts* counts, const Trace& trace) {
  std::vector<Result> results(rays.size());
  tbb::enumerable_thread_specific<DecisionCounts> local;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kGrain), [&](const auto& range) {
    DecisionCounts& mine = local.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      results[i] = trace(i, CornersAt(mesh, rays.time(i)), mine);
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

std::vector<ExactHit> Oracle::closest_hit(RayBatch rays, DecisionCounts* counts) const {
  return trace_all<ExactHit>(implementation_->mesh, rays, counts,
                             [&](std::size_t i, const CornersAt& at, DecisionCounts& c) {
                               return closest(implementation_->tree, at, usual(rays[i]), c);
                             });
}

std::vector<ExactHit> Oracle::closest_hit_from(std::span<const std::array<double, 3>> origins, RayBatch rays,
                                               std::span<const std::uint32_t> left_out, DecisionCounts* counts) const {
  if (origins.size() != rays.size() || left_out.size() != rays.size())
    throw std::invalid_argument("oracle: as many origins and primitives left out as rays are needed");
  return trace_all<ExactHit>(implementation_->mesh, rays, counts,
                             [&](std::size_t i, const CornersAt& at, DecisionCounts& c) {
                               return closest(implementation_->tree, at, {rays[i], origins[i], left_out[i]}, c);
                             });
}

std::vector<std::uint8_t> Oracle::any_hit(RayBatch rays, DecisionCounts* counts) const {
  return trace_all<std::uint8_t>(implementation_->mesh, rays, counts,
                                 [&](std::size_t i, const CornersAt& at, DecisionCounts& c) {
                                   return static_cast<std::uint8_t>(any(implementation_->tree, at, usual(rays[i]), c));
                                 });
}

AnswerCheck Oracle::check_closest_hit(RayBatch rays, std::span<const ExactHit> truth,
                                      std::span<const Hit> answers) const {
  return check_closest_hits(implementation_->mesh, rays, truth, answers,
                            [this]() -> const SurfaceAdjacency& { return implementation_->surface(); });
}

Judgement Oracle::judge(const Ray& ray, float time, const ExactHit& truth, const Hit& answer) const {
  return judge_closest_hit(implementation_->mesh, ray, time, truth, answer,
                           [this]() -> const SurfaceAdjacency& { return implementation_->surface(); });
}

bool Oracle::passes_vertex(const Ray& ray, float time, const ExactHit& truth) const {
  return implementation_->surface().passes_vertex(ray, frame_at(time, implementation_->mesh.frames()),
                                                  truth.hit.primitive);
}

AnswerCheck Oracle::check_any_hit(RayBatch rays, std::span<const std::uint8_t> truth,
                                  std::span<const std::uint8_t> answers) const {
  return check_any_hits(rays, truth, answers);
}

}  // namespace arboretum
