// Generators: scenes made by rule, at any triangle count, with the same bits on every machine and run (only +
// - * / and sqrt in double, results rounded to float32, counter-based random numbers).
//
// A count that a shape cannot have is met as nearly as it can; `rule` of GeneratorInfo says how.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/scene.h"

namespace arboretum {

struct GeneratorInfo {
  std::string_view name;
  std::string_view summary;  ///< one line for `list`
  std::string_view rule;     ///< which triangle counts it can make
  bool takes_seed = false;   ///< whether the seed changes anything
  bool moves = false;        ///< whether it has key frames
};

[[nodiscard]] std::span<const GeneratorInfo> generators();
[[nodiscard]] std::vector<std::string> generator_names();

/// Most triangles that a generator makes.
inline constexpr std::size_t kMaxGeneratedTriangles = 500'000'000;

/// What generate_scene() refuses, without generating.
void check_generated(std::string_view name, std::size_t triangles, std::uint64_t seed);
/// Throws UserError for an unknown name, a count of 0 or beyond kMaxGeneratedTriangles, or a seed other than
/// 1 where the generator takes none.
[[nodiscard]] Scene generate_scene(std::string_view name, std::size_t triangles, std::uint64_t seed);

// One function a generator; `triangles` is at least 1. The scene has a camera and materials; its name is left
// empty.
[[nodiscard]] Scene generate_sphere(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_fan(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_sphere_flake(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_fractal_terrain(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_random_triangles(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_needles(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_city(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_teapot_in_stadium(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_cornell_box(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_forest(std::size_t triangles, std::uint64_t seed);
[[nodiscard]] Scene generate_waving_cloth(std::size_t triangles, std::uint64_t seed);

}  // namespace arboretum
