#include "intersectors/precomputed.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/exact/determinant.h"

namespace arboretum {
namespace {

using Vec3d = Triple<double>;

Vec3d to_double(Vec3f p) noexcept { return {p.x, p.y, p.z}; }
Vec3d difference(const Vec3d& a, const Vec3d& b) noexcept { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// The corner 0, the edges from it, and their normal.
struct Frame {
  Vec3d v0, e1, e2, n;
  std::size_t axis;  ///< along which the normal is largest
  explicit Frame(const std::array<Vec3f, 3>& corner) noexcept
      : v0(to_double(corner[0])), e1(difference(to_double(corner[1]), v0)), e2(difference(to_double(corner[2]), v0)),
        n(cross(e1, e2)) {
    const Vec3d size{std::abs(n[0]), std::abs(n[1]), std::abs(n[2])};
    axis = std::size_t(std::max_element(size.begin(), size.end()) - size.begin());
  }
};

/// Rounded to float; all NaN where one is not finite.
template <std::size_t N>
std::array<float, N> rounded(const std::array<double, N>& number) noexcept {
  std::array<float, N> out;
  bool finite = true;
  for (std::size_t i = 0; i < N; ++i) {
    out[i] = static_cast<float>(number[i]);
    finite = finite && std::isfinite(out[i]);
  }
  if (!finite) out.fill(std::numeric_limits<float>::quiet_NaN());
  return out;
}

}  // namespace

ProjectedTriangle projected_triangle(const std::array<Vec3f, 3>& corner) noexcept {
  const Frame f(corner);
  const std::size_t k = f.axis, a = (k + 1) % 3, b = (k + 2) % 3;
  const double r = 1.0 / f.n[k];
  // ((p - v0) x e2)_axis / n_axis is u, (e1 x (p - v0))_axis / n_axis is v.
  const std::array<double, 9> number{f.n[a] * r,   f.n[b] * r,   dot(f.n, f.v0) * r,                           //
                                     f.e2[b] * r,  -f.e2[a] * r, (f.v0[b] * f.e2[a] - f.v0[a] * f.e2[b]) * r,  //
                                     -f.e1[b] * r, f.e1[a] * r,  (f.v0[a] * f.e1[b] - f.v0[b] * f.e1[a]) * r};
  return {rounded(number), std::int32_t(k)};
}

std::array<float, 12> unit_triangle_transform(const std::array<Vec3f, 3>& corner) noexcept {
  const auto [number, axis] = projected_triangle(corner);
  const std::size_t k = std::size_t(axis), a = (k + 1) % 3, b = (k + 2) % 3;
  std::array<float, 12> row{};
  row[a] = number[3], row[b] = number[4], row[3] = number[5];
  row[4 + a] = number[6], row[4 + b] = number[7], row[7] = number[8];
  row[8 + k] = 1.0f, row[8 + a] = number[0], row[8 + b] = number[1], row[11] = -number[2];
  return row;
}

std::array<float, 12> barycentric_planes(const std::array<Vec3f, 3>& corner) noexcept {
  const Frame f(corner);
  const double scale = std::exp2(-std::floor(std::log2(std::abs(f.n[f.axis])))), r = 1.0 / dot(f.n, f.n);
  const Vec3d nu = cross(f.e2, f.n), nv = cross(f.n, f.e1);
  return rounded<12>({f.n[0] * scale, f.n[1] * scale, f.n[2] * scale, dot(f.n, f.v0) * scale,  //
                      nu[0] * r, nu[1] * r, nu[2] * r, -dot(nu, f.v0) * r,                     //
                      nv[0] * r, nv[1] * r, nv[2] * r, -dot(nv, f.v0) * r});
}

}  // namespace arboretum
