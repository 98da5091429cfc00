// Rounding the last hit of `exact`, one ray at a time with x, y and z in lanes: core/exact/hit_arithmetic.cpp has the
// formulas and their bounds, with pairs of doubles for machines without AVX. The same operations in the same order
// here, so the same bits.
#pragma once

#include "core/exact/double_bounds.h"
#include "core/exact/hit_arithmetic.h"
#include "intersectors/leaf_block.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Three corners, each x y z and a number that means nothing, so that one load takes a corner.
struct CornersInFours {
  alignas(16) float at[3][4];

  CornersInFours() = default;
  /// Those of lane i of a block of vertices.
  template <class Block>
  ARBORETUM_INLINE CornersInFours(const Block& block, int i) {
    put(0, block.v0[0][i], block.v0[1][i], block.v0[2][i]);
    put(1, block.v1[0][i], block.v1[1][i], block.v1[2][i]);
    put(2, block.v2[0][i], block.v2[1][i], block.v2[2][i]);
  }
  /// row(0) to row(8): x, y and z of the first corner, then of the others.
  template <class Row>
  static ARBORETUM_INLINE CornersInFours of_rows(const Row& row) {
    CornersInFours corners;
    for (int k = 0; k < 3; ++k) corners.put(k, row(3 * k), row(3 * k + 1), row(3 * k + 2));
    return corners;
  }
  explicit CornersInFours(const std::array<Vec3f, 3>& corners) {
    for (int k = 0; k < 3; ++k) put(k, corners[std::size_t(k)].x, corners[std::size_t(k)].y, corners[std::size_t(k)].z);
  }
  [[nodiscard]] std::array<Vec3f, 3> corners() const {
    return {Vec3f{at[0][0], at[0][1], at[0][2]}, Vec3f{at[1][0], at[1][1], at[1][2]},
            Vec3f{at[2][0], at[2][1], at[2][2]}};
  }

 private:
  /// As one vector: a later load that is wider than the stores before it would wait for them.
  ARBORETUM_INLINE void put(int k, float x, float y, float z) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    at[k][0] = x, at[k][1] = y, at[k][2] = z, at[k][3] = 0.0f;
#else
    _mm_store_ps(at[k], _mm_setr_ps(x, y, z, 0.0f));
#endif
  }
};

#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2

/// Vectors x y z and a number that means nothing.
namespace in_fours {
ARBORETUM_INLINE __m256d yzx(__m256d p) { return _mm256_permute4x64_pd(p, 1 | 2 << 2 | 0 << 4 | 3 << 6); }
ARBORETUM_INLINE __m256d cross(__m256d p, __m256d q) {
  return yzx(_mm256_sub_pd(_mm256_mul_pd(p, yzx(q)), _mm256_mul_pd(yzx(p), q)));
}
ARBORETUM_INLINE __m256d sizes(__m256d p) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), p); }
/// The x of p q r s, their y, their z.
struct Transposed {
  __m256d x, y, z;
  ARBORETUM_INLINE Transposed(__m256d p, __m256d q, __m256d r, __m256d s) {
    const __m256d xz01 = _mm256_unpacklo_pd(p, q), xz23 = _mm256_unpacklo_pd(r, s);
    x = _mm256_permute2f128_pd(xz01, xz23, 0x20), z = _mm256_permute2f128_pd(xz01, xz23, 0x31);
    y = _mm256_permute2f128_pd(_mm256_unpackhi_pd(p, q), _mm256_unpackhi_pd(r, s), 0x20);
  }
};
ARBORETUM_INLINE double low(__m128d x) { return _mm_cvtsd_f64(x); }
ARBORETUM_INLINE double high(__m128d x) { return _mm_cvtsd_f64(_mm_unpackhi_pd(x, x)); }
}  // namespace in_fours

/// False where doubles leave t undecided, or u and v off by more than 2^-30; then `hit` means nothing.
ARBORETUM_INLINE bool round_in_double(Vec3f origin, Vec3f direction, const CornersInFours& corners, RoundedHit& hit) {
  using namespace in_fours;
  const __m256d a = _mm256_cvtps_pd(_mm_load_ps(corners.at[0]));
  const __m256d e1 = _mm256_sub_pd(_mm256_cvtps_pd(_mm_load_ps(corners.at[1])), a),
                e2 = _mm256_sub_pd(_mm256_cvtps_pd(_mm_load_ps(corners.at[2])), a);
  const __m256d d = _mm256_cvtps_pd(_mm_setr_ps(direction.x, direction.y, direction.z, 0.0f));
  const __m256d s = _mm256_sub_pd(_mm256_cvtps_pd(_mm_setr_ps(origin.x, origin.y, origin.z, 0.0f)), a);
  const __m256d p = cross(d, e2), q = cross(s, e1);
  const Transposed products(_mm256_mul_pd(e1, p), _mm256_mul_pd(e2, q), _mm256_mul_pd(s, p), _mm256_mul_pd(d, q));
  const __m256d dots = _mm256_add_pd(_mm256_add_pd(products.x, products.y), products.z);  // det, t, u, v
  const Transposed absolute(in_fours::sizes(e1), in_fours::sizes(e2), in_fours::sizes(d), in_fours::sizes(s));
  const __m256d largest = _mm256_max_pd(_mm256_max_pd(absolute.x, absolute.y), absolute.z);
  const __m256d det = _mm256_permute4x64_pd(dots, 0);
  const __m256d quotients =
      _mm256_mul_pd(_mm256_blend_pd(dots, _mm256_set1_pd(double_bounds::kDeterminant * double_bounds::kQuotient), 1),
                    _mm256_div_pd(_mm256_set1_pd(1.0), det));
  const __m128d scale_t = _mm256_castpd256_pd128(quotients), uv = _mm256_extractf128_pd(quotients, 1);
  const __m128d size_e = _mm256_castpd256_pd128(largest), size_ds = _mm256_extractf128_pd(largest, 1);
  const double t = high(scale_t), scale = __builtin_fabs(low(scale_t)), size_1 = low(size_e), size_2 = high(size_e),
               size_d = low(size_ds), size_s = high(size_ds);
  const double det_error = scale * size_1 * size_2 * size_d;
  const double radius = scale * size_1 * size_2 * size_s + __builtin_fabs(t) * (det_error + double_bounds::kRounding);
  const double weight_radius =
      scale * size_d * size_s * (size_1 > size_2 ? size_1 : size_2) + det_error + double_bounds::kRounding;
  hit.t = float(t - radius) + 0.0f;  // of zeros the one without a sign
  // Comparisons that a NaN makes false.
  if (!(det_error < double_bounds::kMostOfDivisor && weight_radius < double_bounds::kWeight &&
        hit.t == float(t + radius)))
    return false;
  const __m128 weights = _mm_cvtpd_ps(_mm_min_pd(_mm_max_pd(uv, _mm_setzero_pd()), _mm_set1_pd(1.0)));
  hit.u = _mm_cvtss_f32(weights), hit.v = _mm_cvtss_f32(_mm_movehdup_ps(weights));
  return true;
}

#else

ARBORETUM_INLINE bool round_in_double(Vec3f, Vec3f, const CornersInFours&, RoundedHit&) { return false; }

#endif

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
