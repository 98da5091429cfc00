// How secondary rays leave the surface that they start on, so that they do not meet it again: the ways that renderers
// use, to be compared. A ray starts at the hit point rounded to float32, which lies off its triangle by up to half an
// ulp a coordinate.
#pragma once

#include <array>
#include <string_view>

namespace arboretum {

enum class SelfIntersection : unsigned char {
  none,            ///< from the rounded point, tnear 0
  epsilon,         ///< the same with tnear a fixed share of the scene's diagonal
  integer_offset,  ///< moved along the normal by steps of the number format (Waechter and Binder, Ray Tracing Gems, ch.
                   ///< 6)
  error_bound,     ///< moved along the normal by a bound on the point's rounding error (Pharr, Jakob, Humphreys, 3rd
                   ///< ed., 3.9)
  exclusion        ///< from the rounded point, passing through the primitive that it starts on
};
inline constexpr std::array<std::string_view, 5> kSelfIntersectionNames{"none", "epsilon", "integer_offset",
                                                                        "error_bound", "exclusion"};

[[nodiscard]] constexpr std::string_view to_string(SelfIntersection method) noexcept {
  return kSelfIntersectionNames[static_cast<std::size_t>(method)];
}

struct SurfaceStart {
  SelfIntersection method = SelfIntersection::error_bound;
  double epsilon = 1e-4;  ///< of `epsilon`: tnear as a share of the scene's diagonal
};

}  // namespace arboretum
