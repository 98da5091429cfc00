// Watertight ray/triangle intersection (Woop, Benthin, Wald, JCGT 2(1) 2013), with each edge decided by comparing its
// two rounded products instead of looking at the sign of their difference.
//
// Every vertex is translated, permuted and sheared once per (ray, vertex), alike in all triangles that share it, so the
// rounded 2-D mesh stays closed; rounding is monotone, so an exact Cx*By > Cy*Bx is never computed as <, and a tie is
// inside on both sides. No contraction can break it (comparisons do not fuse); the shear may fuse, being one expression
// for every vertex. A tie may be rounding alone, and then a triangle far beside the ray would be taken for hit (small
// triangles seen from a great distance): in lanes that pass with a tie, double products, exact for float inputs, decide,
// as in the paper.
//
// t is a mean of the vertices' depths, so its error grows with their distance, not with t: beside a large triangle a ray
// that starts on it could meet it again. With L = max |x|, |y| and Z = max |z| of the sheared vertices, t is off by less than
// some 164 u Z |1/dz| L (Z + L) / |det| (the edge functions by 12.5 u L (Z + L)); in tests by no more than a third of that.
// Where that, with 64 u for 164 u, could turn t across tnear, and where t is below 2^-10 of the depth and so inaccurate
// itself, t is computed again from the triangle's plane, in double, and kept between the nearest and the farthest corner: a triangle
// that is met only because its corners are rounded, edge on, has its plane anywhere along the ray, and must close the surface all
// the same. What lies clearly before tnear, as the triangle that a ray has just left, is not.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct Watertight {
  static constexpr std::string_view kName = "watertight";
  static constexpr bool kNeedsVertices = true;
  static constexpr bool kEveryLeaf = true;

  /// kz: the axis along which the direction is largest. Shear constants dx/dz, dy/dz, 1/dz of the permuted direction.
  struct RayData {
    float ox, oy, oz, sx, sy, sz;
    float dx, dy, dz, tnear;
    int kx, ky, kz;
    ARBORETUM_INLINE explicit RayData(const Ray& ray) : tnear(ray.tnear) {
      const float ax = __builtin_fabsf(ray.direction.x), ay = __builtin_fabsf(ray.direction.y), az = __builtin_fabsf(ray.direction.z);
      kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
      kx = kz == 2 ? 0 : kz + 1;
      ky = kx == 2 ? 0 : kx + 1;
      const float* o = &ray.origin.x;
      const float* d = &ray.direction.x;
      ox = o[kx], oy = o[ky], oz = o[kz];
      dx = d[kx], dy = d[ky], dz = d[kz];
      sx = dx / dz, sy = dy / dz, sz = 1.0f / dz;
    }
  };

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const F ox(ray.ox), oy(ray.oy), oz(ray.oz), sx(ray.sx), sy(ray.sy);
    const F az = F::load(block.v0[ray.kz]) - oz, bz = F::load(block.v1[ray.kz]) - oz, cz = F::load(block.v2[ray.kz]) - oz;
    const F ax = nmadd(sx, az, F::load(block.v0[ray.kx]) - ox), ay = nmadd(sy, az, F::load(block.v0[ray.ky]) - oy);
    const F bx = nmadd(sx, bz, F::load(block.v1[ray.kx]) - ox), by = nmadd(sy, bz, F::load(block.v1[ray.ky]) - oy);
    const F cx = nmadd(sx, cz, F::load(block.v2[ray.kx]) - ox), cy = nmadd(sy, cz, F::load(block.v2[ray.ky]) - oy);
    const F u0 = cx * by, u1 = cy * bx, v0 = ax * cy, v1 = ay * cx, w0 = bx * ay, w1 = by * ax;
    vm<W> inside = ((u0 >= u1) & (v0 >= v1) & (w0 >= w1)) | ((u0 <= u1) & (v0 <= v1) & (w0 <= w1));
    if (any(inside)) {
      const F u = u0 - u1, v = v0 - v1, w = w0 - w1;
      const F det = u + v + w;
      const F sz(ray.sz);
      hits.t = (u * (sz * az) + v * (sz * bz) + w * (sz * cz)) / det;
      hits.u_numerator = v, hits.v_numerator = w, hits.denominator = det;
      const vm<W> undecided = inside & ((u == F(0.0f)) | (v == F(0.0f)) | (w == F(0.0f)));
      if (__builtin_expect(any(undecided), 0)) {
        inside = inside & ~undecided;
        inside = inside | decide_in_double<W>(undecided, ray.sz, {ax, ay, az}, {bx, by, bz}, {cx, cy, cz}, hits);
      }
      const F depth = max_x86(max_x86(abs(az), abs(bz)), abs(cz));
      const F width = max_x86(max_x86(max_x86(abs(ax), abs(ay)), max_x86(abs(bx), abs(by))), max_x86(abs(cx), abs(cy)));
      const F reach = depth * F(__builtin_fabsf(ray.sz));
      const F beyond = (hits.t - F(ray.tnear)) * abs(det), error = F(0x1p-18f) * reach * (width * (depth + width));
      const vm<W> near = inside & (beyond >= -error) & ((hits.t <= F(0x1p-10f) * reach) | (beyond <= error));
      if (__builtin_expect(any(near), 0)) plane_distance_in_double(near, ray, block, hits);
    }
    return inside;
  }

 private:
  /// The lanes of `undecided` that are hit when the edge functions are computed in double; sets their hits.
  template <int W>
  static __attribute__((noinline)) vm<W> decide_in_double(vm<W> undecided, float sz, const vf3<W>& a, const vf3<W>& b,
                                                          const vf3<W>& c, TriangleHits<W>& hits) {
    float p[9][W], out[4][W];
    const vf<W> in[9] = {a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z};
    for (int i = 0; i < 9; ++i) in[i].store(p[i]);
    hits.t.store(out[0]), hits.u_numerator.store(out[1]), hits.v_numerator.store(out[2]), hits.denominator.store(out[3]);
    unsigned hit = 0;
    for (unsigned rest = undecided.bits(); rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      const double u = double(p[6][i]) * p[4][i] - double(p[7][i]) * p[3][i];
      const double v = double(p[0][i]) * p[7][i] - double(p[1][i]) * p[6][i];
      const double w = double(p[3][i]) * p[1][i] - double(p[4][i]) * p[0][i];
      const double det = u + v + w;
      const bool one_side = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
      if (!one_side || det == 0) continue;
      hit |= 1u << i;
      out[0][i] = float((u * p[2][i] + v * p[5][i] + w * p[8][i]) / det * sz);
      out[1][i] = float(v / det), out[2][i] = float(w / det), out[3][i] = 1.0f;
    }
    hits = {vf<W>::load(out[0]), vf<W>::load(out[1]), vf<W>::load(out[2]), vf<W>::load(out[3])};
    return vm<W>::from_bits(hit);
  }

  /// Sets t of `lanes` to N.(a - o) / N.d, computed in double.
  template <class Block>
  static __attribute__((noinline)) void plane_distance_in_double(vm<Block::kWidth> lanes, const RayData& ray, const Block& block,
                                                                 TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    float t[W];
    hits.t.store(t);
    const int k[3] = {ray.kx, ray.ky, ray.kz};
    const double o[3] = {ray.ox, ray.oy, ray.oz}, d[3] = {ray.dx, ray.dy, ray.dz};
    for (unsigned rest = lanes.bits(); rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      double a[3], e1[3], e2[3], least = __builtin_inf(), most = -least;
      for (int j = 0; j < 3; ++j) {
        const double v0 = block.v0[k[j]][i];
        a[j] = v0 - o[j], e1[j] = block.v1[k[j]][i] - v0, e2[j] = block.v2[k[j]][i] - v0;
      }
      const double depths[3] = {a[2], a[2] + e1[2], a[2] + e2[2]};
      for (const double depth : depths) {
        const double at = depth / d[2];
        least = at < least ? at : least, most = at > most ? at : most;
      }
      const double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]};
      const double along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
      if (along == 0) continue;
      const double plane = (n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) / along;
      t[i] = float(plane < least ? least : plane > most ? most : plane);
    }
    hits.t = vf<W>::load(t);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
