#include "scenes/generators/generators.h"

#include <fmt/format.h>

#include "core/error.h"
#include "core/names.h"
#include "scenes/sanitise.h"

namespace arboretum {
namespace {

using Generate = Scene (*)(std::size_t, std::uint64_t);

constexpr std::string_view kExact = "exactly the count asked for";
constexpr std::string_view kEven = "closed: the next lower even count, 6 at least";

constexpr GeneratorInfo kInfos[] = {
    {"sphere_flake", "spheres on spheres, nine a third as large on each, closed surfaces", kEven, false},
    {"fractal_terrain", "a height field of ridged noise, ten octaves and more", kExact, true},
    {"random_triangles", "a soup of triangles of like size in a cube", kExact, true},
    {"needles", "long thin triangles of any direction, the worst for boxes", kExact, true},
    {"city", "towers of boxes on a ground plane, streets between", kExact, true},
    {"teapot_in_stadium", "a teapot of one unit in a stadium a million units wide", kExact, false},
    {"cornell_box", "a box with a lamp, a glass sphere, a mirror sphere, a metal and a matt block", kExact, false},
    {"sphere", "a closed sphere of latitude and longitude lines, poles as fans", kEven, false},
    {"fan", "two fans base to base: closed, half of the triangles at each of two vertices", kEven, false},
    {"forest", "about a thousand instances of four trees on a ground; for two_level", kExact, true},
    {"waving_cloth", "a curtain that waves and a ball that flies past, in five key frames; for bvh4_motion", kExact,
     false, true},
};
constexpr Generate kFunctions[] = {
    generate_sphere_flake,      generate_fractal_terrain, generate_random_triangles, generate_needles, generate_city,
    generate_teapot_in_stadium, generate_cornell_box,     generate_sphere,           generate_fan,     generate_forest,
    generate_waving_cloth};
static_assert(std::size(kInfos) == std::size(kFunctions));

}  // namespace

std::span<const GeneratorInfo> generators() { return kInfos; }

std::vector<std::string> generator_names() {
  std::vector<std::string> names;
  for (const GeneratorInfo& info : kInfos) names.emplace_back(info.name);
  return names;
}

namespace {

/// The generator's place in the table.
std::size_t checked(std::string_view name, std::size_t triangles, std::uint64_t seed) {
  for (std::size_t i = 0; i < std::size(kInfos); ++i) {
    if (kInfos[i].name != name) continue;
    if (triangles == 0 || triangles > kMaxGeneratedTriangles)
      throw UserError(
          fmt::format("generator {}: triangles: {} is not within 1 to {}", name, triangles, kMaxGeneratedTriangles));
    if (seed != 1 && !kInfos[i].takes_seed)
      throw UserError(fmt::format(
          "generator {}: seed: {} would change nothing, since its shape has nothing random; leave it out", name, seed));
    return i;
  }
  throw UserError(unknown_name_message("generator", name, generator_names()));
}

}  // namespace

void check_generated(std::string_view name, std::size_t triangles, std::uint64_t seed) {
  static_cast<void>(checked(name, triangles, seed));
}

Scene generate_scene(std::string_view name, std::size_t triangles, std::uint64_t seed) {
  const std::size_t place = checked(name, triangles, seed);
  Scene scene = kFunctions[place](triangles, seed);
  if (const std::size_t made = scene.mesh.size(); made != triangles)
    scene.report.warnings.push_back(
        fmt::format("{}:{} has {} triangles, not {} ({})", name, triangles, made, triangles, kInfos[place].rule));
  sanitise(scene, fmt::format("generator {}", name));
  return scene;
}

}  // namespace arboretum
