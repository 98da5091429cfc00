#include "structures/end_point_overlap.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/random.h"
#include "structures/clipped_triangle.h"

namespace arboretum {
namespace {

constexpr std::size_t kLargest = 64;  ///< records that are never left out
constexpr std::size_t kPilot = 64;    ///< records that the work is estimated from
constexpr double kClipWork = 16.0;    ///< of a clip, in box steps
/// Of a triangle's area: a part that is no more is what clipping rounds where the triangle only touches a box. Boxes
/// that part space touch the triangles of their neighbours.
constexpr double kRoundings = 0x1p-40;

bool overlap(const Bounds3f& a, const Bounds3f& b) {
  return a.lower.x <= b.upper.x && b.lower.x <= a.upper.x && a.lower.y <= b.upper.y && b.lower.y <= a.upper.y &&
         a.lower.z <= b.upper.z && b.lower.z <= a.upper.z;
}

class Measure {
 public:
  Measure(const TriangleMesh& mesh, std::span<const TreeRecord> records, std::span<const std::uint32_t> references)
      : mesh_(mesh), records_(records), references_(references), areas_(mesh.size()), bounds_(mesh.size()) {
    tbb::parallel_for(std::size_t{0}, mesh.size(), [&](std::size_t i) {
      const auto corners = mesh.corners(i);
      const bool finite = is_finite(corners[0]) && is_finite(corners[1]) && is_finite(corners[2]);
      bounds_[i] = finite ? mesh.bounds(i) : Bounds3f{};
      areas_[i] = finite ? clipped_area(corners, bounds_[i]) : 0.0;
    });
    total_area_ = std::accumulate(areas_.begin(), areas_.end(), 0.0);
    std::vector<bool> seen(mesh.size());
    for (std::uint32_t r : references) {
      repeated_ = repeated_ || seen[r];
      seen[r] = true;
    }
    area_before_.reserve(references.size() + 1);
    area_before_.push_back(0.0);
    for (std::uint32_t r : references) area_before_.push_back(area_before_.back() + areas_[r]);
  }

  [[nodiscard]] double total_area() const { return total_area_; }

  /// Adds to `work` what was done. `stamps` has one entry a triangle, below any record's index + 1 at first.
  [[nodiscard]] double foreign_area(std::uint32_t index, std::vector<std::uint32_t>& stamps, double& work) const {
    const TreeRecord& own = records_[index];
    if (repeated_) {
      for (std::uint32_t r = own.first_reference; r < own.end_reference; ++r) stamps[references_[r]] = index + 1;
    }
    double area = 0.0;
    for (std::uint32_t i = 0; i < records_.size();) {
      ++work;
      const TreeRecord& record = records_[i];
      if (i == index || !overlap(record.bounds, own.bounds)) {
        i = record.end;
        continue;
      }
      const bool is_ancestor = i < index && index < record.end;
      if (!repeated_ && !is_ancestor && own.bounds.contains(record.bounds)) {
        area += area_before_[record.end_reference] - area_before_[record.first_reference];
        i = record.end;
        continue;
      }
      if (record.is_leaf) {
        for (std::uint32_t r = record.first_reference; r < record.end_reference; ++r) {
          const std::uint32_t primitive = references_[r];
          if (repeated_) {
            if (stamps[primitive] == index + 1) continue;
            stamps[primitive] = index + 1;
          }
          ++work;
          if (!overlap(bounds_[primitive], own.bounds)) continue;
          if (own.bounds.contains(bounds_[primitive])) {
            area += areas_[primitive];
          } else {
            work += kClipWork;
            const double part = clipped_area(mesh_.corners(primitive), own.bounds);
            if (part > kRoundings * areas_[primitive]) area += part;
          }
        }
      }
      ++i;
    }
    return area;
  }

 private:
  const TriangleMesh& mesh_;
  std::span<const TreeRecord> records_;
  std::span<const std::uint32_t> references_;
  std::vector<double> areas_;
  std::vector<Bounds3f> bounds_;
  std::vector<double> area_before_;  ///< of the triangles of the references before each
  double total_area_ = 0.0;
  bool repeated_ = false;  ///< leaves share triangles, which must count once
};

/// Which records are looked at and how much each stands for.
struct Sample {
  std::vector<std::uint32_t> index;
  std::vector<double> weight;
};

Sample choose(std::span<const TreeRecord> records, const Measure& measure, std::size_t triangles, double work) {
  std::vector<std::uint32_t> order(records.size());
  std::iota(order.begin(), order.end(), 0u);
  Sample sample;
  if (records.size() > kLargest + kPilot) {
    std::nth_element(order.begin(), order.begin() + kLargest, order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const double p = records[a].bounds.area(), q = records[b].bounds.area();
      return p != q ? p > q : a < b;
    });
    std::sort(order.begin() + kLargest, order.end());
    const std::size_t others = order.size() - kLargest;
    std::vector<std::uint32_t> stamps(triangles, 0);
    double pilot_work = 0.0;
    for (std::size_t k = 0; k < kPilot; ++k) {
      static_cast<void>(measure.foreign_area(order[kLargest + k * others / kPilot], stamps, pilot_work));
    }
    const double share = work / (pilot_work / kPilot * static_cast<double>(others));
    if (share < 1.0) {
      const std::size_t kept =
          std::max<std::size_t>(kPilot, static_cast<std::size_t>(share * static_cast<double>(others)));
      sample.index.assign(order.begin(), order.begin() + kLargest);
      sample.weight.assign(kLargest, 1.0);
      for (std::size_t k = 0; k < kept; ++k) {
        // One record of each of `kept` equal runs, at a place that repeats from run to run of the program.
        const std::size_t begin = k * others / kept, end = (k + 1) * others / kept;
        sample.index.push_back(order[kLargest + begin + random_bits(1, k, 0) % (end - begin)]);
        sample.weight.push_back(static_cast<double>(end - begin));
      }
      return sample;
    }
  }
  sample.index = std::move(order);
  sample.weight.assign(sample.index.size(), 1.0);
  return sample;
}

}  // namespace

double clipped_area(const std::array<Vec3f, 3>& corners, const Bounds3f& box) {
  const ClippedTriangle part(corners, box);
  const auto points = part.corners();
  ClippedTriangle::Point sum{0, 0, 0};
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    ClippedTriangle::Point a, b;
    for (std::size_t k = 0; k < 3; ++k) a[k] = points[i][k] - points[0][k], b[k] = points[i + 1][k] - points[0][k];
    for (std::size_t k = 0; k < 3; ++k) sum[k] += a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  }
  return 0.5 * std::hypot(sum[0], sum[1], sum[2]);
}

EndPointOverlap end_point_overlap(const TriangleMesh& mesh, std::span<const TreeRecord> records,
                                  std::span<const std::uint32_t> references, double work) {
  const Measure measure(mesh, records, references);
  if (records.empty() || !(measure.total_area() > 0.0)) return {};
  const Sample sample = choose(records, measure, mesh.size(), work);
  // One slot a record, summed in order: the same number for any count of threads.
  std::vector<double> terms(sample.index.size());
  tbb::enumerable_thread_specific<std::vector<std::uint32_t>> stamps(mesh.size(), 0u);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sample.index.size(), 16), [&](const auto& range) {
    std::vector<std::uint32_t>& mine = stamps.local();
    double unused = 0.0;
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      const std::uint32_t i = sample.index[k];
      terms[k] = sample.weight[k] * records[i].cost * measure.foreign_area(i, mine, unused);
    }
  });
  return {std::accumulate(terms.begin(), terms.end(), 0.0) / measure.total_area(),
          static_cast<double>(sample.index.size()) / static_cast<double>(records.size())};
}

}  // namespace arboretum
