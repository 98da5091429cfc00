// Workloads: order, counts, intervals, offsets, determinism. Primary hits come from a plain loop in double
// precision.
#include <array>

#include "core/error.h"
#include "rendering/workload.h"
#include "scenes/generators/generators.h"
#include "scenes/vec3d.h"
#include "tests/catch.h"

using namespace arboretum;

namespace {

/// The nearest triangle, one after the other.
Hit trace(const TriangleMesh& mesh, const Ray& ray) {
  Hit nearest;
  double best = ray.tfar;
  const Vec3d o(ray.origin), d(ray.direction);
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    const auto corners = mesh.corners(i);
    const Vec3d a(corners[0]), e1 = Vec3d(corners[1]) - a, e2 = Vec3d(corners[2]) - a;
    const Vec3d p = cross(d, e2), s = o - a, q = cross(s, e1);
    const double det = dot(e1, p);
    if (det == 0.0) continue;
    const double u = dot(s, p) / det, v = dot(d, q) / det, t = dot(e2, q) / det;
    if (u < 0.0 || v < 0.0 || u + v > 1.0 || t < ray.tnear || t > best) continue;
    best = t;
    nearest = Hit{float(t), float(u), float(v), i};
  }
  return nearest;
}

std::vector<Hit> trace_all(const TriangleMesh& mesh, const std::vector<Ray>& rays) {
  std::vector<Hit> hits;
  for (const Ray& ray : rays) hits.push_back(trace(mesh, ray));
  return hits;
}

bool same(const Ray& a, const Ray& b) {
  return a.origin == b.origin && a.direction == b.direction && a.tnear == b.tnear && a.tfar == b.tfar;
}
bool same(const std::vector<Ray>& a, const std::vector<Ray>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Ray& x, const Ray& y) { return same(x, y); });
}

/// A flat floor with a camera above, moved `far` along x, so that float32 has few digits left for it.
Scene floor_scene(float far) {
  Scene scene;
  scene.mesh.vertices = {{far - 10, 0, -10}, {far + 10, 0, -10}, {far + 10, 0, 10}, {far - 10, 0, 10}};
  scene.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.materials.emplace_back();
  scene.camera = Camera{.position = {far, 5, 9}, .look_at = {far, 0, 0}};
  return scene;
}

}  // namespace

TEST_CASE("primary rays come in Morton order, one a pixel, of unit length") {
  const Scene scene = floor_scene(0);
  const View view{.width = 13, .height = 6};
  const Workload primary = make_primary(scene, view);
  REQUIRE(primary.rays.size() == 13 * 6);
  CHECK(primary.query == Query::closest_hit);
  // In a picture of a power of two the ray of index i belongs to the pixel whose bits i interleaves.
  const Workload square = make_primary(scene, View{.width = 8, .height = 8});
  REQUIRE(square.rays.size() == 64);
  for (std::size_t i = 0; i < 64; ++i) {
    const unsigned x = unsigned((i & 1) | (i >> 1 & 2) | (i >> 2 & 4)),
                   y = unsigned((i >> 1 & 1) | (i >> 2 & 2) | (i >> 3 & 4));
    const Vec3d d(square.rays[i].direction);
    // The picture's plane lies at z = 1 of a frame that looks down from (0, 5, 9).
    const Vec3d forward = normalize(Vec3d{0, -5, -9}), up = normalize(Vec3d{0, 9, -5});
    const double scale = std::tan(20.0 * 3.14159265358979 / 180.0);
    CHECK(d.x / dot(d, forward) == Approx(scale * ((x + 0.5) / 4.0 - 1.0)).margin(1e-6));
    CHECK(dot(d, up) / dot(d, forward) == Approx(-scale * ((y + 0.5) / 4.0 - 1.0)).margin(1e-6));
  }
  for (const Ray& ray : primary.rays) {
    CHECK(length(Vec3d(ray.direction)) == Approx(1.0).margin(1e-6));
    CHECK(ray.tnear == 0.0f);
    CHECK(ray.tfar == Bounds3f::kInfinity);
  }
}

TEST_CASE("every workload: counts, intervals, unit directions, and the same rays for the same seed") {
  for (const char* name : {"cornell_box", "sphere_flake", "teapot_in_stadium", "needles"}) {
    const Scene scene = generate_scene(name, 400, 1);
    const View view{.width = 32, .height = 24, .seed = 5};
    const Workload primary = make_primary(scene, view);
    const std::vector<Hit> hits = trace_all(scene.mesh, primary.rays);
    const auto hit_count =
        std::size_t(std::count_if(hits.begin(), hits.end(), [](const Hit& h) { return h.is_hit(); }));
    REQUIRE(hit_count > 10);
    const double diagonal = length(Vec3d(scene.mesh.bounds().extent()));
    for (const std::string_view workload_name : workload_names()) {
      INFO(name << " " << workload_name);
      const Workload workload = make_workload(workload_name, scene, view, primary.rays, hits);
      CHECK(workload.name == workload_name);
      CHECK(workload.query == query_of(workload_name));
      CHECK(workload.rays.size() == (is_secondary(workload_name) ? hit_count : primary.rays.size()));
      CHECK(workload.batch().coherent == (workload_name == "primary"));
      for (const Ray& ray : workload.rays) {
        REQUIRE(is_valid(ray));
        REQUIRE(length(Vec3d(ray.direction)) == Approx(1.0).margin(1e-6));
        if (workload_name == "ambient_occlusion") REQUIRE(ray.tfar == Approx(0.2 * diagonal));
      }
      CHECK(same(workload.rays, make_workload(workload_name, scene, view, primary.rays, hits).rays));
      View other = view;
      other.seed = 6;
      const bool random =
          workload_name == "ambient_occlusion" || workload_name == "diffuse" || workload_name == "random";
      CHECK(same(workload.rays, make_workload(workload_name, scene, other, primary.rays, hits).rays) == !random);
    }
  }
}

TEST_CASE("secondary rays start on the side that they leave for, and never meet their own triangle") {
  std::vector<Scene> scenes;
  for (const char* name : {"cornell_box", "sphere_flake", "teapot_in_stadium", "needles", "city", "random_triangles"})
    scenes.push_back(generate_scene(name, 300, 1));
  for (const float far : {0.0f, 1e4f, 1e7f, -3e5f}) scenes.push_back(floor_scene(far));
  for (const Scene& scene : scenes) {
    const View view{.width = 40, .height = 40};
    const Workload primary = make_primary(scene, view);
    const std::vector<Hit> hits = trace_all(scene.mesh, primary.rays);
    std::vector<std::size_t> starts;
    for (std::size_t i = 0; i < hits.size(); ++i)
      if (hits[i].is_hit()) starts.push_back(i);
    for (const char* name : {"shadow", "ambient_occlusion", "reflection", "diffuse"}) {
      const Workload workload = make_workload(name, scene, view, primary.rays, hits);
      REQUIRE(workload.rays.size() == starts.size());
      std::size_t wrong_side = 0, behind = 0;
      for (std::size_t k = 0; k < starts.size(); ++k) {
        const auto corners = scene.mesh.corners(hits[starts[k]].primitive);
        const Vec3d a(corners[0]);
        Vec3d normal = cross(Vec3d(corners[1]) - a, Vec3d(corners[2]) - a);
        if (dot(normal, Vec3d(primary.rays[starts[k]].direction)) > 0.0) normal = normal * -1.0;
        const double side = dot(Vec3d(workload.rays[k].origin) - a, normal),
                     leaving = dot(Vec3d(workload.rays[k].direction), normal);
        wrong_side += !(side * leaving > 0.0);
        behind += side < 0.0;
      }
      INFO(name);
      CHECK(wrong_side == 0);
      if (std::string_view(name) != "shadow") CHECK(behind == 0);  // a light may be behind the surface, nothing else
    }
  }
}

TEST_CASE("shadow rays end at the light; reflections mirror; random chords cross the bounding sphere") {
  Scene scene = floor_scene(0);
  scene.lights.push_back(Light{.type = Light::Type::directional});
  scene.lights.push_back(Light{.position = {3, 7, 2}});
  const View view{.width = 16, .height = 16};
  const Workload primary = make_primary(scene, view);
  const std::vector<Hit> hits = trace_all(scene.mesh, primary.rays);
  for (const Ray& ray : make_workload("shadow", scene, view, primary.rays, hits).rays) {
    const Vec3d end = Vec3d(ray.origin) + Vec3d(ray.direction) * double(ray.tfar);
    CHECK(length(end - Vec3d(3, 7, 2)) < 1e-5);
  }
  const Workload reflection = make_workload("reflection", scene, view, primary.rays, hits);
  for (std::size_t i = 0, k = 0; i < hits.size(); ++i) {
    if (!hits[i].is_hit()) continue;
    const Vec3f in = primary.rays[i].direction, out = reflection.rays[k++].direction;
    CHECK(out.x == Approx(in.x).margin(1e-6));
    CHECK(out.y == Approx(-in.y).margin(1e-6));
    CHECK(out.z == Approx(in.z).margin(1e-6));
  }
  const double radius = 0.5 * length(Vec3d(scene.mesh.bounds().extent()));
  Vec3d mean;
  const Workload random = make_workload("random", scene, view, {}, {});
  for (const Ray& ray : random.rays) {
    const Vec3d from(ray.origin), to = from + Vec3d(ray.direction) * double(ray.tfar);
    CHECK(length(from) == Approx(radius).epsilon(1e-5));
    CHECK(length(to) == Approx(radius).epsilon(1e-5));
    mean = mean + from * (1.0 / double(random.rays.size()));
  }
  CHECK(length(mean) < 0.2 * radius);
}

TEST_CASE("directions about the normal follow the cosine") {
  const Scene scene = floor_scene(0);
  const View view{.width = 128, .height = 128};
  const Workload primary = make_primary(scene, view);
  const std::vector<Hit> hits = trace_all(scene.mesh, primary.rays);
  const Workload diffuse = make_workload("diffuse", scene, view, primary.rays, hits);
  double cosine = 0.0, square = 0.0, x = 0.0;
  for (const Ray& ray : diffuse.rays) {
    CHECK(ray.direction.y > 0.0f);
    cosine += ray.direction.y, square += double(ray.direction.y) * ray.direction.y, x += ray.direction.x;
  }
  const auto n = double(diffuse.rays.size());
  REQUIRE(n > 8000);
  CHECK(cosine / n == Approx(2.0 / 3.0).margin(0.01));
  CHECK(square / n == Approx(0.5).margin(0.01));
  CHECK(x / n == Approx(0.0).margin(0.02));
}

TEST_CASE("what a workload refuses") {
  const Scene scene = floor_scene(0);
  CHECK_THROWS_AS(make_workload("primry", scene, View{}, {}, {}), UserError);
  CHECK_THROWS_AS(is_secondary("x"), UserError);
  CHECK_THROWS_AS(query_of("x"), UserError);
  CHECK_THROWS_AS(make_primary(scene, View{.width = 0, .height = 4}), UserError);
  CHECK_THROWS_AS(make_primary(scene, View{.width = 4, .height = 100000}), UserError);
  CHECK_THROWS_AS(make_workload("diffuse", scene, View{}, std::array<Ray, 1>{}, {}), std::invalid_argument);
  CHECK(make_primary(scene, View{.width = 1, .height = 1}).rays.size() == 1);
}
