// How rays leave surfaces: the five ways, what they do to the rays, that primitives are passed through, and that what
// is counted of them is right.
#include <map>
#include <string>
#include <vector>

#include "experiments/exclusion.h"
#include "experiments/scene_data.h"
#include "rendering/surface_point.h"
#include "rendering/workload.h"
#include "scenes/scene.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr SelfIntersection kWays[] = {SelfIntersection::none, SelfIntersection::epsilon,
                                      SelfIntersection::integer_offset, SelfIntersection::error_bound,
                                      SelfIntersection::exclusion};

SceneChoice sphere(std::size_t triangles, double offset) {
  const SceneSpec spec = parse_scene_word(std::string("sphere:").append(std::to_string(triangles)));
  return {.spec = spec, .name = "sphere", .placing = {.offset = offset, .label = offset == 0.0 ? "" : ":offset"}};
}

const MeasureSettings kSmall{.repetitions = 1, .width = 64, .height = 64};

SceneData data_of(const SceneChoice& choice) {
  return {choice, kSmall, [](const std::string&) {}};
}

}  // namespace

TEST_CASE(
    "the offset of Waechter and Binder: steps of the number format, away from zero and towards it, and a fixed one "
    "near zero") {
  struct Case {
    float p, n, expected;
  };
  const Case cases[] = {{1.0f, 1.0f, 1.0f + 256 * 0x1p-23f},
                        {-1.0f, -1.0f, -1.0f - 256 * 0x1p-23f},
                        {1.0f, -0.5f, 1.0f - 128 * 0x1p-24f},
                        {1024.0f, 0.25f, 1024.0f + 64 * 0x1p-13f},
                        {0.03125f, 1.0f, 0.03125f + 256 * 0x1p-28f},
                        {0.03f, 1.0f, 0.03f + 0x1p-16f},
                        {0.0f, -1.0f, -0x1p-16f},
                        {5.0f, 0.0f, 5.0f}};
  for (const Case& c : cases) {
    INFO(c.p << " along " << c.n);
    CHECK(integer_offset({c.p, c.p, c.p}, {c.n, c.n, c.n}) == Vec3f{c.expected, c.expected, c.expected});
  }
}

TEST_CASE("every way has the same rays from the same hits, but for where they begin") {
  SceneData data = data_of(sphere(500, 100.0));
  for (const char* name : {"shadow", "ambient_occlusion", "reflection", "diffuse"}) {
    const Workload& usual = data.workload(name);
    REQUIRE(usual.rays.size() > 500);
    for (SelfIntersection way : kWays) {
      INFO(name << " " << to_string(way));
      const Workload& workload = data.workload(name, {way, 0.01});
      REQUIRE(workload.rays.size() == usual.rays.size());
      CHECK(workload.excludes_sources == (way == SelfIntersection::exclusion));
      CHECK(workload.sources == usual.sources);
      CHECK(workload.starts == usual.starts);
      std::size_t off_point = 0, turned = 0, wrong_tnear = 0;
      const Bounds3f box = data.mesh().bounds();
      const auto diagonal = float(length(Vec3d(box.upper) - Vec3d(box.lower)));
      for (std::size_t i = 0; i < usual.rays.size(); ++i) {
        const Ray &ray = workload.rays[i], &reference = workload.references[i];
        off_point += !(ray.origin == reference.origin);
        turned += dot(Vec3d(ray.direction), Vec3d(reference.direction)) < 1.0 - 1e-3;
        wrong_tnear += ray.tnear != (way == SelfIntersection::epsilon ? Approx(0.01f * diagonal) : Approx(0.0f));
      }
      const bool moves = way == SelfIntersection::integer_offset || way == SelfIntersection::error_bound;
      CHECK(off_point == (moves ? usual.rays.size() : 0));
      CHECK(turned == 0);
      CHECK(wrong_tnear == 0);
    }
  }
}

TEST_CASE("what is counted of starts: table") {
  const auto exact = [](double t, std::uint32_t id) {
    return ExactHit{id == kNoPrimitive ? Hit{} : Hit{float(t), 0, 0, id}, t, false};
  };
  const auto given = [](float t, std::uint32_t id) { return Hit{t, 0, 0, id}; };
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  struct Case {
    ExactHit truth;
    Hit answer;
    std::uint64_t self, near, leak;
  };
  const Case cases[] = {{exact(1, 5), given(1, 5), 0, 0, 0},      {exact(1, 5), given(0.5f, 5), 0, 0, 0},
                        {exact(1, 5), given(1e-6f, 7), 1, 0, 0},  {exact(0, kNoPrimitive), given(1e-6f, 7), 1, 0, 0},
                        {exact(1, 5), given(0.5f, 6), 0, 1, 0},   {exact(0, kNoPrimitive), given(3, 6), 0, 1, 0},
                        {exact(1, 5), given(2, 6), 0, 0, 1},      {exact(1, 5), Hit{}, 0, 0, 1},
                        {exact(0, kNoPrimitive), Hit{}, 0, 0, 0}, {exact(1, 5), given(1.0001f, 6), 0, 0, 0},
                        {exact(1, 5), given(nan, 6), 0, 1, 0},    {exact(0, kNoPrimitive), given(nan, 6), 0, 1, 0}};
  const std::uint32_t source = 7;
  for (const Case& c : cases) {
    INFO(c.truth.t << " " << c.truth.hit.primitive << " answered " << c.answer.t << " " << c.answer.primitive);
    const StartCheck check =
        check_closest_starts(std::span(&c.truth, 1), std::span(&c.answer, 1), std::span(&source, 1));
    CHECK(check.rays == 1);
    CHECK(check.self_hits == c.self);
    CHECK(check.near_hits == c.near);
    CHECK(check.leaks == c.leak);
    const std::uint8_t occluded = c.answer.is_hit();
    const StartCheck any = check_any_starts(std::span(&c.truth, 1), std::span(&occluded, 1));
    CHECK(any.self_hits == std::uint64_t(occluded && !c.truth.hit.is_hit()));
    CHECK(any.leaks == std::uint64_t(!occluded && c.truth.hit.is_hit()));
  }
  CHECK_THROWS_AS(check_any_starts(std::vector<ExactHit>(2), std::vector<std::uint8_t>(1)), std::invalid_argument);
}

TEST_CASE("a convex surface is left by offsets and exclusion, and met again without; far away by a fixed epsilon too") {
  struct Rates {
    double self, near, leaks;
  };
  // With exact answers what is counted is the start's own fault; nothing lies outside a sphere, so every hit is false.
  const auto rates = [](SceneData& data, SelfIntersection way) {
    const Workload& workload = data.workload("diffuse", {way});
    const Oracle oracle(data.mesh());
    std::vector<Hit> hits;
    for (const ExactHit& h : workload.excludes_sources
                                 ? closest_hit_excluding(oracle, workload.batch(), workload.sources)
                                 : oracle.closest_hit(workload.batch()))
      hits.push_back(h.hit);
    const StartCheck check = data.check_starts(workload, hits);
    return Rates{double(check.self_hits) / double(check.rays), double(check.near_hits) / double(check.rays),
                 double(check.leaks) / double(check.rays)};
  };
  SceneData near = data_of(sphere(2000, 0.0)), far = data_of(sphere(2000, 1e4));
  for (SceneData* data : {&near, &far}) {
    INFO((data == &near ? "near" : "far"));
    CHECK(rates(*data, SelfIntersection::none).self == Approx(0.5).margin(0.05));
    for (SelfIntersection way : {SelfIntersection::integer_offset, SelfIntersection::error_bound}) {
      const Rates r = rates(*data, way);
      CHECK((r.self == 0.0 && r.near == 0.0 && r.leaks == 0.0));
    }
    CHECK(rates(*data, SelfIntersection::exclusion).self == 0.0);
  }
  CHECK(rates(near, SelfIntersection::exclusion).near == 0.0);
  CHECK(rates(far, SelfIntersection::exclusion).near > 0.001);  // neighbours: not the primitive that is left out
  CHECK(rates(near, SelfIntersection::epsilon).self == 0.0);
  CHECK(rates(far, SelfIntersection::epsilon).self > 0.05);
  CHECK(near.start_distance(near.workload("diffuse")) < 1e-5);
  CHECK(far.start_distance(far.workload("diffuse", {SelfIntersection::integer_offset})) >
        10 * far.start_distance(far.workload("diffuse")));
}

TEST_CASE("kernels that know nothing of it pass through excluded primitives, whatever their way of traversal") {
  SceneData data = data_of({.spec = parse_scene_word("cornell_box:600"), .name = "box"});
  const Oracle oracle(data.mesh());
  Structures structures(data.mesh());
  std::map<std::string, std::pair<std::vector<ExactHit>, std::size_t>> truth;
  for (const char* name : {"diffuse", "ambient_occlusion"}) {
    const Workload& workload = data.workload(name, {SelfIntersection::exclusion});
    auto& [exact, own] = truth[name];
    exact = closest_hit_excluding(oracle, workload.batch(), workload.sources);
    const std::vector<ExactHit> plain = oracle.closest_hit(workload.batch());
    for (std::size_t i = 0; i < plain.size(); ++i) own += plain[i].hit.primitive == workload.sources[i];
    CHECK(own > workload.rays.size() / 10);
    for (std::size_t i = 0; i < exact.size(); ++i) CHECK(exact[i].hit.primitive != workload.sources[i]);
  }
  std::size_t rows = 0;
  for (const KernelRow& row : runnable_rows()) {
    if (row.structure != "bvh8" || row.intersector != "exact" || row.box != "padded") continue;
    ++rows;
    const Accel& accel = structures.get(row);
    INFO(name_of(row));
    const Workload& diffuse = data.workload("diffuse", {SelfIntersection::exclusion});
    std::vector<Hit> hits(diffuse.rays.size());
    closest_hit_excluding(row, accel, diffuse.batch(), diffuse.sources, hits);
    const Workload& occlusion = data.workload("ambient_occlusion", {SelfIntersection::exclusion});
    std::vector<std::uint8_t> occluded(occlusion.rays.size());
    any_hit_excluding(row, accel, occlusion.batch(), occlusion.sources, occluded);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) wrong += hits[i].primitive != truth["diffuse"].first[i].hit.primitive;
    for (std::size_t i = 0; i < occluded.size(); ++i)
      wrong += (occluded[i] != 0) != truth["ambient_occlusion"].first[i].hit.is_hit();
    CHECK(wrong == 0);
    // Nothing excluded: nothing changes.
    const std::vector<std::uint32_t> none(hits.size(), kNoPrimitive);
    std::vector<Hit> plain(hits.size()), passed(hits.size());
    row.closest_hit(accel, diffuse.batch(), plain);
    closest_hit_excluding(row, accel, diffuse.batch(), none, passed);
    CHECK(std::equal(plain.begin(), plain.end(), passed.begin(),
                     [](const Hit& a, const Hit& b) { return a.primitive == b.primitive && a.t == b.t; }));
  }
  CHECK(rows > 0);
}

TEST_CASE("exact answers of rays from points with more digits than float32 has") {
  // Two faces a float's step apart, and a start between them.
  TriangleMesh mesh;
  const float upper = std::nextafter(1.0f, 2.0f);
  for (float z : {1.0f, upper}) {
    const auto first = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{-1, -1, z}, {2, -1, z}, {-1, 2, z}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const Oracle oracle(mesh);
  const double between = 1.0 + 0x1p-25;
  const std::array<double, 3> start{0.1, 0.1, between};
  for (float direction : {1.0f, -1.0f}) {
    const Ray ray{.origin = {0.1f, 0.1f, 1.0f}, .direction = {0, 0, direction}};
    const auto from = [&](std::uint32_t left_out) {
      return oracle.closest_hit_from(std::span(&start, 1), std::span(&ray, 1), std::span(&left_out, 1)).front();
    };
    const ExactHit hit = from(kNoPrimitive);
    CHECK(hit.hit.primitive == (direction > 0 ? 1u : 0u));
    CHECK(hit.t == (direction > 0 ? double(upper) - between : between - 1.0));
    CHECK_FALSE(from(direction > 0 ? 1u : 0u).hit.is_hit());
  }
  // Along its own direction a start moves t by as much, exactly: every ray of a scene, from a point between floats.
  const Scene scene = load_scene(parse_scene_word("sphere_flake:3000"));
  const Oracle flake(scene.mesh);
  const Workload primary = make_primary(scene, {.width = 32, .height = 32});
  const std::vector<ExactHit> plain = flake.closest_hit(primary.rays);
  std::vector<std::array<double, 3>> starts;
  constexpr double kAlong = 0x1p-20;
  for (const Ray& r : primary.rays)
    starts.push_back({r.origin.x + kAlong * r.direction.x, r.origin.y + kAlong * r.direction.y,
                      r.origin.z + kAlong * r.direction.z});
  const std::vector<std::uint32_t> nothing(starts.size(), kNoPrimitive);
  const std::vector<ExactHit> moved = flake.closest_hit_from(starts, primary.rays, nothing);
  std::size_t hits = 0;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    REQUIRE(plain[i].hit.primitive == moved[i].hit.primitive);
    if (!plain[i].hit.is_hit()) continue;
    ++hits;
    CHECK(moved[i].t == Approx(plain[i].t - kAlong).epsilon(1e-14));
    // Left out, it is passed through.
    const auto beyond = flake.closest_hit_from(std::span(&starts[i], 1), std::span(&primary.rays[i], 1),
                                               std::span(&plain[i].hit.primitive, 1));
    CHECK(beyond[0].hit.primitive != plain[i].hit.primitive);
    CHECK((!beyond[0].hit.is_hit() || beyond[0].t >= moved[i].t));
  }
  CHECK(hits > 200);
  CHECK_THROWS_AS(flake.closest_hit_from(starts, primary.rays, {}), std::invalid_argument);
}
