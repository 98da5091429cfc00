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
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = true;

  /// kz: the axis along which the direction is largest. Shear constants dx/dz, dy/dz, 1/dz of the permuted direction.
  struct RayData {
    float ox, oy, oz, sx, sy, sz;
    float dx, dy, dz, tnear;
    int kx, ky, kz;
    ARBORETUM_INLINE explicit RayData(const Ray& ray) : RayData(ray, largest_axis(ray.direction)) { sx = dx / dz, sy = dy / dz, sz = 1.0f / dz; }
    /// With shear constants known.
    ARBORETUM_INLINE RayData(const Ray& ray, int axis, float shear_x, float shear_y, float shear_z) : RayData(ray, axis) { sx = shear_x, sy = shear_y, sz = shear_z; }

   private:
    ARBORETUM_INLINE RayData(const Ray& ray, int axis) : tnear(ray.tnear), kz(axis) {
      kx = kz == 2 ? 0 : kz + 1;
      ky = kx == 2 ? 0 : kx + 1;
      const float* o = &ray.origin.x;
      const float* d = &ray.direction.x;
      ox = o[kx], oy = o[ky], oz = o[kz];
      dx = d[kx], dy = d[ky], dz = d[kz];
    }
    static ARBORETUM_INLINE int largest_axis(Vec3f d) {
      const float ax = __builtin_fabsf(d.x), ay = __builtin_fabsf(d.y), az = __builtin_fabsf(d.z);
      return ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
    }
  };

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const Sheared<W> s = sheared(ray, block);
    vm<W> inside = s.inside();
    if (any(inside)) {
      const vm<W> undecided = s.hits(inside, F(ray.sz), hits);
      // What the rare functions are handed is read from memory again, and copied: a reference to the vectors here would keep all of them in memory.
      if (__builtin_expect(any(undecided), 0)) {
        TriangleHits<W> decided = hits;
        inside = (inside & ~undecided) | decide_in_double(undecided, ray, block, decided);
        hits = decided;
      }
      const vm<W> near = inside & s.near(F(ray.tnear), F(ray.sz), hits.t);
      if (__builtin_expect(any(near), 0)) hits.t = plane_distance_in_double(near, ray, block, hits.t);
    }
    return inside;
  }

  /// What a packet keeps beside its rays: their shears. Those of a group have the same kz.
  struct PacketData {
    static constexpr int kGroups = 3;
    alignas(64) float sx[PacketRays::kMost], sy[PacketRays::kMost], sz[PacketRays::kMost];
    std::uint64_t of_axis[3];

    void clear() { of_axis[0] = of_axis[1] = of_axis[2] = 0; }
    /// The W rays from k on: what RayData computes for one.
    template <int W>
    ARBORETUM_INLINE void prepare(const PacketRays& rays, int k) {
      using F = vf<W>;
      const F x = F::load(rays.direction[0] + k), y = F::load(rays.direction[1] + k), z = F::load(rays.direction[2] + k);
      const F ax = abs(x), ay = abs(y), az = abs(z);
      const vm<W> by_x = (ax > ay) & (ax > az), by_y = ~(ax > ay) & (ay > az);
      const F dz = select(by_x, x, select(by_y, y, z));
      (select(by_x, y, select(by_y, z, x)) / dz).store(sx + k);
      (select(by_x, z, select(by_y, x, y)) / dz).store(sy + k);
      (F(1.0f) / dz).store(sz + k);
      of_axis[0] |= std::uint64_t(by_x.bits()) << k, of_axis[1] |= std::uint64_t(by_y.bits()) << k, of_axis[2] |= std::uint64_t((~(by_x | by_y)).bits()) << k;
    }
    [[nodiscard]] std::uint64_t group(int kz) const { return of_axis[kz]; }
    /// RayData of ray i.
    [[nodiscard]] ARBORETUM_INLINE RayData alone(const Ray& ray, int i) const {
      return RayData(ray, of_axis[0] >> i & 1u ? 0 : of_axis[1] >> i & 1u ? 1 : 2, sx[i], sy[i], sz[i]);
    }
  };

  /// Lanes are the W rays from k on, all against triangle `i` of the block: what intersect() computes, bit for bit. `again`: rays for which
  /// doubles must decide, to be tested one by one.
  template <int W, class Block>
  static ARBORETUM_INLINE vm<W> intersect_rays(const PacketRays& rays, const PacketData& shears, int kz, int k, const Block& block, int i, TriangleHits<W>& hits, vm<W>& again) {
    using F = vf<W>;
    const int kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    const auto all = [&](const float(&p)[3][Block::kWidth]) { return vf3<W>{F(p[kx][i]), F(p[ky][i]), F(p[kz][i])}; };
    const auto origin = [&](int axis) { return F::load(rays.origin[axis] + k); };
    const Sheared<W> s({origin(kx), origin(ky), origin(kz)}, F::load(shears.sx + k), F::load(shears.sy + k), all(block.v0), all(block.v1), all(block.v2));
    const vm<W> inside = s.inside();
    again = vm<W>(false);
    if (any(inside)) {
      const F sz = F::load(shears.sz + k);
      const vm<W> undecided = s.hits(inside, sz, hits);
      again = undecided | (inside & s.near(F::load(rays.tnear + k), sz, hits.t));
    }
    return inside & ~again;
  }

 private:
  /// Triangles in the frame of their rays: x and y sheared so that the ray is the z axis, z along it.
  template <int W>
  struct Sheared {
    using F = vf<W>;
    vf3<W> a, b, c;
    F u0, u1, v0, v1, w0, w1;

    ARBORETUM_INLINE Sheared(vf3<W> o, F sx, F sy, vf3<W> p0, vf3<W> p1, vf3<W> p2) {
      const auto shear = [&](vf3<W> p) {
        const F z = p.z - o.z;
        return vf3<W>{nmadd(sx, z, p.x - o.x), nmadd(sy, z, p.y - o.y), z};
      };
      a = shear(p0), b = shear(p1), c = shear(p2);
      u0 = c.x * b.y, u1 = c.y * b.x, v0 = a.x * c.y, v1 = a.y * c.x, w0 = b.x * a.y, w1 = b.y * a.x;
    }
    ARBORETUM_INLINE vm<W> inside() const { return ((u0 >= u1) & (v0 >= v1) & (w0 >= w1)) | ((u0 <= u1) & (v0 <= v1) & (w0 <= w1)); }

    /// Sets the hits; returns those of `inside` in which a tie must be decided in double.
    ARBORETUM_INLINE vm<W> hits(vm<W> inside, F sz, TriangleHits<W>& out) const {
      const F u = u0 - u1, v = v0 - v1, w = w0 - w1;
      const F det = u + v + w;
      out.t = (u * (sz * a.z) + v * (sz * b.z) + w * (sz * c.z)) / det;
      out.u_numerator = v, out.v_numerator = w, out.denominator = det;
      return inside & ((u == F(0.0f)) | (v == F(0.0f)) | (w == F(0.0f)));
    }

    /// Lanes whose t must be computed again in double.
    ARBORETUM_INLINE vm<W> near(F tnear, F sz, F t) const {
      const F det = (u0 - u1) + (v0 - v1) + (w0 - w1);
      const F depth = max_x86(max_x86(abs(a.z), abs(b.z)), abs(c.z));
      const F width = max_x86(max_x86(max_x86(abs(a.x), abs(a.y)), max_x86(abs(b.x), abs(b.y))), max_x86(abs(c.x), abs(c.y)));
      const F reach = depth * abs(sz);
      const F beyond = (t - tnear) * abs(det), error = F(0x1p-18f) * reach * (width * (depth + width));
      return (beyond >= -error) & ((t <= F(0x1p-10f) * reach) | (beyond <= error));
    }
  };

  template <class Block>
  static ARBORETUM_INLINE Sheared<Block::kWidth> sheared(const RayData& ray, const Block& block) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const auto load = [&](const float(&p)[3][W]) { return vf3<W>{F::load(p[ray.kx]), F::load(p[ray.ky]), F::load(p[ray.kz])}; };
    return Sheared<W>({F(ray.ox), F(ray.oy), F(ray.oz)}, F(ray.sx), F(ray.sy), load(block.v0), load(block.v1), load(block.v2));
  }

  /// The lanes of `undecided` that are hit when the edge functions are computed in double; sets their hits.
  template <class Block>
  static __attribute__((noinline)) vm<Block::kWidth> decide_in_double(vm<Block::kWidth> undecided, const RayData& ray, const Block& block,
                                                                      TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    const Sheared<W> s = sheared(ray, block);
    float p[9][W], out[4][W];
    const vf<W> in[9] = {s.a.x, s.a.y, s.a.z, s.b.x, s.b.y, s.b.z, s.c.x, s.c.y, s.c.z};
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
      out[0][i] = float((u * p[2][i] + v * p[5][i] + w * p[8][i]) / det * ray.sz);
      out[1][i] = float(v / det), out[2][i] = float(w / det), out[3][i] = 1.0f;
    }
    hits = {vf<W>::load(out[0]), vf<W>::load(out[1]), vf<W>::load(out[2]), vf<W>::load(out[3])};
    return vm<W>::from_bits(hit);
  }

  /// `distances`, in `lanes` N.(a - o) / N.d, computed in double.
  template <class Block>
  static __attribute__((noinline)) vf<Block::kWidth> plane_distance_in_double(vm<Block::kWidth> lanes, const RayData& ray, const Block& block, vf<Block::kWidth> distances) {
    constexpr int W = Block::kWidth;
    float t[W];
    distances.store(t);
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
    return vf<W>::load(t);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
