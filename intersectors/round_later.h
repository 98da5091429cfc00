// The last hits of several rays of `exact`, rounded together with the rays in lanes: a third of the instructions of one
// after the other, and no ray waits for its own. The operations of round_in_double.h on each ray, in the same order, so
// the same bits.
#pragma once

#include "intersectors/round_in_double.h"
#include "simd/double.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

#if ARBORETUM_TARGET != ARBORETUM_TARGET_SCALAR

/// Hits that wait, a Hit or a NearestHit each. A ray and its hit stay where they are until finish_all().
template <class H>
class UnroundedHits {
  static constexpr int kLanes = kDoubleLanes<8>;
  using D = vd<kLanes>;

 public:
  /// The hit of `ray`, in the triangle of these corners; settle() says where it is.
  ARBORETUM_INLINE void add(const Ray& ray, const CornersInFours& corners) {
    ray_[count_] = &ray;
    for (int k = 0; k < 3; ++k) _mm_store_ps(corners_[k][count_], _mm_load_ps(corners.at[k]));
  }
  ARBORETUM_INLINE void settle(H& hit) {
    hit_[count_] = &hit;
    if (++count_ == kLanes) round_all();
  }
  void finish_all() {
    if (count_ == 0) return;
    const int used = count_;
    for (int i = used; i < kLanes; ++i) {  // the lanes left hold the first once more
      ray_[i] = ray_[0], hit_[i] = hit_[0];
      for (int k = 0; k < 3; ++k) _mm_store_ps(corners_[k][i], _mm_load_ps(corners_[k][0]));
    }
    count_ = used;
    round_all();
  }

 private:
  static ARBORETUM_INLINE vd3<kLanes> cross(vd3<kLanes> a, vd3<kLanes> b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
  static ARBORETUM_INLINE D dot(vd3<kLanes> a, vd3<kLanes> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
  static ARBORETUM_INLINE D size_of(vd3<kLanes> a) { return max_x86(max_x86(abs(a.x), abs(a.y)), abs(a.z)); }

  /// The x of four vectors from number `first` on, their y, their z.
  template <class At>
  static ARBORETUM_INLINE vf3<4> four_from(int first, const At& at) {
    vf<4> row[4] = {vf<4>::load(at(first)), vf<4>::load(at(first + 1)), vf<4>::load(at(first + 2)),
                    vf<4>::load(at(first + 3))};
    transpose(row);
    return {row[0], row[1], row[2]};
  }
  /// x, y and z of a vector of each ray, in doubles. `at(i)`: where that of ray i lies.
  template <class At>
  static ARBORETUM_INLINE vd3<kLanes> gather(const At& at) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    const __m128 p = _mm_loadu_ps(at(0)), q = _mm_loadu_ps(at(1)), xy = _mm_unpacklo_ps(p, q);
    return {D(_mm_cvtps_pd(xy)), D(_mm_cvtps_pd(_mm_movehl_ps(xy, xy))), D(_mm_cvtps_pd(_mm_unpackhi_ps(p, q)))};
#else
    const vf3<4> first = four_from(0, at);
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
    return {D(_mm256_cvtps_pd(first.x.v)), D(_mm256_cvtps_pd(first.y.v)), D(_mm256_cvtps_pd(first.z.v))};
#else
    const vf3<4> last = four_from(4, at);
    const auto widened = [](vf<4> a, vf<4> b) { return D(_mm512_cvtps_pd(_mm256_set_m128(b.v, a.v))); };
    return {widened(first.x, last.x), widened(first.y, last.y), widened(first.z, last.z)};
#endif
#endif
  }

  __attribute__((noinline)) void round_all() {
    count_ = 0;
    const auto corner = [&](int k) { return gather([&](int i) { return corners_[k][i]; }); };
    const vd3<kLanes> a = corner(0), e1 = corner(1) - a, e2 = corner(2) - a;
    const vd3<kLanes> d = gather([&](int i) { return &ray_[i]->direction.x; }),
                      s = gather([&](int i) { return &ray_[i]->origin.x; }) - a;
    const vd3<kLanes> p = cross(d, e2), q = cross(s, e1);
    const D det = dot(e1, p);
    const D size_1 = size_of(e1), size_2 = size_of(e2), size_d = size_of(d), size_s = size_of(s);
    const D inverse = D(1.0) / det, t = dot(e2, q) * inverse,
            scale = abs(D(double_bounds::kDeterminant * double_bounds::kQuotient) * inverse);
    const D det_error = scale * size_1 * size_2 * size_d;
    const D radius = scale * size_1 * size_2 * size_s + abs(t) * (det_error + D(double_bounds::kRounding));
    const D weight_radius = scale * size_d * size_s * max_x86(size_1, size_2) + det_error + D(double_bounds::kRounding);
    const auto weight = [](D w) { return min_x86(max_x86(w, D(0.0)), D(1.0)); };
    float low[kLanes], high[kLanes], u[kLanes], v[kLanes];
    (t - radius).store(low), (t + radius).store(high), weight(dot(s, p) * inverse).store(u),
        weight(dot(d, q) * inverse).store(v);
    // Comparisons that a NaN makes false.
    const unsigned bounded =
        (det_error < D(double_bounds::kMostOfDivisor)) & (weight_radius < D(double_bounds::kWeight));
    for (int i = 0; i < kLanes; ++i) {
      RoundedHit hit{low[i] + 0.0f, u[i], v[i]};  // of zeros the one without a sign
      if (__builtin_expect((bounded >> i & 1u) == 0 || low[i] != high[i], 0)) hit = exactly(i);
      hit_[i]->t = hit.t, hit_[i]->u = hit.u, hit_[i]->v = hit.v;
    }
  }
  [[nodiscard]] __attribute__((noinline)) RoundedHit exactly(int i) const {
    const auto corner = [&](int k) { return Vec3f{corners_[k][i][0], corners_[k][i][1], corners_[k][i][2]}; };
    return round_exactly({ray_[i]->origin, 0.0f, ray_[i]->direction, hit_[i]->t}, {corner(0), corner(1), corner(2)});
  }

  int count_ = 0;
  const Ray* ray_[kLanes];
  H* hit_[kLanes];
  alignas(16) float corners_[3][kLanes][4];
};

#endif

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
