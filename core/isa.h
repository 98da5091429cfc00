// Instruction sets: names, what this machine runs, what ARBORETUM_ISA allows.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace arboretum {

/// Ordered: a machine that runs one runs those before it. sse: SSE4.2; avx2: AVX2+FMA+BMI2; avx512: F, VL, DQ, BW.
enum class Isa : unsigned char { scalar, sse, avx2, avx512 };

inline constexpr std::array kAllIsas{Isa::scalar, Isa::sse, Isa::avx2, Isa::avx512};

[[nodiscard]] std::string_view to_string(Isa isa) noexcept;
/// Accepts the four names and `avx`, a synonym of avx2.
[[nodiscard]] std::optional<Isa> parse_isa(std::string_view name) noexcept;
/// Float lanes of one register: 4, 4, 8, 16 (scalar counts as 4, the narrowest width there is).
[[nodiscard]] int native_width(Isa isa) noexcept;
/// What CPU and operating system run, ARBORETUM_ISA not considered.
[[nodiscard]] bool cpu_supports(Isa isa) noexcept;
/// The ISAs that can be used: those the machine runs, cut off above ARBORETUM_ISA where that is set.
/// Throws UserError when ARBORETUM_ISA names no ISA or one that the machine lacks.
[[nodiscard]] std::span<const Isa> available_isas();
[[nodiscard]] bool is_available(Isa isa);
[[nodiscard]] Isa best_isa();

}  // namespace arboretum
