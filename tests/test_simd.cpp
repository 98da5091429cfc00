// The semantics of simd/, on every ISA that the machine runs, against one operation at a time in plain C++.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/isa.h"
#include "core/random.h"
#include "tests/catch.h"
#include "tests/simd/operations.h"

using namespace arboretum;
using namespace arboretum::simd_test;

namespace {

using Bits = std::uint32_t;

float as_float(Bits b) { return std::bit_cast<float>(b); }
Bits bits(float x) { return std::bit_cast<Bits>(x); }
std::int32_t as_int(Bits b) { return std::bit_cast<std::int32_t>(b); }
Bits bits(std::int32_t x) { return std::bit_cast<Bits>(x); }

struct Lanes {
  int width, lane;
  const Bits *a, *b, *c;
  bool fma;
  [[nodiscard]] float fa() const { return as_float(a[lane]); }
  [[nodiscard]] float fb() const { return as_float(b[lane]); }
  [[nodiscard]] float fc() const { return as_float(c[lane]); }
  [[nodiscard]] std::int32_t ia() const { return as_int(a[lane]); }
  [[nodiscard]] std::int32_t ib() const { return as_int(b[lane]); }
  [[nodiscard]] unsigned mask(const Bits* p) const {
    unsigned m = 0;
    for (int i = 0; i < width; ++i) m |= (p[i] & 1u) << i;
    return m;
  }
  [[nodiscard]] float madd(float x, float y, float z) const { return fma ? std::fma(x, y, z) : x * y + z; }
};

/// `exact`: NaNs must agree in every bit too, since the operation moves patterns and does no arithmetic.
/// `finite`: the result is promised for lanes without NaN only, and the sign of a zero is not.
enum class Compare { exact, arithmetic, finite };

struct Reference {
  Compare compare;
  std::function<Bits(const Lanes&)> lane;
};

/// As signed integers, the largest first.
std::vector<Bits> sorted_down(std::vector<Bits> lanes) {
  std::sort(lanes.begin(), lanes.end(), [](Bits x, Bits y) { return std::int32_t(x) > std::int32_t(y); });
  return lanes;
}

const std::map<std::string, Reference>& references() {
  using L = const Lanes&;
  using enum Compare;
  static const auto product = [](float x, float y) {
    volatile float p = x * y;
    return float(p);
  };
  static const std::map<std::string, Reference> table{
      {"add", {arithmetic, [](L l) { return bits(l.fa() + l.fb()); }}},
      {"sub", {arithmetic, [](L l) { return bits(l.fa() - l.fb()); }}},
      {"mul", {arithmetic, [](L l) { return bits(l.fa() * l.fb()); }}},
      {"div", {arithmetic, [](L l) { return bits(l.fa() / l.fb()); }}},
      {"negate", {exact, [](L l) { return l.a[l.lane] ^ 0x80000000u; }}},
      {"abs", {exact, [](L l) { return l.a[l.lane] & 0x7fffffffu; }}},
      {"sign_bits", {exact, [](L l) { return l.a[l.lane] & 0x80000000u; }}},
      {"xor_sign", {exact, [](L l) { return l.a[l.lane] ^ (l.b[l.lane] & 0x80000000u); }}},
      {"min_x86", {exact, [](L l) { return l.fa() < l.fb() ? l.a[l.lane] : l.b[l.lane]; }}},
      {"max_x86", {exact, [](L l) { return l.fa() > l.fb() ? l.a[l.lane] : l.b[l.lane]; }}},
      {"madd", {arithmetic, [](L l) { return bits(l.madd(l.fa(), l.fb(), l.fc())); }}},
      {"msub", {arithmetic, [](L l) { return bits(l.madd(l.fa(), l.fb(), -l.fc())); }}},
      {"nmadd", {arithmetic, [](L l) { return bits(l.madd(-l.fa(), l.fb(), l.fc())); }}},
      {"unfused_mul_sub", {arithmetic, [](L l) { return bits(product(l.fa(), l.fb()) - l.fc()); }}},
      {"unfused_mul_add", {arithmetic, [](L l) { return bits(product(l.fa(), l.fb()) + l.fc()); }}},
      {"scalar_mul_sub", {arithmetic, [](L l) { return bits(product(l.fa(), l.fb()) - l.fc()); }}},
      {"transposed_row",
       {exact,
        [](L l) {
          const Bits* row[] = {l.a, l.b, l.c, l.a};
          return l.lane < 4 ? row[l.lane][l.c[0] & 3u] : 0u;
        }}},
      {"bytes_with_bit",
       {exact,
        [](L l) {
          Bits with = 0;
          for (int i = 0; l.lane < 2 && i < 32; ++i) {
            const int byte = (32 * l.lane + i) % (4 * l.width);
            with |= (l.a[byte / 4] >> (8 * (byte % 4)) >> (l.c[0] & 7u) & 1u) << i;
          }
          return with;
        }}},
      {"less", {exact, [](L l) { return Bits(l.fa() < l.fb()); }}},
      {"less_equal", {exact, [](L l) { return Bits(l.fa() <= l.fb()); }}},
      {"greater", {exact, [](L l) { return Bits(l.fa() > l.fb()); }}},
      {"greater_equal", {exact, [](L l) { return Bits(l.fa() >= l.fb()); }}},
      {"equal", {exact, [](L l) { return Bits(l.fa() == l.fb()); }}},
      {"not_equal", {exact, [](L l) { return Bits(l.fa() != l.fb()); }}},
      {"select_float", {exact, [](L l) { return (l.c[l.lane] & 1u) ? l.a[l.lane] : l.b[l.lane]; }}},
      {"select_int", {exact, [](L l) { return (l.c[l.lane] & 1u) ? l.a[l.lane] : l.b[l.lane]; }}},
      {"int_add", {exact, [](L l) { return l.a[l.lane] + l.b[l.lane]; }}},
      {"int_sub", {exact, [](L l) { return l.a[l.lane] - l.b[l.lane]; }}},
      {"int_and", {exact, [](L l) { return l.a[l.lane] & l.b[l.lane]; }}},
      {"int_or", {exact, [](L l) { return l.a[l.lane] | l.b[l.lane]; }}},
      {"int_xor", {exact, [](L l) { return l.a[l.lane] ^ l.b[l.lane]; }}},
      {"int_equal", {exact, [](L l) { return Bits(l.ia() == l.ib()); }}},
      {"int_less", {exact, [](L l) { return Bits(l.ia() < l.ib()); }}},
      {"int_greater", {exact, [](L l) { return Bits(l.ia() > l.ib()); }}},
      {"int_max", {exact, [](L l) { return bits(std::max(l.ia(), l.ib())); }}},
      {"shift_left_3", {exact, [](L l) { return l.a[l.lane] << 3; }}},
      {"to_float", {exact, [](L l) { return bits(float(l.ia())); }}},
      {"truncate_to_int",
       {exact,
        [](L l) {
          const bool fits = l.fa() >= -2147483648.0f && l.fa() < 2147483648.0f;
          return bits(fits ? std::int32_t(l.fa()) : std::numeric_limits<std::int32_t>::min());
        }}},
      {"as_int", {exact, [](L l) { return l.a[l.lane]; }}},
      {"from_int_bits", {exact, [](L l) { return l.a[l.lane]; }}},
      {"broadcast_float", {exact, [](L) { return bits(1.5f); }}},
      {"broadcast_int", {exact, [](L) { return bits(-7); }}},
      {"iota", {exact, [](L l) { return Bits(l.lane); }}},
      {"mask_and", {exact, [](L l) { return l.a[l.lane] & l.b[l.lane] & 1u; }}},
      {"mask_or", {exact, [](L l) { return (l.a[l.lane] | l.b[l.lane]) & 1u; }}},
      {"mask_xor", {exact, [](L l) { return (l.a[l.lane] ^ l.b[l.lane]) & 1u; }}},
      {"mask_not", {exact, [](L l) { return ~l.a[l.lane] & 1u; }}},
      {"mask_true", {exact, [](L) { return 1u; }}},
      {"mask_false", {exact, [](L) { return 0u; }}},
      {"mask_from_bits", {exact, [](L l) { return l.a[0] >> l.lane & 1u; }}},
      {"mask_bits", {exact, [](L l) { return l.mask(l.a); }}},
      {"mask_any", {exact, [](L l) { return Bits(l.mask(l.a) != 0); }}},
      {"mask_none", {exact, [](L l) { return Bits(l.mask(l.a) == 0); }}},
      {"mask_all", {exact, [](L l) { return Bits(l.mask(l.a) == (1u << l.width) - 1u); }}},
      {"reduce_min",
       {finite,
        [](L l) {
          float m = as_float(l.a[0]);
          for (int i = 1; i < l.width; ++i) m = std::fmin(m, as_float(l.a[i]));
          return bits(m);
        }}},
      {"reduce_max",
       {finite,
        [](L l) {
          float m = as_float(l.a[0]);
          for (int i = 1; i < l.width; ++i) m = std::fmax(m, as_float(l.a[i]));
          return bits(m);
        }}},
      {"dot",
       {arithmetic, [](L l) { return bits(l.madd(l.fa(), l.fb(), l.madd(l.fb(), l.fc(), product(l.fc(), l.fa())))); }}},
      {"cross_x", {arithmetic, [](L l) { return bits(l.madd(l.fb(), l.fa(), -product(l.fc(), l.fc()))); }}},
      {"cross_y", {arithmetic, [](L l) { return bits(l.madd(l.fc(), l.fb(), -product(l.fa(), l.fa()))); }}},
      {"cross_z", {arithmetic, [](L l) { return bits(l.madd(l.fa(), l.fc(), -product(l.fb(), l.fb()))); }}},
      {"compress",
       {exact,
        [](L l) {
          for (int i = 0, n = 0; i < l.width; ++i)
            if ((l.c[i] & 1u) && n++ == l.lane) return l.a[i];
          return 0u;  // the lanes behind are not looked at, see agrees()
        }}},
      {"compress_bits",
       {exact,
        [](L l) {
          for (int i = 0, n = 0; i < l.width; ++i)
            if ((l.c[i] & 1u) && n++ == l.lane) return l.a[i];
          return 0u;
        }}},
      {"permute_lanes", {exact, [](L l) { return l.a[l.b[l.lane] & Bits(l.width - 1)]; }}},
      {"or_in_lanes", {exact, [](L l) { return (l.c[l.lane] & 1u) ? l.a[l.lane] | l.b[l.lane] : l.a[l.lane]; }}},
      {"sort_lanes_down",
       {exact, [](L l) { return sorted_down(std::vector<Bits>(l.a, l.a + l.width))[std::size_t(l.lane)]; }}},
      {"sort_first_lanes_down",
       {exact,
        [](L l) {
          std::vector<Bits> lanes(std::size_t(l.width), 0u);
          for (unsigned i = 0; i < l.c[0] % unsigned(l.width + 1); ++i) lanes[i] = l.a[i] & 0x7fffffffu;
          return sorted_down(lanes)[std::size_t(l.lane)];
        }}},
  };
  return table;
}

bool agrees(const std::string& name, const Reference& reference, const Lanes& l, Bits got) {
  const Bits want = reference.lane(l);
  if (name == "compress" && l.lane >= std::popcount(l.mask(l.c))) return true;
  if (got == want) return true;
  if (reference.compare == Compare::exact) return false;
  if (reference.compare == Compare::arithmetic) return std::isnan(as_float(got)) && std::isnan(as_float(want));
  for (int i = 0; i < l.width; ++i)
    if (std::isnan(as_float(l.a[i]))) return true;
  return as_float(got) == as_float(want);
}

const std::vector<Bits>& special_values() {
  static const std::vector<Bits> values = [] {
    std::vector<Bits> v{0x7fc00000u, 0xffc00000u, 0x7fc12345u, 0x7f800001u, 0x00000001u, 0x80000001u,
                        0x007fffffu, 0x00800000u, 0x7f7fffffu, 0xff7fffffu, 0x4f000000u, 0xcf000000u,
                        0x4effffffu, 0xcf000001u, 0x7fffffffu, 0xffffffffu, 0x3f7fffffu, 0x3f800001u};
    for (float x : {0.0f, -0.0f, 1.0f, -1.0f, 0.1f, 0.5f, -2.5f, 3e38f, INFINITY, -INFINITY}) v.push_back(bits(x));
    return v;
  }();
  return values;
}

/// Input `dimension` of sample `sample`: every pair of special values once, then random patterns, then
/// ordinary numbers; a quarter of the third inputs is the rounded product of the first two, where a fused
/// operation shows.
Bits input(std::uint64_t sample, int dimension) {
  const auto& special = special_values();
  if (sample < special.size() * special.size() && dimension < 2)
    return special[dimension == 0 ? sample / special.size() : sample % special.size()];
  if (dimension == 2 && sample % 4 == 0) return bits(as_float(input(sample, 0)) * as_float(input(sample, 1)));
  const std::uint64_t r = random_bits(2024, sample, std::uint64_t(dimension));
  if (r % 8 == 0) return special[(r >> 8) % special.size()];
  if (r % 8 < 4) return Bits(r >> 32);
  return bits(2.0f * random_float(2025, sample, std::uint64_t(dimension)) - 1.0f);
}

OperationTable operations(Isa isa, int width) {
  switch (isa) {
    case Isa::scalar: return operations_scalar(width);
    case Isa::sse: return operations_sse(width);
    case Isa::avx2: return operations_avx2(width);
    case Isa::avx512: return operations_avx512(width);
  }
  return {};
}

bool orders_lanes(Isa isa, int width) { return isa == Isa::avx512 || (isa == Isa::avx2 && width <= 8); }

/// Operations that simd/ does not have there.
std::set<std::string> left_out(Isa isa, int width) {
  std::set<std::string> names;
  if (isa == Isa::sse || isa == Isa::avx2) names.insert("compress");
  if (!orders_lanes(isa, width))
    names.insert({"compress_bits", "permute_lanes", "or_in_lanes", "sort_lanes_down", "sort_first_lanes_down"});
  return names;
}

}  // namespace

TEST_CASE("every operation of simd/ agrees with plain C++, lane by lane") {
  for (Isa isa : kAllIsas) {
    if (!is_available(isa)) {
      std::cout << "skipped: " << to_string(isa) << ", not available here\n";
      continue;
    }
    for (int width : {4, 8, 16}) {
      const OperationTable table = operations(isa, width);
      std::set<std::string> run, wanted;
      for (const auto& [name, reference] : references())
        if (!left_out(isa, width).contains(name)) wanted.insert(name);
      CHECK(table.has_fma == (isa >= Isa::avx2));
      for (int k = 0; k < table.count; ++k) {
        const Operation& operation = table.first[k];
        INFO("isa " << to_string(isa) << ", width " << width << ", " << operation.name);
        const auto reference = references().find(operation.name);
        REQUIRE(reference != references().end());
        run.insert(operation.name);
        int failures = 0;
        for (std::uint64_t sample = 0; sample < 6000 && failures < 3; sample += std::uint64_t(width)) {
          // One word off any alignment: loads and stores take any address.
          std::array<Bits, 17> a{}, b{}, c{}, out{};
          for (int i = 0; i < width; ++i) {
            a[i + 1] = input(sample + i, 0), b[i + 1] = input(sample + i, 1), c[i + 1] = input(sample + i, 2);
          }
          if (sample % 3 == 0) b = a;  // ties
          operation.run(&a[1], &b[1], &c[1], &out[1]);
          for (int lane = 0; lane < width; ++lane) {
            const Lanes lanes{width, lane, &a[1], &b[1], &c[1], table.has_fma};
            if (agrees(operation.name, reference->second, lanes, out[lane + 1])) continue;
            ++failures;
            UNSCOPED_INFO(std::hex << "lane " << lane << ": a " << lanes.a[lane] << " b " << lanes.b[lane] << " c "
                                   << lanes.c[lane] << " gave " << out[lane + 1] << ", want "
                                   << reference->second.lane(lanes));
          }
        }
        CHECK(failures == 0);
      }
      INFO("isa " << to_string(isa) << ", width " << width);
      CHECK(run == wanted);
    }
  }
}

TEST_CASE("NaN and ties give the second operand of min_x86 and max_x86, on every ISA") {
  const Bits nan = 0x7fc00000u, other_nan = 0xffc12345u, one = bits(1.0f), zero = 0u, minus_zero = 0x80000000u;
  const struct {
    Bits a, b, want;
  } cases[] = {{nan, one, one},
               {one, nan, nan},
               {nan, other_nan, other_nan},
               {zero, minus_zero, minus_zero},
               {minus_zero, zero, zero}};
  for (Isa isa : available_isas()) {
    for (int width : {4, 8, 16}) {
      const OperationTable table = operations(isa, width);
      for (int k = 0; k < table.count; ++k) {
        const std::string name = table.first[k].name;
        if (name != "min_x86" && name != "max_x86") continue;
        for (const auto& entry : cases) {
          std::array<Bits, 16> a, b, c{}, out{};
          a.fill(entry.a), b.fill(entry.b);
          table.first[k].run(a.data(), b.data(), c.data(), out.data());
          INFO(to_string(isa) << " " << width << " " << name << std::hex << " " << entry.a << " " << entry.b);
          for (int lane = 0; lane < width; ++lane) CHECK(out[lane] == entry.want);
        }
      }
    }
  }
}

TEST_CASE("the reference tells a fused operation from an unfused one") {
  // Otherwise the checks of madd and of -ffp-contract=off above could not fail.
  int different = 0;
  for (std::uint64_t sample = 0; sample < 6000; ++sample) {
    const float a = as_float(input(sample, 0)), b = as_float(input(sample, 1)), c = as_float(input(sample, 2));
    volatile float product = a * b;
    different += std::isfinite(a * b) && std::fma(a, b, -c) != product - c;
  }
  CHECK(different > 100);
}
