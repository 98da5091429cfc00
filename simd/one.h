// One lane: the plain float, for leaf blocks of one triangle. Same semantics as the wider ones.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <>
struct vm<1> {
  bool v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(bool all) : v(all) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) { return vm((bits & 1u) != 0); }
  ARBORETUM_INLINE unsigned bits() const { return v; }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return vm(bool(a.v & b.v)); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return vm(bool(a.v | b.v)); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return vm(bool(a.v ^ b.v)); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return vm(!a.v); }
};

template <>
struct vi<1> {
  std::int32_t v;
  vi() = default;
  ARBORETUM_INLINE vi(std::int32_t s) : v(s) {}
  static ARBORETUM_INLINE vi load(const void* p) {
    vi r;
    __builtin_memcpy(&r.v, p, 4);
    return r;
  }
  static ARBORETUM_INLINE vi iota() { return 0; }
  ARBORETUM_INLINE void store(void* p) const { __builtin_memcpy(p, &v, 4); }
  friend ARBORETUM_INLINE vi operator&(vi a, vi b) { return a.v & b.v; }
  friend ARBORETUM_INLINE vi operator|(vi a, vi b) { return a.v | b.v; }
  friend ARBORETUM_INLINE vi operator^(vi a, vi b) { return a.v ^ b.v; }
  friend ARBORETUM_INLINE vm<1> operator==(vi a, vi b) { return vm<1>(a.v == b.v); }
  friend ARBORETUM_INLINE vm<1> operator<(vi a, vi b) { return vm<1>(a.v < b.v); }
  friend ARBORETUM_INLINE vm<1> operator>(vi a, vi b) { return vm<1>(a.v > b.v); }
  friend ARBORETUM_INLINE vi select(vm<1> m, vi a, vi b) { return m.v ? a : b; }
};

template <>
struct vf<1> {
  float v;
  vf() = default;
  ARBORETUM_INLINE vf(float s) : v(s) {}
  static ARBORETUM_INLINE vf load(const void* p) {
    vf r;
    __builtin_memcpy(&r.v, p, 4);
    return r;
  }
  ARBORETUM_INLINE void store(void* p) const { __builtin_memcpy(p, &v, 4); }
  friend ARBORETUM_INLINE vf operator+(vf a, vf b) { return a.v + b.v; }
  friend ARBORETUM_INLINE vf operator-(vf a, vf b) { return a.v - b.v; }
  friend ARBORETUM_INLINE vf operator*(vf a, vf b) { return a.v * b.v; }
  friend ARBORETUM_INLINE vf operator/(vf a, vf b) { return a.v / b.v; }
  friend ARBORETUM_INLINE vf min_x86(vf a, vf b) { return a.v < b.v ? a.v : b.v; }
  friend ARBORETUM_INLINE vf max_x86(vf a, vf b) { return a.v > b.v ? a.v : b.v; }
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return kHasFma ? __builtin_fmaf(a.v, b.v, c.v) : a.v * b.v + c.v; }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return kHasFma ? __builtin_fmaf(a.v, b.v, -c.v) : a.v * b.v - c.v; }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return kHasFma ? __builtin_fmaf(-a.v, b.v, c.v) : c.v - a.v * b.v; }
  friend ARBORETUM_INLINE vm<1> operator<(vf a, vf b) { return vm<1>(a.v < b.v); }
  friend ARBORETUM_INLINE vm<1> operator<=(vf a, vf b) { return vm<1>(a.v <= b.v); }
  friend ARBORETUM_INLINE vm<1> operator>(vf a, vf b) { return vm<1>(a.v > b.v); }
  friend ARBORETUM_INLINE vm<1> operator>=(vf a, vf b) { return vm<1>(a.v >= b.v); }
  friend ARBORETUM_INLINE vm<1> operator==(vf a, vf b) { return vm<1>(a.v == b.v); }
  friend ARBORETUM_INLINE vm<1> operator!=(vf a, vf b) { return vm<1>(a.v != b.v); }
  friend ARBORETUM_INLINE vf select(vm<1> m, vf a, vf b) { return m.v ? a : b; }
  ARBORETUM_INLINE vi<1> as_int() const { return vi<1>::load(&v); }
  static ARBORETUM_INLINE vf from_int_bits(vi<1> b) { return load(&b.v); }
  friend ARBORETUM_INLINE float reduce_min(vf a) { return a.v; }
  friend ARBORETUM_INLINE float reduce_max(vf a) { return a.v; }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
