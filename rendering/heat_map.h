// Heat map: what one ray a pixel costs, as a picture: nodes visited or triangles tested, with a colour bar.
//
// Rays go one by one through the counting kernel, from the pixels' centres without a lens, in the middle of the
// shutter's time. The colours' lightness (CIELAB) rises evenly with the count, so that equal differences look equal and
// grey prints keep the order.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "rendering/batch_tracer.h"
#include "rendering/render.h"

namespace arboretum {

enum class HeatCount : unsigned char { nodes, triangles };
inline constexpr std::array<std::string_view, 2> kHeatCountNames{"nodes", "triangles"};
/// Throws UserError, naming the nearest.
[[nodiscard]] HeatCount parse_heat_count(const std::string& word);

struct HeatMap {
  unsigned width = 0, height = 0;
  std::vector<std::uint64_t> counts;  ///< rows downwards
  double mean = 0.0;
  std::uint64_t median = 0, most = 0;
  std::uint64_t top = 1;  ///< what the brightest colour stands for: 99.8 % of the pixels have no more
};

/// Throws UserError where the row does not count (embree). `threads` of settings count; samples and integrator do not.
[[nodiscard]] HeatMap count_work(const BatchTracer& tracer, const RenderSettings& settings, HeatCount what);

/// The colour for a share of the scale, within [0, 1]; sRGB.
[[nodiscard]] std::array<std::uint8_t, 3> heat_color(double share) noexcept;

/// Bytes of sRGB, rows downwards.
struct DrawnPicture {
  unsigned width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};
/// The map with its bar on the right, `unit` above the bar.
[[nodiscard]] DrawnPicture draw(const HeatMap& map, const std::string& unit);
/// Width and height that draw() does not exceed, whatever is counted.
[[nodiscard]] std::array<unsigned, 2> drawn_size_at_most(unsigned width, unsigned height, const std::string& unit);

/// A labelled count beside the bar, at its row.
struct HeatTick {
  std::uint64_t count = 0;
  unsigned y = 0;
};
/// Of a bar from row `low` (a count of 0) up to row `high` (`top`, always the last of them): labels `letter` pixels
/// high are apart.
[[nodiscard]] std::vector<HeatTick> heat_ticks(std::uint64_t top, unsigned high, unsigned low, unsigned letter);

}  // namespace arboretum
