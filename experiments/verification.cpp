#include "experiments/verification.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/coordinates.h"
#include "experiments/crash_note.h"
#include "experiments/structure_pool.h"
#include "oracle/answer_check.h"
#include "oracle/sheared.h"

namespace arboretum {
namespace {

constexpr std::size_t kBlock = 4096;  // rays of one call

/// A kernel leaves none of its answers unwritten: what stood there before is none.
constexpr Hit kUnwritten{.t = -1.0f, .u = 0.0f, .v = 0.0f, .primitive = 0xdeadbeefu};

/// Of any hit, likewise.
enum class AnyAnswer : std::uint8_t { miss = 0, hit = 1, unwritten = 0xee };

/// In units of the last place: of the exact t, which is itself rounded to double.
constexpr double kTruthRounding = 0x1p-25;
/// `exact` gives u and v to an ulp of 1; those that they are compared with are rounded to nearest.
constexpr double kUvRounding = 0x1p-23 + 0x1p-25;

double length(const Triple<double>& a) { return std::hypot(a[0], a[1], a[2]); }

/// The size that the promise speaks of; infinite where the ray lies in the triangle's plane, as far as doubles tell.
double conditioning_of(Conditioning kind, const Ray& ray, const std::array<Vec3f, 3>& corners, double t) {
  if (kind == Conditioning::none) return 0.0;
  const Triple<double> e1 = difference_from(corners[0], corners[1]), e2 = difference_from(corners[0], corners[2]),
                       d{ray.direction.x, ray.direction.y, ray.direction.z};
  double away = 0.0;
  for (const Vec3f& corner : corners) away = std::max(away, length(difference_from(ray.origin, corner)));
  const double edges =
      length(e1) * length(e2) + (kind == Conditioning::vertices ? away * (length(e1) + length(e2)) : 0.0);
  return edges * (away + t * length(d)) / std::fabs(determinant(e1, e2, d));
}

class Judge {
 public:
  Judge(const Cell& cell, const VerifyBatch& batch)
      : batch_(batch), promise_(promise_of(cell.structure, cell.intersector, cell.box)),
        largest_(largest_coordinate(batch.mesh.bounds())) {}

  void operator()(std::size_t i, const Hit& answer, AnyAnswer any, const Hit* reference,
                  std::vector<VerifyTally>& tallies) const {
    const Ray& ray = batch_.rays.rays[i];
    const ExactHit& truth = batch_.truth[i];
    const float time = batch_.rays.times.empty() ? 0.0f : batch_.rays.times[i];
    const HardKind kind = batch_.rays.kinds[i];
    VerifyTally& tally = tallies[static_cast<std::size_t>(kind)];
    const Judgement j = batch_.oracle.judge(ray, time, truth, answer);
    ++tally.rays;
    tally.exact_hits += truth.hit.is_hit();
    tally.missed += j.missed, tally.false_hits += j.false_hit, tally.wrong_surface += j.wrong_surface;
    tally.wrong_primitive += j.wrong_primitive, tally.cracks += j.crack;
    const bool any_missed = truth.hit.is_hit() && any != AnyAnswer::hit;
    tally.any_missed += any_missed, tally.any_false += !truth.hit.is_hit() && any != AnyAnswer::miss;
    const std::uint32_t source = batch_.rays.sources[i];
    tally.self_hits += source != kNoPrimitive && answer.primitive == source && truth.hit.primitive != source;
    tally.differs += reference && (reference->primitive != answer.primitive || reference->t != answer.t);
    if (j.t_error_ulp >= 0) tally.t_ulp.add(j.t_error_ulp);
    if (j.uv_error >= 0) tally.uv.add(j.uv_error);

    if (!promise_.any() || !is_within(promise_, ray, largest_)) return;
    std::string what = breach(i, time, j, answer, any);
    if (what.empty()) return;
    ++tally.broken;
    if (!tally.first.what.empty() && tally.first.ray < batch_.first + i) return;
    tally.first = {batch_.first + i, std::move(what), ray, time, kind, truth, answer, any == AnyAnswer::hit};
  }

 private:
  /// What of the promise the answers to ray i break; empty: nothing.
  [[nodiscard]] std::string breach(std::size_t i, float time, const Judgement& j, const Hit& answer,
                                   AnyAnswer any) const {
    const Ray& ray = batch_.rays.rays[i];
    const ExactHit& truth = batch_.truth[i];
    const bool is_hit = truth.hit.is_hit(),
               in_range = !is_hit || promise_.exponent > 0 || truth.t < std::ldexp(1.0, kTExponent);
    if (promise_.coverage == Coverage::exact && in_range) {
      if (j.missed) return "an exact hit is missed";
      if (j.false_hit) return "an exact miss is hit";
      if (is_hit && answer.primitive != truth.hit.primitive) return "not the lowest primitive at the exact nearest t";
      if (is_hit && answer.t != truth.hit.t) return "t is not the exact t rounded";
      if (is_hit && !(std::fabs(double(answer.u) - truth.hit.u) <= kUvRounding &&
                      std::fabs(double(answer.v) - truth.hit.v) <= kUvRounding))
        return "u or v is off by more than an ulp of 1";
      if (any != AnyAnswer::miss && any != AnyAnswer::hit) return "any hit leaves its answer unwritten";
      if ((any == AnyAnswer::hit) != is_hit)
        return is_hit ? "any hit misses an exact hit" : "any hit finds an exact miss";
    }
    if (promise_.coverage == Coverage::closed || promise_.coverage == Coverage::edges) {
      const bool any_crack = is_hit && any != AnyAnswer::hit && batch_.oracle.judge(ray, time, truth, Hit{}).crack;
      if ((j.crack || any_crack) &&
          (promise_.coverage == Coverage::closed || !batch_.oracle.passes_vertex(ray, time, truth)))
        return j.crack ? "lost through a closed surface" : "any hit: lost through a closed surface";
    }
    if (promise_.t_ulp > 0 && in_range && j.t_error_ulp > promise_.t_ulp + kTruthRounding && !j.wrong_primitive) {
      const std::array<Vec3f, 3> corners = batch_.mesh.corners(answer.primitive, frame_at(time, batch_.mesh.frames()));
      const double more = kConditioning * conditioning_of(promise_.conditioning, ray, corners, truth.t);
      if (!(j.t_error_ulp <= promise_.t_ulp + kTruthRounding + more / ulp_of(truth.hit.t)))
        return "t is off by more than is promised";
    }
    return {};
  }

  const VerifyBatch& batch_;
  Promise promise_;
  float largest_;
};

/// Adds to the tallies of a ray traced alone what goes wrong with it in company alone.
void add_company(const Cell& cell, const Accel& accel, const VerifyBatch& batch, const Company& company,
                 std::vector<VerifyTally>& tallies) {
  const UnderWay tracing(cell.name());
  std::vector<Hit> hits(company.rays.size(), kUnwritten);
  std::vector<std::uint8_t> occluded(company.rays.size(), std::uint8_t(AnyAnswer::unwritten));
  cell.kernel->closest_hit(accel, RayBatch(company.rays), hits);
  cell.kernel->any_hit(accel, RayBatch(company.rays), occluded);
  std::vector<VerifyTally> among(kHardKindNames.size());
  Judge(cell, batch)(0, hits[company.place], AnyAnswer(occluded[company.place]), nullptr, among);
  const auto kind = static_cast<std::size_t>(batch.rays.kinds[0]);
  VerifyTally &alone = tallies[kind], &together = among[kind];
  alone.in_company += alone.faults() == 0 && together.faults() > 0;
  if (together.broken == 0 || alone.broken > 0) return;
  alone.broken = together.broken, alone.first = together.first;
  alone.first.what += ", among other rays";
}

}  // namespace

bool is_within(const Promise& promise, const Ray& ray, float largest) noexcept {
  if (promise.exponent == 0) return true;
  const float high = std::ldexp(1.0f, promise.exponent), low = 1.0f / high;
  const float size = std::max(largest, largest_coordinate(ray.origin)), direction = largest_coordinate(ray.direction);
  // An invalid ray must miss at whatever numbers: NaN and infinity are within.
  return !is_valid(ray) || (size >= low && size <= high && direction >= low && direction <= high);
}

Isa StructureShelf::built_for(const Cell& cell) const {
  return registry_.structure(cell.structure)->info.build_depends_on_isa ? cell.isa : registry_.isas.back();
}

StructureShelf::Key StructureShelf::key_of(const Cell& cell) const {
  return {cell.structure, cell.builder_name(), cell.leaf, built_for(cell)};
}

void StructureShelf::expect(const Cell& cell, std::uint64_t times) { expected_[key_of(cell)] += times; }

void StructureShelf::drop_spent(const Key& but) {
  std::erase_if(built_, [&](const auto& shelved) {
    const auto& [key, accel] = shelved;
    const auto left = expected_.find(key);
    if (key == but || left == expected_.end() || left->second > 0) return false;
    bytes_ -= accel->bytes();
    return true;
  });
}

const Accel& StructureShelf::get(const Cell& cell) {
  const Key key = key_of(cell);
  drop_spent(key);
  if (const auto left = expected_.find(key); left != expected_.end() && left->second > 0) --left->second;
  if (const auto found = built_.find(key); found != built_.end()) return *found->second;
  BuildSettings settings = settings_of(cell);
  settings.isa = built_for(cell), settings.threads = threads_;
  const UnderWay building("the build for " + cell.name());
  BuildReport report;
  std::unique_ptr<Accel> fresh = registry_.build(cell.structure, mesh_, settings, report);
  if (bytes_ + fresh->bytes() > kMostBytes) built_.clear(), bytes_ = 0;
  bytes_ += fresh->bytes();
  return *(built_[key] = std::move(fresh));
}

std::vector<VerifyTally> verify_cell(const Cell& cell, const Accel& accel, const VerifyBatch& batch,
                                     std::vector<Hit>& hits, std::span<const Hit> reference) {
  const UnderWay tracing(cell.name());
  const std::size_t count = batch.rays.rays.size();
  hits.assign(count, kUnwritten);
  const Judge judge(cell, batch);
  tbb::enumerable_thread_specific<std::vector<VerifyTally>> local(kHardKindNames.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kBlock), [&](const tbb::blocked_range<std::size_t>& r) {
    const RayBatch rays = batch.rays.batch().part(r.begin(), r.size());
    std::vector<std::uint8_t> occluded(r.size(), std::uint8_t(AnyAnswer::unwritten));
    cell.kernel->closest_hit(accel, rays, std::span(hits).subspan(r.begin(), r.size()));
    cell.kernel->any_hit(accel, rays, occluded);
    for (std::size_t i = r.begin(); i != r.end(); ++i)
      judge(i, hits[i], AnyAnswer(occluded[i - r.begin()]), reference.empty() ? nullptr : &reference[i], local.local());
  });
  std::vector<VerifyTally> sum(kHardKindNames.size());
  for (const auto& tallies : local)
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += tallies[k];
  return sum;
}

VerifyTally VerifiedCell::sum() const {
  VerifyTally all;
  for (const auto& variant : tallies)
    for (const VerifyTally& tally : variant) all += tally;
  return all;
}

void VerifiedCell::add(std::size_t variant, const std::vector<VerifyTally>& by_kind) {
  if (tallies.size() <= variant) tallies.resize(variant + 1, std::vector<VerifyTally>(kHardKindNames.size()));
  VerifyTally all;
  for (std::size_t k = 0; k < by_kind.size(); ++k) tallies[variant][k] += by_kind[k], all += by_kind[k];
  newest = all.first;
}

void verify_all(std::vector<VerifiedCell>& cells, std::size_t variant, StructureShelf& shelf, const VerifyBatch& batch,
                const Company* company) {
  std::map<std::tuple<std::string, std::string, Isa>, std::vector<Hit>> references;
  std::vector<Hit> hits;
  for (VerifiedCell& verified : cells) {
    const Cell& cell = verified.cell;
    auto [reference, fresh] = references.try_emplace({cell.intersector, cell.box, cell.isa});
    const Accel& accel = shelf.get(cell);
    std::vector<VerifyTally> tallies = verify_cell(cell, accel, batch, hits, reference->second);
    if (company && cell.traversal != "single") add_company(cell, accel, batch, *company, tallies);
    verified.add(variant, tallies);
    if (fresh) reference->second = hits;
  }
}

}  // namespace arboretum
