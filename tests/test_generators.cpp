// Generators: counts, soundness, and the same bits for ever.
#include "core/error.h"
#include "scenes/camera.h"
#include "scenes/generators/generators.h"
#include "scenes/inspect.h"
#include "scenes/sanitise.h"
#include "tests/catch.h"
#include "tests/golden_hash.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

std::uint64_t hash(const TriangleMesh& mesh) {
  GoldenHash h{mesh.size()};
  h.add(mesh);
  return h.value;
}

}  // namespace

TEST_CASE("every generator makes the count asked for, of sound triangles") {
  for (const GeneratorInfo& generator : generators()) {
    const bool even = generator.rule.starts_with("closed");
    for (const std::size_t count :
         {1, 2, 3, 5, 6, 7, 11, 12, 13, 14, 23, 24, 25, 26, 37, 59, 60, 61, 100, 257, 1000, 1001, 4999, 20000}) {
      INFO(generator.name << " " << count);
      const Scene scene = generate_scene(generator.name, count, 1);
      CHECK(scene.mesh.size() == (even ? std::max<std::size_t>(6, count / 2 * 2) : count));
      CHECK(scene.report.warnings.empty() == (scene.mesh.size() == count));
      CHECK(scene.report.degenerate + scene.report.non_finite + scene.report.out_of_range == 0);
      CHECK(scene.mesh.materials.size() == (scene.mesh.materials.empty() ? 0 : scene.mesh.size()));
      for (const std::uint16_t m : scene.mesh.materials) REQUIRE(m < scene.materials.size());
      REQUIRE(scene.camera);
      for (const Triangle& t : scene.mesh.triangles) REQUIRE(std::max({t.a, t.b, t.c}) < scene.mesh.vertices.size());
    }
  }
}

TEST_CASE("a generator that makes another count than asked for says so") {
  CHECK(generate_scene("sphere", 1, 1).report.warnings ==
        std::vector<std::string>{"sphere:1 has 6 triangles, not 1 (closed: the next lower even count, 6 at least)"});
}

// Golden hashes: a change here changes every measurement made on these scenes; say so in the change log.
TEST_CASE("generated scenes have the same bits on every run and machine") {
  const struct {
    const char* name;
    std::size_t triangles;
    std::uint64_t seed, expected;
  } cases[] = {
      {"sphere", 1000, 1, 0xfec23bfd280d0b9dull},         {"fan", 1000, 1, 0x806a29c92ec18f82ull},
      {"sphere_flake", 5000, 1, 0x5c365d32ce2967cbull},   {"fractal_terrain", 5000, 1, 0x7d61a4db53e0d88full},
      {"fractal_terrain", 777, 9, 0xc41f00f35c28ae89ull}, {"random_triangles", 1000, 1, 0xba670cf19c230899ull},
      {"needles", 1000, 1, 0x4bc5fd3219ba7337ull},        {"city", 3000, 1, 0xa74c70b7b235ddf6ull},
      {"city", 3000, 4, 0xa4e4e0eec65e5978ull},           {"teapot_in_stadium", 3000, 1, 0x3ce469b75e1c2688ull},
      {"cornell_box", 1500, 1, 0x5043ca05e3199b81ull},    {"forest", 3000, 1, 0x79caeb8124e7d55dull},
      {"waving_cloth", 1000, 1, 0xa32ad3024a9cc35dull},
  };
  for (const GeneratorInfo& generator : generators()) {
    INFO(generator.name);
    CHECK(std::ranges::count_if(cases, [&](const auto& c) { return c.name == generator.name; }) > 0);
  }
  for (const auto& c : cases) {
    const std::uint64_t found = hash(generate_scene(c.name, c.triangles, c.seed).mesh);
    CAPTURE(c.name, c.triangles, c.seed);
    CHECK(found == c.expected);
  }
}

TEST_CASE("the seed changes what it should, and is refused where it changes nothing") {
  for (const GeneratorInfo& generator : generators()) {
    INFO(generator.name);
    if (generator.takes_seed) {
      CHECK(hash(generate_scene(generator.name, 500, 1).mesh) != hash(generate_scene(generator.name, 500, 2).mesh));
    } else {
      CHECK_THROWS_AS(generate_scene(generator.name, 500, 2), UserError);
    }
    CHECK_THROWS_AS(generate_scene(generator.name, 0, 1), UserError);
    CHECK_THROWS_AS(generate_scene(generator.name, kMaxGeneratedTriangles + 1, 1), UserError);
  }
  CHECK_THROWS_AS(generate_scene("sphere_flak", 500, 1), UserError);
}

TEST_CASE("closed shapes are closed and face outwards") {
  for (const char* name : {"sphere", "sphere_flake", "fan"}) {
    for (const std::size_t count : {6, 8, 10, 100, 3968, 10000}) {
      INFO(name << " " << count);
      const Scene scene = generate_scene(name, count, 1);
      CHECK(inspect_scene(scene).closed);
      double volume = 0.0;
      for (std::size_t i = 0; i < scene.mesh.size(); ++i) {
        const auto [a, b, c] = scene.mesh.corners(i);
        volume += dot(Vec3d(a), cross(Vec3d(b), Vec3d(c))) / 6.0;
      }
      CHECK(volume > 0.3);
    }
  }
  // 64 slices and 32 stacks: rings of equal length where the count allows them.
  CHECK(generate_scene("sphere", 3968, 1).mesh.vertices.size() == 64 * 31 + 2);
}

TEST_CASE("shapes have the scale that their names promise") {
  const Scene stadium = generate_scene("teapot_in_stadium", 20000, 1);
  CHECK(stadium.mesh.bounds().extent().x == Approx(1e6));
  Bounds3f pot;
  for (std::size_t i = 0; i < stadium.mesh.size(); ++i)
    if (stadium.mesh.materials[i] == 1) pot.extend(stadium.mesh.bounds(i));
  CHECK(pot.extent().x == Approx(1.5).margin(0.3));
  CHECK(inspect_scene(generate_scene("needles", 2000, 1)).slivers == 2000);
  CHECK(inspect_scene(generate_scene("random_triangles", 2000, 1)).slivers < 40);
  const SceneInfo box = inspect_scene(generate_scene("cornell_box", 2000, 1));
  for (const std::string_view name : {"dielectric", "mirror", "glossy", "shadow_soft"}) {
    INFO(name);
    CHECK(std::ranges::count_if(box.effects, [&](const Effect& e) { return e.name == name && e.called_for; }) == 1);
  }
}

TEST_CASE("a camera ray's direction has unit length and mirrors with mirror_x") {
  Camera camera{.position = {1, 2, 3}, .look_at = {1, 2, 0}, .vertical_fov = 90};
  const RayGenerator rays(camera, 200, 100);
  CHECK(rays.ray(100, 50).direction == Vec3f{0, 0, -1});
  const Vec3f corner = rays.ray(0, 0).direction;  // the upper left: half a picture up, one to the left
  CHECK(corner.x / corner.z == Approx(2));
  CHECK(corner.y / corner.z == Approx(-1));
  CHECK(corner.x < 0);
  CHECK(length(corner) == Approx(1));
  camera.mirror_x = true;
  CHECK(RayGenerator(camera, 200, 100).ray(0, 0).direction.x == -corner.x);

  Bounds3f bounds;
  bounds.extend(Vec3f{-1, -2, -3}), bounds.extend(Vec3f{4, 5, 6});
  const Camera framed = frame_bounds(bounds);
  CHECK(length(framed.position - framed.look_at) > 0.5f * length(bounds.extent()));
  CHECK(framed.look_at == bounds.center());
}

TEST_CASE("sine and cosine by turns") {
  for (int i = -40; i <= 40; ++i) {
    const double turns = i / 13.0;
    const UnitCircle c(turns);
    CHECK(c.cosine == Approx(std::cos(turns * 6.283185307179586)).margin(1e-14));
    CHECK(c.sine == Approx(std::sin(turns * 6.283185307179586)).margin(1e-14));
  }
  CHECK(UnitCircle(1.0).sine == 0.0);
  CHECK(UnitCircle(0.25).cosine == 0.0);
  CHECK(UnitCircle(0.5).cosine == -1.0);
}
