// Moeller and Trumbore (JGT 1997), in the factorisation that shares C x d between u and v and divides last (as Kensler
// and Shirley 2006): C = v0 - o, R = C x d, N = (v1 - v0) x (v2 - v0); u = R.e2 / N.d, v = R.e1 / N.d, t = N.C / N.d
// with e1 = v0 - v1 and e2 = v2 - v0. Fast; leaks at shared edges, since the two sides' u and v are different sums.
#pragma once

#include "intersectors/triangle_hits.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// What the test needs of a triangle and a line, in float or double: N, C, N.d, and u and v times N.d.
template <class F>
struct MollerTrumboreTerms {
  vec3<F> n, c;
  F det, u, v;
  ARBORETUM_INLINE MollerTrumboreTerms(vec3<F> v0, vec3<F> e1, vec3<F> e2, vec3<F> o, vec3<F> d)
      : MollerTrumboreTerms(cross(e2, e1), v0 - o) {
    meet(e1, e2, d);
  }
  /// Of a triangle and an origin; meet() does the rest.
  ARBORETUM_INLINE MollerTrumboreTerms(vec3<F> normal, vec3<F> from_origin) : n(normal), c(from_origin) {}
  ARBORETUM_INLINE void meet(vec3<F> e1, vec3<F> e2, vec3<F> d) {
    const vec3<F> r = cross(c, d);
    det = dot(n, d), u = dot(r, e2), v = dot(r, e1);
  }
};

struct MollerTrumbore {
  static constexpr std::string_view kName = "moller_trumbore";
  static constexpr bool reads(TriangleForm form) {
    return form == TriangleForm::edges || form == TriangleForm::vertices || form == TriangleForm::array_of_structures;
  }
  static constexpr bool kEveryLeaf = true;

  using RayData = RayLine;

  /// Lanes whose closed triangle the line meets, whatever t is; `hits` is set only where that is any lane.
  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    using F = vf<Block::kWidth>;
    return core<F>(
        in_all_lanes<Block::kWidth>(ray.origin), in_all_lanes<Block::kWidth>(ray.direction), block,
        [](const float(&p)[Block::kWidth]) { return F::load(p); }, hits);
  }

  /// Four triangles as array of structures: lanes x y z of a group of four are a triangle's, and the operations those
  /// of core() in its order, so that the answers are, too.
  template <class Block>
  requires(Block::kForm == TriangleForm::array_of_structures) static ARBORETUM_INLINE
      auto intersect(const RayData& ray, const Block& block, TriangleHits<4>& hits) {
    const auto in_all_groups = [](Vec3f p) { return repeat_four<16>(four(p.x, p.y, p.z, 0.0f)); };
    const Groups d = in_all_groups(ray.direction), e1 = Groups::load(block.e1[0]), e2 = Groups::load(block.e2[0]);
    const Groups c = Groups::load(block.v0[0]) - in_all_groups(ray.origin);
    const Groups n = cross_in_fours(e2, e1), r = cross_in_fours(c, d);
    return decide(
        dot_in_fours(n, d), dot_in_fours(r, e2), dot_in_fours(r, e1), [&] { return dot_in_fours(n, c); }, hits);
  }

  /// A block as rays of one origin see it: what core() makes of origin and triangle alone, once for all of them. (With
  /// R.e2 written as d.(e2 x C), as is usual for rays of one origin, less would be left for each ray, but it would
  /// round in another way than for rays that go alone.)
  template <int M>
  struct FromOrigin {
    static constexpr int kWidth = M;
    alignas(M * sizeof(float)) float c[3][M], n[3][M], e1[3][M], e2[3][M], n_dot_c[M];
    alignas(M * sizeof(float)) std::uint32_t id[M];

    template <class Block>
    ARBORETUM_INLINE FromOrigin(const Block& block, Vec3f origin) {
      using F = vf<M>;
      const auto store = [](vf3<M> from, float(&to)[3][M]) {
        from.x.store(to[0]), from.y.store(to[1]), from.z.store(to[2]);
      };
      const Corners<F> t = corners(block, [](const float(&p)[M]) { return F::load(p); });
      const MollerTrumboreTerms<F> terms(normal(block, t), t.v0 - in_all_lanes<M>(origin));
      store(terms.c, c), store(terms.n, n), store(t.e1, e1), store(t.e2, e2), dot(terms.n, terms.c).store(n_dot_c);
      std::memcpy(id, block.id, sizeof id);
    }
  };

  /// A block with what core() makes of it alone, its normals, once for all rays that meet it.
  template <class Block>
  struct ForManyRays {
    static constexpr int kWidth = Block::kWidth;
    const Block& block;
    const std::uint32_t (&id)[kWidth];
    vf3<kWidth> n;

    ARBORETUM_INLINE explicit ForManyRays(const Block& b) : block(b), id(b.id) {
      const auto t = corners(b, [](const float(&p)[kWidth]) { return vf<kWidth>::load(p); });
      n = normal(b, t);
    }
  };

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  /// A block of eight in both halves of the lanes, and its normals.
  template <class Block>
  struct ForTwoRays {
    const std::uint32_t (&id)[8];
    vec3<vf<16>> v0, e1, e2, n;

    ARBORETUM_INLINE explicit ForTwoRays(const Block& b) : id(b.id) {
      const auto t = corners(b, [](const float(&p)[8]) { return in_both_halves(vf<8>::load(p)); });
      v0 = t.v0, e1 = t.e1, e2 = t.e2, n = normal(b, t);
    }
  };
  template <class Block>
  static ARBORETUM_INLINE vm<16> intersect_two(const RayData& low, const RayData& high, const ForTwoRays<Block>& block,
                                               TriangleHits<16>& hits) {
    const auto both = [](Vec3f a, Vec3f b) {
      return vf3<16>{in_halves(a.x, b.x), in_halves(a.y, b.y), in_halves(a.z, b.z)};
    };
    MollerTrumboreTerms<vf<16>> terms(block.n, block.v0 - both(low.origin, high.origin));
    terms.meet(block.e1, block.e2, both(low.direction, high.direction));
    return decide(
        terms.det, terms.u, terms.v, [&] { return dot(terms.n, terms.c); }, hits);
  }
#endif

  /// What a packet keeps beside its rays: nothing.
  struct PacketData {
    static constexpr int kGroups = 1;
    void clear() {}
    template <int W>
    void prepare(const PacketRays&, int /*k*/) {}
    [[nodiscard]] std::uint64_t group(int) const { return ~std::uint64_t{0}; }
    /// RayData of ray i.
    [[nodiscard]] ARBORETUM_INLINE RayData alone(const Ray& ray, int /*i*/) const { return RayData(ray); }
  };

  /// Lanes are the W rays from k on, those of `in` against triangle `i` of the block: what intersect() computes, bit
  /// for bit. `again`: rays that must be tested one by one instead; here none.
  template <int W, class Block>
  static ARBORETUM_INLINE unsigned intersect_rays(const PacketRays& rays, const PacketData&, int /*group*/, int k,
                                                  unsigned in, const Block& block, int i, TriangleHits<W>& hits,
                                                  unsigned& again) {
    using F = vf<W>;
    const auto load = [k](const float(&p)[3][PacketRays::kMost]) {
      return vf3<W>{F::load(p[0] + k), F::load(p[1] + k), F::load(p[2] + k)};
    };
    again = 0;
    return in & core<F>(
                    load(rays.origin), load(rays.direction), block,
                    [i](const float(&p)[Block::kWidth]) { return F(p[i]); }, hits)
                    .bits();
  }

 private:
  using Groups = vf<16>;  ///< four vectors x y z 0
  /// dot() of simd/common.h: z first, y added to it, then x.
  static ARBORETUM_INLINE vf<4> dot_in_fours(Groups a, Groups b) {
    const Groups z = a * b, yz = madd(a, b, permute_in_fours<0, 2, 2, 3>(z));
    return first_of_fours(madd(a, b, permute_in_fours<1, 1, 2, 3>(yz)));
  }
  static ARBORETUM_INLINE Groups cross_in_fours(Groups a, Groups b) {
    const auto yzx = [](Groups v) { return permute_in_fours<1, 2, 0, 3>(v); };
    return yzx(msub(a, yzx(b), yzx(a) * b));
  }

  template <class F>
  struct Corners {
    vec3<F> v0, e1, e2;
  };
  /// `get(row)` gives the lanes of a row of the block.
  template <class Get, int M>
  static ARBORETUM_INLINE auto three(const Get& get, const float (&rows)[3][M]) {
    return vec3<decltype(get(rows[0]))>{get(rows[0]), get(rows[1]), get(rows[2])};
  }
  template <class Block, class Get>
  static ARBORETUM_INLINE auto corners(const Block& block, const Get& get) {
    Corners<decltype(get(block.v0[0]))> t{three(get, block.v0), {}, {}};
    if constexpr (Block::kForm == TriangleForm::edges) {
      t.e1 = three(get, block.e1), t.e2 = three(get, block.e2);
    } else {
      t.e1 = t.v0 - three(get, block.v1), t.e2 = three(get, block.v2) - t.v0;
    }
    return t;
  }

  template <class Block, class Get>
  static ARBORETUM_INLINE auto corners(const ForManyRays<Block>& seen, const Get& get) {
    return corners(seen.block, get);
  }

  template <class Block, class F>
  static ARBORETUM_INLINE vec3<F> normal(const Block&, const Corners<F>& t) {
    return cross(t.e2, t.e1);
  }
  template <class Block, class F>
  static ARBORETUM_INLINE vec3<F> normal(const ForManyRays<Block>& seen, const Corners<F>&) {
    return seen.n;
  }

  template <class F, class Block, class Get, class Hits>
  static ARBORETUM_INLINE auto core(vec3<F> o, vec3<F> d, const Block& block, const Get& get, Hits& hits) {
    const Corners<F> t = corners(block, get);
    MollerTrumboreTerms<F> terms(normal(block, t), t.v0 - o);
    terms.meet(t.e1, t.e2, d);
    return decide(
        terms.det, terms.u, terms.v, [&] { return dot(terms.n, terms.c); }, hits);
  }
  template <class F, int M, class Get, class Hits>
  static ARBORETUM_INLINE auto core(vec3<F> /*o*/, vec3<F> d, const FromOrigin<M>& block, const Get& get, Hits& hits) {
    MollerTrumboreTerms<F> terms(three(get, block.n), three(get, block.c));
    terms.meet(three(get, block.e1), three(get, block.e2), d);
    return decide(
        terms.det, terms.u, terms.v, [&] { return get(block.n_dot_c); }, hits);
  }

  /// Of N.d and u and v times N.d.
  template <class F, class Distance, class Hits>
  static ARBORETUM_INLINE auto decide(F det, F u_det, F v_det, const Distance& n_dot_c, Hits& hits) {
    const F abs_det = abs(det);
    const auto sign = sign_bits(det);
    const F u = xor_sign(u_det, sign), v = xor_sign(v_det, sign);
    const auto inside = (u >= F(0.0f)) & (v >= F(0.0f)) & (u + v <= abs_det) & (det != F(0.0f));
    if (any(inside)) {
      hits.t = xor_sign(n_dot_c(), sign) / abs_det;
      hits.u_numerator = u, hits.v_numerator = v, hits.denominator = abs_det;
    }
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
