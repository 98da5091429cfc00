// Included between simd/target_begin.h and simd/target_end.h by tests/simd/<isa>.cpp.
#pragma once

#include "simd/lane_order.h"
#include "simd/simd.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace test {

using Bits = std::uint32_t;

template <int W>
ARBORETUM_INLINE vf<W> f(const Bits* p) {
  return vf<W>::load(p);
}
template <int W>
ARBORETUM_INLINE vi<W> n(const Bits* p) {
  return vi<W>::load(p);
}
/// A mask of the lowest bits of W patterns.
template <int W>
ARBORETUM_INLINE vm<W> m(const Bits* p) {
  return (vi<W>::load(p) & vi<W>(1)) == vi<W>(1);
}
template <int W>
ARBORETUM_INLINE void put(vf<W> x, Bits* out) {
  x.store(out);
}
template <int W>
ARBORETUM_INLINE void put(vi<W> x, Bits* out) {
  x.store(out);
}
template <int W>
ARBORETUM_INLINE void put(vm<W> x, Bits* out) {
  for (int i = 0; i < W; ++i) out[i] = x.bits() >> i & 1u;
}

// Plain C++ in a kernel unit: must not be contracted either.
template <int W>
inline void scalar_mul_sub(const Bits* a, const Bits* b, const Bits* c, Bits* out) {
  for (int i = 0; i < W; ++i) {
    float x, y, z;
    std::memcpy(&x, a + i, 4), std::memcpy(&y, b + i, 4), std::memcpy(&z, c + i, 4);
    const float r = x * y - z;
    std::memcpy(out + i, &r, 4);
  }
}

/// Of the rows a, b, c, a (four lanes each) as columns that with the number c[0] mod 4; 0 in other lanes.
template <int W>
inline void transposed_row(const Bits* a, const Bits* b, const Bits* c, Bits* out) {
  vf<4> row[4] = {f<4>(a), f<4>(b), f<4>(c), f<4>(a)};
  transpose(row);
  for (int i = 0; i < W; ++i) out[i] = 0;
  put<4>(row[c[0] & 3u], out);
}
/// Of 64 bytes, the first W words of `a` again and again, those with bit c[0] mod 8: two words of bits, then 0.
template <int W>
inline void bytes_with_bit(const Bits* a, const Bits*, const Bits* c, Bits* out) {
  std::uint8_t bytes[64];
  for (int i = 0; i < 64; i += 4 * W) std::memcpy(bytes + i, a, 4 * W);
  const std::uint64_t with = SixtyFourBytes(bytes).with_bit(int(c[0] & 7u));
  for (int i = 0; i < W; ++i) out[i] = i < 2 ? Bits(with >> (32 * i)) : 0;
}

// simd/lane_order.h, for widths that it has.
template <int W>
inline void compress_bits(const Bits* a, const Bits*, const Bits* c, Bits* out) {
  if constexpr (kOrdersLanes<W>) put<W>(compress(m<W>(c).bits(), n<W>(a)), out);
}
template <int W>
inline void permute_lanes(const Bits* a, const Bits* b, const Bits*, Bits* out) {
  if constexpr (kOrdersLanes<W>) put<W>(permute(n<W>(a), n<W>(b) & vi<W>(W - 1)), out);
}
template <int W>
inline void or_in_lanes(const Bits* a, const Bits* b, const Bits* c, Bits* out) {
  if constexpr (kOrdersLanes<W>) put<W>(or_where(m<W>(c), n<W>(a), n<W>(b)), out);
}
template <int W>
inline void sort_lanes_down(const Bits* a, const Bits*, const Bits*, Bits* out) {
  if constexpr (kOrdersLanes<W>) put<W>(sort_down(n<W>(a)), out);
}
/// Of `a` without signs the first c[0] mod (W + 1) lanes, and zeros.
template <int W>
inline void sort_first_lanes_down(const Bits* a, const Bits*, const Bits* c, Bits* out) {
  if constexpr (kOrdersLanes<W>) {
    const unsigned count = c[0] % unsigned(W + 1);
    put<W>(sort_first_down(select(vi<W>::iota() < vi<W>(std::int32_t(count)), n<W>(a) & vi<W>(0x7fffffff), vi<W>(0)),
                           count),
           out);
  }
}

#define OP(name, expression)                                           \
  {                                                                    \
    name, [](const Bits* a, const Bits* b, const Bits* c, Bits* out) { \
      (void)a, (void)b, (void)c;                                       \
      put<W>(expression, out);                                         \
    }                                                                  \
  }

template <int W>
inline constexpr simd_test::Operation kOperations[] = {
    OP("add", f<W>(a) + f<W>(b)),
    OP("sub", f<W>(a) - f<W>(b)),
    OP("mul", f<W>(a) * f<W>(b)),
    OP("div", f<W>(a) / f<W>(b)),
    OP("negate", -f<W>(a)),
    OP("abs", abs(f<W>(a))),
    OP("sign_bits", sign_bits(f<W>(a))),
    OP("xor_sign", xor_sign(f<W>(a), sign_bits(f<W>(b)))),
    OP("min_x86", min_x86(f<W>(a), f<W>(b))),
    OP("max_x86", max_x86(f<W>(a), f<W>(b))),
    OP("madd", madd(f<W>(a), f<W>(b), f<W>(c))),
    OP("msub", msub(f<W>(a), f<W>(b), f<W>(c))),
    OP("nmadd", nmadd(f<W>(a), f<W>(b), f<W>(c))),
    OP("unfused_mul_sub", f<W>(a) * f<W>(b) - f<W>(c)),
    OP("unfused_mul_add", f<W>(a) * f<W>(b) + f<W>(c)),
    {"scalar_mul_sub", &scalar_mul_sub<W>},
    {"transposed_row", &transposed_row<W>},
    {"bytes_with_bit", &bytes_with_bit<W>},
    OP("less", f<W>(a) < f<W>(b)),
    OP("less_equal", f<W>(a) <= f<W>(b)),
    OP("greater", f<W>(a) > f<W>(b)),
    OP("greater_equal", f<W>(a) >= f<W>(b)),
    OP("equal", f<W>(a) == f<W>(b)),
    OP("not_equal", f<W>(a) != f<W>(b)),
    OP("select_float", select(m<W>(c), f<W>(a), f<W>(b))),
    OP("select_int", select(m<W>(c), n<W>(a), n<W>(b))),
    OP("int_add", n<W>(a) + n<W>(b)),
    OP("int_sub", n<W>(a) - n<W>(b)),
    OP("int_and", n<W>(a) & n<W>(b)),
    OP("int_or", n<W>(a) | n<W>(b)),
    OP("int_xor", n<W>(a) ^ n<W>(b)),
    OP("int_equal", n<W>(a) == n<W>(b)),
    OP("int_less", n<W>(a) < n<W>(b)),
    OP("int_greater", n<W>(a) > n<W>(b)),
    OP("int_max", max(n<W>(a), n<W>(b))),
    OP("shift_left_3", n<W>(a).template shift_left<3>()),
    OP("to_float", to_float(n<W>(a))),
    OP("truncate_to_int", truncate_to_int(f<W>(a))),
    OP("as_int", f<W>(a).as_int()),
    OP("from_int_bits", vf<W>::from_int_bits(n<W>(a))),
    OP("broadcast_float", vf<W>(1.5f)),
    OP("broadcast_int", vi<W>(-7)),
    OP("iota", vi<W>::iota()),
    OP("mask_and", m<W>(a) & m<W>(b)),
    OP("mask_or", m<W>(a) | m<W>(b)),
    OP("mask_xor", m<W>(a) ^ m<W>(b)),
    OP("mask_not", ~m<W>(a)),
    OP("mask_true", vm<W>(true)),
    OP("mask_false", vm<W>(false)),
    OP("mask_from_bits", vm<W>::from_bits(a[0])),
    OP("mask_bits", vi<W>(std::int32_t(m<W>(a).bits()))),
    OP("mask_any", vi<W>(any(m<W>(a)))),
    OP("mask_none", vi<W>(none(m<W>(a)))),
    OP("mask_all", vi<W>(all(m<W>(a)))),
    OP("reduce_min", vf<W>(reduce_min(f<W>(a)))),
    OP("reduce_max", vf<W>(reduce_max(f<W>(a)))),
    OP("dot", dot(vf3<W>{f<W>(a), f<W>(b), f<W>(c)}, vf3<W>{f<W>(b), f<W>(c), f<W>(a)})),
    OP("cross_x", (cross(vf3<W>{f<W>(a), f<W>(b), f<W>(c)}, vf3<W>{f<W>(b), f<W>(c), f<W>(a)}).x)),
    OP("cross_y", (cross(vf3<W>{f<W>(a), f<W>(b), f<W>(c)}, vf3<W>{f<W>(b), f<W>(c), f<W>(a)}).y)),
    OP("cross_z", (cross(vf3<W>{f<W>(a), f<W>(b), f<W>(c)}, vf3<W>{f<W>(b), f<W>(c), f<W>(a)}).z)),
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR || ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    OP("compress", compress(m<W>(c), n<W>(a))),
#endif
    {"compress_bits", &compress_bits<W>},
    {"permute_lanes", &permute_lanes<W>},
    {"or_in_lanes", &or_in_lanes<W>},
    {"sort_lanes_down", &sort_lanes_down<W>},
    {"sort_first_lanes_down", &sort_first_lanes_down<W>},
};
/// The last of them, which are not there for all widths.
inline constexpr int kLaneOrders = 5;
#undef OP

template <int W>
inline simd_test::OperationTable table() {
  return {kOperations<W>, int(sizeof kOperations<W> / sizeof kOperations<W>[0]) - (kOrdersLanes<W> ? 0 : kLaneOrders),
          kHasFma};
}

inline simd_test::OperationTable table_of(int width) {
  return width == 4 ? table<4>() : width == 8 ? table<8>() : table<16>();
}

}  // namespace test
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
