// A width beyond the register: two halves, each itself a register or a pair.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct vm {
  static constexpr int H = W / 2;
  vm<H> lo, hi;
  vm() = default;
  ARBORETUM_INLINE vm(vm<H> l, vm<H> h) : lo(l), hi(h) {}
  ARBORETUM_INLINE explicit vm(bool all) : lo(all), hi(all) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) { return {vm<H>::from_bits(bits & ((1u << H) - 1u)), vm<H>::from_bits(bits >> H)}; }
  ARBORETUM_INLINE unsigned bits() const { return lo.bits() | hi.bits() << H; }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return {a.lo & b.lo, a.hi & b.hi}; }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return {a.lo | b.lo, a.hi | b.hi}; }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return {a.lo ^ b.lo, a.hi ^ b.hi}; }
  friend ARBORETUM_INLINE vm operator~(vm a) { return {~a.lo, ~a.hi}; }
};

template <int W>
struct vi {
  static constexpr int H = W / 2;
  vi<H> lo, hi;
  vi() = default;
  ARBORETUM_INLINE vi(vi<H> l, vi<H> h) : lo(l), hi(h) {}
  ARBORETUM_INLINE vi(std::int32_t s) : lo(s), hi(s) {}
  static ARBORETUM_INLINE vi load(const void* p) { return {vi<H>::load(p), vi<H>::load(static_cast<const std::int32_t*>(p) + H)}; }
  static ARBORETUM_INLINE vi iota() { return {vi<H>::iota(), vi<H>::iota() + vi<H>(H)}; }
  ARBORETUM_INLINE void store(void* p) const { lo.store(p), hi.store(static_cast<std::int32_t*>(p) + H); }
  friend ARBORETUM_INLINE vi operator+(vi a, vi b) { return {a.lo + b.lo, a.hi + b.hi}; }
  friend ARBORETUM_INLINE vi operator-(vi a, vi b) { return {a.lo - b.lo, a.hi - b.hi}; }
  friend ARBORETUM_INLINE vi operator&(vi a, vi b) { return {a.lo & b.lo, a.hi & b.hi}; }
  friend ARBORETUM_INLINE vi operator|(vi a, vi b) { return {a.lo | b.lo, a.hi | b.hi}; }
  friend ARBORETUM_INLINE vi operator^(vi a, vi b) { return {a.lo ^ b.lo, a.hi ^ b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator==(vi a, vi b) { return {a.lo == b.lo, a.hi == b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator<(vi a, vi b) { return {a.lo < b.lo, a.hi < b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator>(vi a, vi b) { return b < a; }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return {max(a.lo, b.lo), max(a.hi, b.hi)}; }
  friend ARBORETUM_INLINE vi select(vm<W> m, vi a, vi b) { return {select(m.lo, a.lo, b.lo), select(m.hi, a.hi, b.hi)}; }
  template <int S>
  ARBORETUM_INLINE vi shift_left() const {
    return {lo.template shift_left<S>(), hi.template shift_left<S>()};
  }
};

template <int W>
struct vf {
  static constexpr int H = W / 2;
  vf<H> lo, hi;
  vf() = default;
  ARBORETUM_INLINE vf(vf<H> l, vf<H> h) : lo(l), hi(h) {}
  ARBORETUM_INLINE vf(float s) : lo(s), hi(s) {}
  static ARBORETUM_INLINE vf load(const void* p) { return {vf<H>::load(p), vf<H>::load(static_cast<const float*>(p) + H)}; }
  ARBORETUM_INLINE void store(void* p) const { lo.store(p), hi.store(static_cast<float*>(p) + H); }
  friend ARBORETUM_INLINE vf operator+(vf a, vf b) { return {a.lo + b.lo, a.hi + b.hi}; }
  friend ARBORETUM_INLINE vf operator-(vf a, vf b) { return {a.lo - b.lo, a.hi - b.hi}; }
  friend ARBORETUM_INLINE vf operator*(vf a, vf b) { return {a.lo * b.lo, a.hi * b.hi}; }
  friend ARBORETUM_INLINE vf operator/(vf a, vf b) { return {a.lo / b.lo, a.hi / b.hi}; }
  friend ARBORETUM_INLINE vf min_x86(vf a, vf b) { return {min_x86(a.lo, b.lo), min_x86(a.hi, b.hi)}; }
  friend ARBORETUM_INLINE vf max_x86(vf a, vf b) { return {max_x86(a.lo, b.lo), max_x86(a.hi, b.hi)}; }
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return {madd(a.lo, b.lo, c.lo), madd(a.hi, b.hi, c.hi)}; }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return {msub(a.lo, b.lo, c.lo), msub(a.hi, b.hi, c.hi)}; }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return {nmadd(a.lo, b.lo, c.lo), nmadd(a.hi, b.hi, c.hi)}; }
  friend ARBORETUM_INLINE vm<W> operator<(vf a, vf b) { return {a.lo < b.lo, a.hi < b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator<=(vf a, vf b) { return {a.lo <= b.lo, a.hi <= b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<W> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<W> operator==(vf a, vf b) { return {a.lo == b.lo, a.hi == b.hi}; }
  friend ARBORETUM_INLINE vm<W> operator!=(vf a, vf b) { return {a.lo != b.lo, a.hi != b.hi}; }
  friend ARBORETUM_INLINE vf select(vm<W> m, vf a, vf b) { return {select(m.lo, a.lo, b.lo), select(m.hi, a.hi, b.hi)}; }
  ARBORETUM_INLINE vi<W> as_int() const { return {lo.as_int(), hi.as_int()}; }
  static ARBORETUM_INLINE vf from_int_bits(vi<W> b) { return {vf<H>::from_int_bits(b.lo), vf<H>::from_int_bits(b.hi)}; }
  friend ARBORETUM_INLINE float reduce_min(vf a) { return reduce_min(min_x86(a.lo, a.hi)); }
  friend ARBORETUM_INLINE float reduce_max(vf a) { return reduce_max(max_x86(a.lo, a.hi)); }
};

template <int W>
ARBORETUM_INLINE vf<W> to_float(vi<W> a) {
  return {to_float(a.lo), to_float(a.hi)};
}
template <int W>
ARBORETUM_INLINE vi<W> truncate_to_int(vf<W> a) {
  return {truncate_to_int(a.lo), truncate_to_int(a.hi)};
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
