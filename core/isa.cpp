#include "core/isa.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include <cpuid.h>

#include "core/error.h"

namespace arboretum {

std::string_view to_string(Isa isa) noexcept {
  constexpr std::string_view kNames[] = {"scalar", "sse", "avx2", "avx512"};
  return kNames[static_cast<int>(isa)];
}

std::optional<Isa> parse_isa(std::string_view name) noexcept {
  for (Isa isa : kAllIsas)
    if (to_string(isa) == name) return isa;
  if (name == "avx") return Isa::avx2;
  return std::nullopt;
}

int native_width(Isa isa) noexcept {
  constexpr int kWidths[] = {4, 4, 8, 16};
  return kWidths[static_cast<int>(isa)];
}

namespace {

/// CPUID leaf 0x80000001, ECX bit 5. Before clang 15 __builtin_cpu_supports() does not know it by name.
bool has_lzcnt() noexcept {
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  return __get_cpuid(0x80000001u, &eax, &ebx, &ecx, &edx) != 0 && (ecx >> 5 & 1u) != 0;
}

}  // namespace

bool cpu_supports(Isa isa) noexcept {
  __builtin_cpu_init();  // knows the operating system's register support (XCR0) too
  switch (isa) {
    case Isa::scalar: return true;
    case Isa::sse: return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt");
    case Isa::avx2:
      return cpu_supports(Isa::sse) && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
             __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") && has_lzcnt();
    case Isa::avx512:
      return cpu_supports(Isa::avx2) && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
             __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  }
  return false;
}

std::span<const Isa> available_isas() {
  static const std::vector<Isa> isas = [] {
    Isa limit = Isa::avx512;
    if (const char* forced = std::getenv("ARBORETUM_ISA"); forced && *forced) {
      const std::optional<Isa> isa = parse_isa(forced);
      if (!isa) {
        throw UserError("ARBORETUM_ISA='" + std::string(forced) +
                        "' names no instruction set; use scalar, sse, avx2 or avx512");
      }
      if (!cpu_supports(*isa))
        throw UserError("ARBORETUM_ISA=" + std::string(forced) + ": this machine has no " +
                        std::string(to_string(*isa)));
      limit = *isa;
    }
    std::vector<Isa> list;
    for (Isa isa : kAllIsas)
      if (isa <= limit && cpu_supports(isa)) list.push_back(isa);
    return list;
  }();
  return isas;
}

bool is_available(Isa isa) {
  const auto isas = available_isas();
  return std::find(isas.begin(), isas.end(), isa) != isas.end();
}

Isa best_isa() { return available_isas().back(); }

}  // namespace arboretum
