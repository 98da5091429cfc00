// What becomes of triangles that were read: what is dropped, a scene out of range, zero area, polygons in triangles.
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "core/instances.h"
#include "core/mesh_check.h"
#include "core/random.h"
#include "scenes/layout.h"
#include "scenes/polygon.h"
#include "scenes/rescale.h"
#include "scenes/sanitise.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("sanitising drops and counts, and keeps the order of the rest") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  Scene scene;
  scene.mesh.vertices = {{0, 0, 0},   {1, 0, 0},     {0, 1, 0}, {nan, 0, 0},
                         {0, inf, 0}, {2e12f, 0, 0}, {2, 0, 0}, {kMaxCoordinate, 0, 1}};
  scene.mesh.triangles = {{0, 1, 3}, {0, 1, 2}, {0, 4, 2}, {0, 5, 2}, {0, 1, 6}, {0, 0, 2}, {2, 1, 7}};
  scene.mesh.materials = {0, 1, 0, 0, 0, 0, 1};
  scene.materials.resize(2);
  sanitise(scene, "test");
  CHECK(scene.mesh.triangles == std::vector<Triangle>{{0, 1, 2}, {2, 1, 7}});
  CHECK(scene.mesh.materials == std::vector<std::uint16_t>{1, 1});
  CHECK(scene.report.triangles_read == 7);
  CHECK(scene.report.non_finite == 2);
  CHECK(scene.report.out_of_range == 1);
  CHECK(scene.report.degenerate == 2);
  CHECK(dropped_in_words(scene.report) ==
        "dropped 5 of 7 triangles: 2 with NaN or infinity, 1 out of range, 2 of zero area");
  sanitise(scene, "test");  // again, as of a placed scene
  CHECK(scene.report.triangles_read == 7);
  CHECK(dropped_in_words({.triangles_read = 7, .degenerate = 1}) == "dropped 1 of 7 triangles: 1 of zero area");
  CHECK(dropped_in_words({.triangles_read = 7}) == "");
  for (const Vec3f& v : scene.mesh.vertices) CHECK(is_finite(v));
}

namespace {

/// A triangle of `size` and one of about a thousandth of it, with camera, light and a second key frame.
Scene scene_of_size(float size) {
  Scene scene;
  scene.mesh.vertices = {{0, 0, 0}, {size, 0, 0}, {0, 0.75f * size, 0}, {0, 0, 1e-3f * size}, {1e-3f * size, 0, 0}};
  scene.mesh.triangles = {{0, 1, 2}, {0, 3, 4}};
  scene.mesh.later_frames = {scene.mesh.vertices};
  scene.camera = Camera{.position = {0, 0, 2 * size}, .aperture_radius = 0.5f * size, .focus_distance = size};
  scene.lights = {Light{.position = {size, 0, 0}, .intensity = {size, size, size}}};
  return scene;
}

}  // namespace

TEST_CASE("a scene out of range is multiplied by a power of two, exactly") {
  for (const int exponent : {-120, -100, -41, 41, 70, 100}) {
    INFO(exponent);
    const float size = std::ldexp(1.0f, exponent);
    Scene scene = scene_of_size(size);
    const Scene before = scene;
    rescale(scene, "test");
    const int by = scene.report.scaled_by;
    CHECK(by == -1 - exponent);
    REQUIRE(scene.report.warnings.size() == 1);
    CHECK(scene.report.warnings[0].find(fmt::format("multiplied by 2^{}", by)) != std::string::npos);
    for (std::size_t i = 0; i < scene.mesh.vertices.size(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        CHECK(double(scene.mesh.vertices[i][axis]) == std::ldexp(double(before.mesh.vertices[i][axis]), by));
        CHECK(scene.mesh.later_frames[0][i][axis] == scene.mesh.vertices[i][axis]);
      }
    CHECK(scene.camera->position.z == 1.0f);
    CHECK(scene.camera->aperture_radius == 0.25f);
    CHECK(scene.camera->focus_distance == 0.5f);
    CHECK(scene.lights[0].position.x == 0.5f);
    CHECK(double(scene.lights[0].intensity.x) == std::ldexp(double(before.lights[0].intensity.x), 2 * by));
    sanitise(scene, "test");
    CHECK(scene.mesh.size() == 2);
  }
}

TEST_CASE("the instances of a scene out of range lie where its flat mesh does") {
  const struct {
    double object, scale, apart;  ///< the size in object space, what the maps scale by, how far apart they put it
    std::size_t prototypes;       ///< that are left: one, or in world space one for each instance
  } cases[] = {
      {1e13, 1.0, 0.0, 1},    {1e13, 1.0, 3e13, 1},    {1.0, 1e13, 3e13, 1},    {1.0, 1e-13, 3e-13, 1},
      {1.0, 1e-38, 0.0, 1},   {1.0, 1e-41, 3e-41, 1},  {1.0, 1e-44, 0.0, 1},    {1e-41, 1.0, 0.0, 1},
      {1e-41, 1.0, 3e-41, 1}, {1e13, 1e-26, 3e-13, 3}, {1e13, 1e-54, 3e-41, 3}, {1e-13, 1e26, 3e13, 1},
      {1e30, 1.0, 3e30, 1},   {0x1p-149, 1.0, 0.0, 1}, {1.0, 0x1p-149, 0.0, 1}, {1e13, 1.0, 1e17, 1},
  };
  for (const auto& c : cases) {
    CAPTURE(c.object, c.scale, c.apart);
    TriangleMesh pyramid;
    for (const auto& v : kCorners)
      pyramid.vertices.push_back({float(v[0] * c.object), float(v[1] * c.object), float(v[2] * c.object)});
    for (const auto& f : kFaces)
      pyramid.triangles.push_back({std::uint32_t(f[0]), std::uint32_t(f[1]), std::uint32_t(f[2])});
    Layout layout;
    const std::uint32_t part = layout.add_part(pyramid);
    for (int i = 0; i < 3; ++i) {  // the first and the last unturned
      const double cosine = i == 1 ? 0.6 : 1.0, sine = i == 1 ? 0.8 : 0.0, s = c.scale;
      layout.place(part, {{{s * cosine, -s * sine, 0, i * c.apart}, {s * sine, s * cosine, 0, 0}, {0, 0, s, 0}}}, 0);
    }
    Scene scene;
    scene.mesh = layout.take(true);
    REQUIRE(scene.mesh.instancing);
    const Instancing before = *scene.mesh.instancing;
    rescale(scene, "test");
    const int by = scene.report.scaled_by;
    CHECK(by != 0);
    sanitise(scene, "test");
    REQUIRE(scene.mesh.size() == 12);
    CHECK_NOTHROW(check_instances(scene.mesh));
    const Instancing& after = *scene.mesh.instancing;
    CHECK(after.prototypes.size() == c.prototypes);
    REQUIRE(after.instances.size() == 3);
    for (std::size_t i = 0; i < 12; ++i) {
      AffineMap map = before.instances[i / 4].to_world;
      for (auto& row : map.m)
        for (double& m : row) m = std::ldexp(m, by);
      const Instance& instance = after.instances[i / 4];
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3f flat = scene.mesh.corners(i)[k];
        // Where the scene is scaled up, nothing of what subnormal numbers lose.
        CHECK(flat == transform_point(map, pyramid.corners(i % 4)[k]));
        CHECK(flat == transform_point(instance.to_world, after.prototypes[instance.prototype].corners(i % 4)[k]));
      }
    }
  }
}

TEST_CASE("a scene stays as it is where a power of two would not save it") {
  const auto unchanged = [](Scene scene) {
    const TriangleMesh before = scene.mesh;
    rescale(scene, "test");
    CHECK(scene.report.scaled_by == 0);
    CHECK(scene.report.warnings.empty());
    return scene.mesh.vertices == before.vertices;
  };
  for (const int exponent : {-40, 0, 40}) CHECK(unchanged(scene_of_size(std::ldexp(1.0f, exponent))));
  // A few triangles far out are dropped instead.
  Scene stray = scene_of_size(1.0f);
  stray.mesh.vertices.push_back({0, 0x1p80f, 0});
  stray.mesh.later_frames.clear();
  stray.mesh.triangles.resize(99, Triangle{0, 1, 2});
  stray.mesh.triangles.push_back({0, 1, 5});
  CHECK(unchanged(stray));
  // From 2^-120 to 2^100: the small coordinates would lose bits.
  Scene wide = scene_of_size(0x1p100f);
  wide.mesh.later_frames.clear();
  wide.mesh.vertices[4].x = 0x1p-120f;
  CHECK(unchanged(wide));
  Scene lost = wide;
  CHECK_THROWS_AS(sanitise(lost, "test"), UserError);
  // From 2^-64 to 2^100 there is room above 1.
  wide.mesh.vertices[4].x = 0x1p-64f;
  rescale(wide, "test");
  CHECK(wide.report.scaled_by == -62);
  // Nothing to go by.
  CHECK(unchanged(Scene{}));
}

TEST_CASE("zero area is decided exactly") {
  const float one_up = std::nextafter(1.0f, 2.0f), tiny = 1e-45f;
  const struct {
    Vec3f a, b, c;
    bool zero;
  } cases[] = {
      {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, false},
      {{0, 0, 0}, {1, 1, 1}, {3, 3, 3}, true},
      {{0, 0, 0}, {1, 1, 1}, {3, 3, std::nextafter(3.0f, 4.0f)}, false},
      {{0.1f, 0.1f, 0.1f},
       {0.2f, 0.2f, 0.2f},
       {0.3f, 0.3f, 0.3f},
       true},  // on x = y = z, whatever rounding did to them
      {{0.1f, 0.2f, 0.3f}, {0.2f, 0.4f, 0.6f}, {0.4f, 0.8f, 1.2f}, true},  // multiples by powers of two
      {{1, 1, 0}, {one_up, one_up, 0}, {1, one_up, 0}, false},
      {{0, 0, 0}, {tiny, 0, 0}, {0, tiny, 0}, false},                         // area 1e-90
      {{kMaxCoordinate, 0, 0}, {kMaxCoordinate, tiny, 0}, {0, 0, 0}, false},  // the difference is not a double
      {{kMaxCoordinate, tiny, 0}, {0, tiny, 0}, {-1, tiny, 0}, true},
      {{1, 2, 3}, {1, 2, 3}, {4, 5, 6}, true},
      {{0, 0, 0}, {-0.0f, 0, 0}, {1, 1, 1}, true},
  };
  for (const auto& t : cases) {
    CAPTURE(t.b.x, t.c.z);
    CHECK(has_zero_area(t.a, t.b, t.c) == t.zero);
    CHECK(has_zero_area(t.c, t.a, t.b) == t.zero);
    CHECK(has_zero_area(t.b, t.a, t.c) == t.zero);
  }
}

TEST_CASE("polygons: any simple one is covered exactly once") {
  const std::vector<std::vector<std::array<float, 2>>> polygons{
      {{0, 0}, {1, 0}, {1, 1}, {0, 1}},
      {{0, 0}, {4, 0}, {4, 4}, {3, 1}},          // concave quad, either diagonal but one fails
      {{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}},  // collinear corners
      {{0, 0}, {5, 0}, {5, 5}, {4, 5}, {4, 1}, {3, 1}, {3, 5}, {2, 5}, {2, 1}, {1, 1}, {1, 5}, {0, 5}},  // a comb
  };
  for (const auto& polygon : polygons) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool reversed : {false, true}) {
        std::vector<Vec3f> vertices;
        std::vector<std::uint32_t> corners;
        double area = 0.0;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
          const auto& p = polygon[reversed ? polygon.size() - 1 - i : i];
          const auto& q = polygon[(i + 1) % polygon.size()];
          area += 0.5 * (double(polygon[i][0]) * q[1] - double(q[0]) * polygon[i][1]);
          Vec3f v;
          v[std::size_t(axis)] = p[0], v[std::size_t((axis + 1) % 3)] = p[1], v[std::size_t((axis + 2) % 3)] = 7;
          vertices.push_back(v);
          corners.push_back(std::uint32_t(i));
        }
        std::vector<Triangle> triangles;
        triangulate(corners, vertices, triangles);
        CHECK(triangles.size() == polygon.size() - 2);
        double covered = 0.0;
        for (const Triangle& t : triangles)
          covered += 0.5 * length(cross(vertices[t.b] - vertices[t.a], vertices[t.c] - vertices[t.a]));
        CHECK(covered == Approx(area));
      }
    }
  }
}

TEST_CASE("polygons: the work on one is quadratic, whatever its corners hide") {
  for (const std::uint32_t n : {256u, 512u, 1024u}) {
    // A zigzag band: each tooth's triangle holds the tip of a tooth of the other side, at the far end of the list
    std::vector<Vec3f> vertices;
    for (std::uint32_t i = 0; i < n / 2; ++i) vertices.push_back({float(i), i % 2 ? -10.0f : 0.0f, 0});
    for (std::uint32_t i = n / 2; i-- > 0;) vertices.push_back({float(i), i % 2 ? -9.0f : 1.0f, 0});
    std::vector<std::uint32_t> corners(n);
    std::iota(corners.begin(), corners.end(), 0u);
    std::vector<Triangle> triangles;
    const std::size_t tests = triangulate(corners, vertices, triangles);
    CAPTURE(n, tests);
    CHECK(tests > 0);
    CHECK(tests <= 4 * std::size_t{n} * n);
    CHECK(triangles.size() == n - 2);
    double covered = 0.0;
    for (const Triangle& t : triangles)
      covered += 0.5 * length(cross(vertices[t.b] - vertices[t.a], vertices[t.c] - vertices[t.a]));
    CHECK(covered == Approx(n / 2 - 1));
  }
}
