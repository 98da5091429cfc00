// The reference: W lanes as an array, one operation at a time.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct vm {
  unsigned mask = 0;  // lane i is bit i
  vm() = default;
  explicit vm(bool all) : mask(all ? (1u << W) - 1u : 0u) {}
  static vm from_bits(unsigned bits) {
    vm m;
    m.mask = bits & ((1u << W) - 1u);
    return m;
  }
  unsigned bits() const { return mask; }
  friend vm operator&(vm a, vm b) { return from_bits(a.mask & b.mask); }
  friend vm operator|(vm a, vm b) { return from_bits(a.mask | b.mask); }
  friend vm operator^(vm a, vm b) { return from_bits(a.mask ^ b.mask); }
  friend vm operator~(vm a) { return from_bits(~a.mask); }
};

template <int W>
struct vi {
  std::int32_t lane[W];
  vi() = default;
  vi(std::int32_t s) {
    for (auto& x : lane) x = s;
  }
  static vi load(const void* p) {
    vi r;
    std::memcpy(r.lane, p, sizeof r.lane);
    return r;
  }
  static vi iota() {
    vi r;
    for (int i = 0; i < W; ++i) r.lane[i] = i;
    return r;
  }
  void store(void* p) const { std::memcpy(p, lane, sizeof lane); }
  template <class F>
  static vi map(F f) {
    vi r;
    for (int i = 0; i < W; ++i) r.lane[i] = f(i);
    return r;
  }
  template <class F>
  static vm<W> test(F f) {
    unsigned b = 0;
    for (int i = 0; i < W; ++i) b |= unsigned(f(i)) << i;
    return vm<W>::from_bits(b);
  }
  friend vi operator+(vi a, vi b) {
    return map([&](int i) { return std::int32_t(std::uint32_t(a.lane[i]) + std::uint32_t(b.lane[i])); });
  }
  friend vi operator-(vi a, vi b) {
    return map([&](int i) { return std::int32_t(std::uint32_t(a.lane[i]) - std::uint32_t(b.lane[i])); });
  }
  friend vi operator&(vi a, vi b) {
    return map([&](int i) { return a.lane[i] & b.lane[i]; });
  }
  friend vi operator|(vi a, vi b) {
    return map([&](int i) { return a.lane[i] | b.lane[i]; });
  }
  friend vi operator^(vi a, vi b) {
    return map([&](int i) { return a.lane[i] ^ b.lane[i]; });
  }
  friend vm<W> operator==(vi a, vi b) {
    return test([&](int i) { return a.lane[i] == b.lane[i]; });
  }
  friend vm<W> operator<(vi a, vi b) {
    return test([&](int i) { return a.lane[i] < b.lane[i]; });
  }
  friend vm<W> operator>(vi a, vi b) { return b < a; }
  friend vi max(vi a, vi b) {
    return map([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
  }
  friend vi select(vm<W> m, vi a, vi b) {
    return map([&](int i) { return (m.mask >> i & 1u) ? a.lane[i] : b.lane[i]; });
  }
  template <int S>
  vi shift_left() const {
    return map([&](int i) { return std::int32_t(std::uint32_t(lane[i]) << S); });
  }
};

template <int W>
struct vf {
  float lane[W];
  vf() = default;
  vf(float s) {
    for (auto& x : lane) x = s;
  }
  static vf load(const void* p) {
    vf r;
    std::memcpy(r.lane, p, sizeof r.lane);
    return r;
  }
  void store(void* p) const { std::memcpy(p, lane, sizeof lane); }
  template <class F>
  static vf map(F f) {
    vf r;
    for (int i = 0; i < W; ++i) r.lane[i] = f(i);
    return r;
  }
  template <class F>
  static vm<W> test(F f) {
    return vi<W>::test(f);
  }
  friend vf operator+(vf a, vf b) {
    return map([&](int i) { return a.lane[i] + b.lane[i]; });
  }
  friend vf operator-(vf a, vf b) {
    return map([&](int i) { return a.lane[i] - b.lane[i]; });
  }
  friend vf operator*(vf a, vf b) {
    return map([&](int i) { return a.lane[i] * b.lane[i]; });
  }
  friend vf operator/(vf a, vf b) {
    return map([&](int i) { return a.lane[i] / b.lane[i]; });
  }
  friend vf min_x86(vf a, vf b) {
    return map([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
  }
  friend vf max_x86(vf a, vf b) {
    return map([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
  }
  friend vf madd(vf a, vf b, vf c) { return a * b + c; }
  friend vf msub(vf a, vf b, vf c) { return a * b - c; }
  friend vf nmadd(vf a, vf b, vf c) { return c - a * b; }
  friend vm<W> operator<(vf a, vf b) {
    return test([&](int i) { return a.lane[i] < b.lane[i]; });
  }
  friend vm<W> operator<=(vf a, vf b) {
    return test([&](int i) { return a.lane[i] <= b.lane[i]; });
  }
  friend vm<W> operator>(vf a, vf b) { return b < a; }
  friend vm<W> operator>=(vf a, vf b) { return b <= a; }
  friend vm<W> operator==(vf a, vf b) {
    return test([&](int i) { return a.lane[i] == b.lane[i]; });
  }
  friend vm<W> operator!=(vf a, vf b) {
    return test([&](int i) { return a.lane[i] != b.lane[i]; });
  }
  friend vf select(vm<W> m, vf a, vf b) {
    return map([&](int i) { return (m.mask >> i & 1u) ? a.lane[i] : b.lane[i]; });
  }
  vi<W> as_int() const { return vi<W>::load(lane); }
  static vf from_int_bits(vi<W> b) { return load(b.lane); }
  friend float reduce_min(vf a) {
    float m = a.lane[0];
    for (int i = 1; i < W; ++i) m = a.lane[i] < m ? a.lane[i] : m;
    return m;
  }
  friend float reduce_max(vf a) {
    float m = a.lane[0];
    for (int i = 1; i < W; ++i) m = a.lane[i] > m ? a.lane[i] : m;
    return m;
  }
};

template <int W>
inline vf<W> to_float(vi<W> a) {
  return vf<W>::map([&](int i) { return float(a.lane[i]); });
}
template <int W>
inline vi<W> truncate_to_int(vf<W> a) {
  return vi<W>::map([&](int i) {
    return a.lane[i] >= -2147483648.0f && a.lane[i] < 2147483648.0f ? std::int32_t(a.lane[i]) : std::numeric_limits<std::int32_t>::min();
  });
}
/// The lanes that `m` names, moved to the front in order; those behind are 0.
template <int W>
inline vi<W> compress(vm<W> m, vi<W> a) {
  vi<W> r(0);
  for (int i = 0, n = 0; i < W; ++i)
    if (m.mask >> i & 1u) r.lane[n++] = a.lane[i];
  return r;
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
