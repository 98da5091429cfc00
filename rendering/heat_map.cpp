#include "rendering/heat_map.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <thread>

#include <stb/stb_easy_font.h>

#include "core/error.h"
#include "core/names.h"
#include "scenes/camera.h"

namespace arboretum {
namespace {

/// What is drawn on, with the few shapes that a colour bar needs.
class Sheet {
 public:
  Sheet(unsigned width, unsigned height)
      : picture_{width, height, std::vector<std::uint8_t>(std::size_t(3) * width * height, 255)} {}
  void set(unsigned x, unsigned y, std::array<std::uint8_t, 3> color) {
    if (x < picture_.width && y < picture_.height)
      std::ranges::copy(color, picture_.rgb.begin() + std::ptrdiff_t(3 * (std::size_t(y) * picture_.width + x)));
  }
  void fill(unsigned x, unsigned y, unsigned width, unsigned height, std::array<std::uint8_t, 3> color) {
    for (unsigned v = y; v < y + height; ++v)
      for (unsigned u = x; u < x + width; ++u) set(u, v, color);
  }
  /// Letters 7 pixels high, times `scale`.
  void write(unsigned x, unsigned y, unsigned scale, std::string text) {
    struct Corner {
      float x, y, z;
      unsigned char color[4];
    };
    std::vector<Corner> corners(4 * 64 * (text.size() + 1));
    const int letters =
        stb_easy_font_print(0, 0, text.data(), nullptr, corners.data(), int(corners.size() * sizeof(Corner)));
    for (std::size_t i = 0; i < std::size_t(letters); ++i) {
      const Corner &low = corners[4 * i], &high = corners[4 * i + 2];
      fill(x + unsigned(low.x) * scale, y + unsigned(low.y) * scale, unsigned(high.x - low.x) * scale,
           unsigned(high.y - low.y) * scale, {0, 0, 0});
    }
  }
  [[nodiscard]] static unsigned width_of(std::string text, unsigned scale) {
    return unsigned(stb_easy_font_width(text.data())) * scale;
  }
  [[nodiscard]] DrawnPicture take() { return std::move(picture_); }

 private:
  DrawnPicture picture_;
};

/// Where all is, in pixels.
struct Layout {
  unsigned scale, margin, bar, letter, left, high, low, width, height;
  Layout(unsigned map_width, unsigned map_height, const std::string& unit, const std::string& top)
      : scale(map_height >= 360 ? 2 : 1), margin(8 * scale), bar(14 * scale), letter(8 * scale),
        left(map_width + margin), high(3 * letter) {
    const unsigned labels = std::max(bar + 5 * scale + Sheet::width_of(top, scale), Sheet::width_of(unit, scale));
    width = map_width + 2 * margin + labels, height = std::max(map_height, 12 * letter);
    low = height - 2 * letter;
  }
};

/// 1, 2 or 5 times a power of ten, so that the scale has at most eight of them, and no more than the bar has room for.
std::uint64_t tick_step(std::uint64_t top, std::uint64_t room) {
  const std::uint64_t most = std::clamp<std::uint64_t>(room, 1, 8);
  std::uint64_t step = 1;
  for (std::uint64_t power = 1;; power *= 10) {
    for (const std::uint64_t times : {1u, 2u, 5u}) {
      step = times * power;
      if (top / step <= most) return step;
    }
  }
}

void summarise(HeatMap& map) {
  std::vector<std::uint64_t> sorted = map.counts;
  std::ranges::sort(sorted);
  map.mean = std::accumulate(sorted.begin(), sorted.end(), 0.0) / double(sorted.size());
  map.median = sorted[sorted.size() / 2], map.most = sorted.back();
  map.top = std::max<std::uint64_t>(1, sorted[(sorted.size() - 1) - (sorted.size() - 1) / 500]);
}

}  // namespace

HeatCount parse_heat_count(const std::string& word) {
  return HeatCount(index_of_name("heat map", word, kHeatCountNames));
}

HeatMap count_work(const BatchTracer& tracer, const RenderSettings& settings, HeatCount what) {
  if (!tracer.kernel().counts())
    throw UserError(std::string(tracer.kernel().structure) + " does not count its work: no heat map of it");
  HeatMap map{.width = settings.width,
              .height = settings.height,
              .counts = std::vector<std::uint64_t>(std::size_t(settings.width) * settings.height)};
  const RayGenerator camera(tracer.scene().camera(), settings.width, settings.height);
  const Shutter shutter = tracer.scene().shutter();
  const float time = tracer.scene().mesh().moves() ? 0.5f * (shutter.open + shutter.close) : 0.0f;
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, std::max(cores, settings.threads));
  tbb::task_arena arena(settings.threads == 0 ? tbb::task_arena::automatic : int(settings.threads));
  arena.execute([&] {
    tbb::parallel_for(0u, settings.height, [&](unsigned y) {
      for (unsigned x = 0; x < settings.width; ++x) {
        const Ray ray = camera.ray(x + 0.5, y + 0.5);
        Hit hit;
        Counters counters;
        tracer.kernel().closest_hit(tracer.accel(), RayBatch({&ray, 1}, {&time, 1}), {&hit, 1}, &counters);
        map.counts[std::size_t(y) * settings.width + x] =
            what == HeatCount::nodes ? counters.nodes : counters.triangles;
      }
    });
  });
  summarise(map);
  return map;
}

DrawnPicture draw(const HeatMap& map, const std::string& unit) {
  const std::string top = std::to_string(map.top) + (map.most > map.top ? "+" : "");
  const Layout at(map.width, map.height, unit, top);
  Sheet sheet(at.width, at.height);
  for (unsigned y = 0; y < map.height; ++y)
    for (unsigned x = 0; x < map.width; ++x)
      sheet.set(x, y, heat_color(double(map.counts[std::size_t(y) * map.width + x]) / double(map.top)));
  sheet.write(at.left, at.letter / 2, at.scale, unit);
  for (unsigned y = at.high; y <= at.low; ++y)
    sheet.fill(at.left, y, at.bar, 1, heat_color(double(at.low - y) / double(at.low - at.high)));
  for (const HeatTick& tick : heat_ticks(map.top, at.high, at.low, at.letter)) {
    sheet.fill(at.left + at.bar, tick.y, 3 * at.scale, at.scale, {0, 0, 0});
    sheet.write(at.left + at.bar + 5 * at.scale, tick.y - 3 * at.scale, at.scale,
                tick.count == map.top ? top : std::to_string(tick.count));
  }
  return sheet.take();
}

std::vector<HeatTick> heat_ticks(std::uint64_t top, unsigned high, unsigned low, unsigned letter) {
  const std::uint64_t step = tick_step(top, (low - high) / (letter + letter / 2));
  std::vector<HeatTick> ticks;
  for (std::uint64_t count = 0; count < top; count += step) {
    const auto y = unsigned(std::lround(double(low) - double(low - high) * double(count) / double(top)));
    if (y < high + letter) break;
    ticks.push_back({count, y});
  }
  ticks.push_back({top, high});
  return ticks;
}

std::array<unsigned, 2> drawn_size_at_most(unsigned width, unsigned height, const std::string& unit) {
  const Layout at(width, height, unit, std::to_string(std::numeric_limits<std::uint64_t>::max()) + "+");
  return {at.width, at.height};
}

}  // namespace arboretum
