// The check of given answers against exact ones: every counter of AnswerCheck, with answers made wrong on
// purpose.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "oracle/oracle.h"
#include "tests/catch.h"
#include "tests/small_meshes.h"

using namespace arboretum;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

std::vector<Hit> hits_of(const std::vector<ExactHit>& truth) {
  std::vector<Hit> hits;
  for (const ExactHit& h : truth) hits.push_back(h.hit);
  return hits;
}

}  // namespace

TEST_CASE("right answers pass the check") {
  for (bool shared : {true, false}) {
    const TriangleMesh mesh = sphere(8, 16, shared);
    const Oracle oracle(mesh);
    std::vector<Ray> rays;
    Dice dice(5);
    for (int i = 0; i < 500; ++i) rays.push_back({dice.point() * 2.0f, 0, dice.point(), kInf});
    const std::vector<ExactHit> truth = oracle.closest_hit(rays);
    const AnswerCheck check = oracle.check_closest_hit(rays, truth, hits_of(truth));
    CHECK(check.rays == 500);
    CHECK(check.hits > 50);
    CHECK(check.hits < 500);
    CHECK(check.wrong_answers() == 0);
    CHECK(check.wrong_primitive == 0);
    CHECK(check.cracks == 0);
    CHECK(check.t_error_ulp_max <= 0.5);
  }
}

TEST_CASE("a t that is no normal number may be off by its rounding, not by two denormals") {
  constexpr float least = 0x1p-149f;
  const struct {
    float z;  ///< of a wall that a ray of direction (0, 0, 2) meets at half of it
    float answer;
    bool wrong;
  } cases[] = {{3 * least, 2 * least, false},
               {3 * least, least, false},
               {3 * least, 3 * least, true},
               {3 * least, 0, true},
               {2 * least, least, false},
               {2 * least, 2 * least, false},
               {2 * least, 3 * least, true},
               {0x1p-125f, 0x1p-126f + 0x1p-139f, false},
               {0x1p-125f, 0x1p-126f + 0x1p-137f, true}};
  for (const auto& c : cases) {
    INFO("z " << c.z / least << ", answer " << c.answer / least << " denormals");
    TriangleMesh mesh;
    add_triangle(mesh, {-1, -1, c.z}, {1, -1, c.z}, {0, 1, c.z});
    const Oracle oracle(mesh);
    const std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 2}, kInf}};
    const std::vector<Hit> answers{{c.answer, 0, 0, 0}};
    CHECK(oracle.check_closest_hit(rays, oracle.closest_hit(rays), answers).wrong_surface == c.wrong);
  }
}

TEST_CASE("where the exact t rounds to infinity, infinity is the right answer") {
  constexpr float most = std::numeric_limits<float>::max();
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 4}, {1, -1, 4}, {0, 1, 4});
  const Oracle oracle(mesh);
  const struct {
    float direction, answer;
    bool wrong;
  } cases[] = {{0x1p-126f, kInf, false}, {0x1p-126f, most, false}, {0x1p-127f, kInf, false},
               {0x1p-127f, most, true},  {0x1p-120f, kInf, true},  {0x1p-120f, 0x1p122f, false}};
  for (const auto& c : cases) {
    INFO("direction " << c.direction << ", answer " << c.answer);
    const std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, c.direction}, kInf}};
    const std::vector<Hit> answers{{c.answer, 0, 0, 0}};
    const AnswerCheck check = oracle.check_closest_hit(rays, oracle.closest_hit(rays), answers);
    CHECK(check.wrong_surface == c.wrong);
    CHECK(check.wrong_primitive == 0);
  }
}

TEST_CASE("each wrong answer is counted for what it is") {
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1});
  add_triangle(mesh, {-1, -1, 1}, {1, 1, 1}, {-1, 1, 1});
  add_triangle(mesh, {-1, -1, 2}, {1, -1, 2}, {0, 1, 2});
  const Oracle oracle(mesh);
  const Ray inside{{0.5f, -0.25f, 0}, 0, {0, 0, 1}, kInf}, on_edge{{0, 0, 0}, 0, {0, 0, 1}, kInf},
      beside{{5, 0, 0}, 0, {0, 0, 1}, kInf};
  const float next = std::nextafter(1.0f, 2.0f), nan = std::numeric_limits<float>::quiet_NaN();
  struct Case {
    const char* name;
    Ray ray;
    Hit answer;
    std::uint64_t missed, false_hits, surface, primitive, cracks;
    double ulp;  ///< -1: no t to speak of
  };
  const Case cases[] = {
      {"right", inside, {1, 0, 0, 0}, 0, 0, 0, 0, 0, 0},
      {"miss", inside, {}, 1, 0, 0, 0, 1, -1},
      {"false hit", beside, {1, 0, 0, 0}, 0, 1, 0, 0, 0, -1},
      {"right miss", beside, {}, 0, 0, 0, 0, 0, -1},
      {"behind", inside, {2, 0, 0, 2}, 0, 0, 1, 1, 1, -1},
      {"in front", inside, {0.5f, 0, 0, 2}, 0, 0, 1, 1, 0, -1},
      {"neighbour at the same t", inside, {1, 0, 0, 1}, 0, 0, 0, 1, 0, 0},
      {"t one ulp off", inside, {next, 0, 0, 0}, 0, 0, 0, 0, 0, 1},
      {"t within the tolerance", inside, {1 + 0x1p-13f, 0, 0, 0}, 0, 0, 0, 0, 0, 1024},
      {"right triangle, t beyond the tolerance", inside, {1 + 0x1p-11f, 0, 0, 0}, 0, 0, 1, 0, 0, 4096},
      {"right triangle, t not a number", inside, {nan, 0, 0, 0}, 0, 0, 1, 0, 0, std::numeric_limits<float>::max()},
      {"a triangle that is not there", inside, {1, 0, 0, 77}, 0, 0, 0, 1, 0, 0},
      {"edge: the other of two ties", on_edge, {1, 0, 0, 1}, 0, 0, 0, 0, 0, 0},
      {"edge: crack", on_edge, {2, 0, 0, 2}, 0, 0, 1, 1, 1, -1},
  };
  for (const Case& c : cases) {
    INFO(c.name);
    const AnswerCheck check = oracle.check_closest_hit({&c.ray, 1}, oracle.closest_hit({&c.ray, 1}), {&c.answer, 1});
    CHECK(check.rays == 1);
    CHECK(check.hits == (c.answer.is_hit() ? 1u : 0u));
    CHECK(check.missed_hits == c.missed);
    CHECK(check.false_hits == c.false_hits);
    CHECK(check.wrong_surface == c.surface);
    CHECK(check.wrong_primitive == c.primitive);
    CHECK(check.cracks == c.cracks);
    CHECK(check.wrong_answers() == c.missed + c.false_hits + c.surface);
    CHECK(check.t_error_ulp_max == std::max(c.ulp, 0.0));
  }
}

TEST_CASE("median, 99th percentile and maximum of the error of t") {
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  const Oracle oracle(mesh);
  std::vector<Ray> rays(200, Ray{{0, 0, 0}, 0, {0, 0, 1}, kInf});
  const std::vector<ExactHit> truth = oracle.closest_hit(rays);
  std::vector<Hit> answers = hits_of(truth);
  for (std::size_t i = 0; i < answers.size(); ++i) answers[i].t = 1.0f + static_cast<float>(i) * 0x1p-23f;
  const AnswerCheck check = oracle.check_closest_hit(rays, truth, answers);
  CHECK(check.t_error_ulp_median == 99);
  CHECK(check.t_error_ulp_p99 == 197);
  CHECK(check.t_error_ulp_max == 199);
}

TEST_CASE("u and v of hits of the right primitive are compared with the exact ones, apart from wrong answers") {
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  const Oracle oracle(mesh);
  const Ray ray{{0, -0.5f, 0}, 0, {0, 0, 1}, kInf};
  const ExactHit truth = oracle.closest_hit({&ray, 1})[0];
  REQUIRE((truth.hit.u == 0.375f && truth.hit.v == 0.25f));
  const float nan = std::numeric_limits<float>::quiet_NaN(), most = std::numeric_limits<float>::max();
  const struct {
    const char* name;
    Hit answer;
    std::uint64_t wrong;
    double error;
  } cases[] = {{"right", {1, 0.375f, 0.25f, 0}, 0, 0},
               {"u a little off", {1, 0.375f + 0x1p-20f, 0.25f, 0}, 0, 0x1p-20},
               {"v off by as much as may be", {1, 0.375f, 0.25f - 0x1p-10f, 0}, 0, 0x1p-10},
               {"v off by more", {1, 0.375f, 0.25f - 0x1p-9f, 0}, 1, 0x1p-9},
               {"u and v exchanged", {1, 0.25f, 0.375f, 0}, 1, 0.125},
               {"u of the wrong corner", {1, 0.375f, 0.375f, 0}, 1, 0.125},
               {"u left unwritten", {1, nan, 0.25f, 0}, 1, most},
               {"v infinite", {1, 0.375f, kInf, 0}, 1, most},
               {"right, though t is off", {1.5f, 0.375f, 0.25f, 0}, 0, 0},
               {"of another primitive", {1, 0.5f, 0.5f, 77}, 0, 0},
               {"miss", {}, 0, 0}};
  for (const auto& c : cases) {
    INFO(c.name);
    const AnswerCheck check = oracle.check_closest_hit({&ray, 1}, {&truth, 1}, {&c.answer, 1});
    CHECK(check.wrong_uv == c.wrong);
    CHECK(check.uv_error_max == c.error);
    CHECK(check.uv_error_median == c.error);
    CHECK(check.wrong_answers() == (c.answer.t == 1.0f ? 0u : 1u));
  }
  const std::vector<Ray> rays(200, ray);
  std::vector<Hit> answers(200, truth.hit);
  for (std::size_t i = 0; i < answers.size(); ++i) answers[i].u += static_cast<float>(i) * 0x1p-14f;
  const AnswerCheck check = oracle.check_closest_hit(rays, oracle.closest_hit(rays), answers);
  CHECK(check.uv_error_median == 99 * 0x1p-14);
  CHECK(check.uv_error_p99 == 197 * 0x1p-14);
  CHECK(check.uv_error_max == 199 * 0x1p-14);
  CHECK(check.wrong_uv == 200 - 17);
}

TEST_CASE("a miss is a crack where the surface is closed and not at its silhouette or border") {
  struct Case {
    const char* name;
    TriangleMesh mesh;
    Ray ray;
    bool crack;
  };
  std::vector<Case> cases;
  TriangleMesh tent;  // two sides that meet in a ridge at x = 0
  add_triangle(tent, {0, -1, 0}, {0, 1, 0}, {1, 0, -1});
  add_triangle(tent, {0, 1, 0}, {0, -1, 0}, {-1, 0, -1});
  cases.push_back({"ridge from above", tent, {{0, 0.25f, 5}, 0, {0, 0, -1}, kInf}, true});
  cases.push_back({"ridge from the side is a silhouette", tent, {{5, 0.25f, 0}, 0, {-1, 0, 0}, kInf}, false});
  cases.push_back({"inside a triangle", tent, {{0.25f, 0, 5}, 0, {0, 0, -1}, kInf}, true});
  cases.push_back({"border", tent, {{0.5f, 0.5f, 5}, 0, {0, 0, -1}, kInf}, false});
  cases.push_back({"open fan: end of the ridge", tent, {{0, 1, 5}, 0, {0, 0, -1}, kInf}, false});
  TriangleMesh turned = tent;
  std::swap(turned.triangles[1].a, turned.triangles[1].b);
  cases.push_back({"winding does not matter", turned, {{0, 0.25f, 5}, 0, {0, 0, -1}, kInf}, true});
  TriangleMesh fin = tent;
  add_triangle(fin, {0, -1, 0}, {0, 1, 0}, {0, 0, 1});
  cases.push_back({"three triangles at one edge", fin, {{0, 0.25f, 5}, 0, {0, 0, -1}, kInf}, false});
  const TriangleMesh ball = sphere(8, 16, false), welded = sphere(8, 16, true);
  const Vec3f vertex = ball.vertices[60];
  Vec3f widest = ball.vertices.front();
  for (const Vec3f& p : ball.vertices) widest = p.x > widest.x ? p : widest;
  for (const TriangleMesh* mesh : {&ball, &welded}) {
    cases.push_back({"vertex of a ball from within", *mesh, {{0, 0, 0}, 0, vertex, kInf}, true});
    cases.push_back({"vertex of a ball from outside", *mesh, {vertex * 4.0f, 0, -vertex, kInf}, true});
    cases.push_back({"pole", *mesh, {{0, 0, 3}, 0, {0, 0, -1}, kInf}, true});
    cases.push_back({"vertex at the silhouette", *mesh, {widest - Vec3f{0, 3, 0}, 0, {0, 3, 0}, kInf}, false});
  }
  // So many triangles about its tip that a search which gave up would take its silhouette for a crack
  TriangleMesh cone;
  constexpr int kSides = 40000;
  const auto on_rim = [](int i) {
    const double angle = 2 * std::numbers::pi * (i % kSides) / kSides;
    return Vec3f{float(std::cos(angle)), float(std::sin(angle)), 0};
  };
  for (int i = 0; i < kSides; ++i) add_triangle(cone, {0, 0, 1}, on_rim(i), on_rim(i + 1));
  cases.push_back({"tip of a cone from above", cone, {{0, 0, 3}, 0, {0, 0, -1}, kInf}, true});
  cases.push_back({"tip of a cone from the side", cone, {{-3, 0, 1}, 0, {1, 0, 0}, kInf}, false});
  for (const Case& c : cases) {
    INFO(c.name);
    const Oracle oracle(c.mesh);
    const std::vector<ExactHit> truth = oracle.closest_hit({&c.ray, 1});
    REQUIRE(truth.front().hit.is_hit());
    const Hit miss;
    CHECK(oracle.check_closest_hit({&c.ray, 1}, truth, {&miss, 1}).cracks == (c.crack ? 1u : 0u));
  }
}

TEST_CASE("a ray passes a vertex where the edges near it close a ring") {
  const TriangleMesh ball = sphere(8, 16, true);
  const Vec3f vertex = ball.vertices[60], other = ball.vertices[61];
  TriangleMesh needles;  // a strip along x, each triangle narrower than rounding
  constexpr float kWidth = 0x1p-30f;
  for (int i = 0; i < 40; ++i)
    for (const float x : {-1.0f, 1.0f}) needles.vertices.push_back({x, float(i - 20) * kWidth, 1});
  for (std::uint32_t i = 0; i < 78; ++i) needles.triangles.push_back({i, i + 1, i + 2});
  for (const float y : {-1.0f, 1.0f})  // and whole ones beside it
    for (const float x : {-1.0f, 1.0f}) needles.vertices.push_back({x, y, 1});
  needles.triangles.insert(needles.triangles.end(), {{0, 1, 80}, {1, 80, 81}, {78, 79, 82}, {79, 82, 83}});
  const struct {
    const char* name;
    const TriangleMesh& mesh;
    Ray ray;
    bool vertex;
  } cases[] = {{"vertex of a ball", ball, {{0, 0, 0}, 0, vertex, kInf}, true},
               {"beside it by less than rounding", ball, {{1e-9f, -1e-9f, 0}, 0, vertex, kInf}, true},
               {"edge of a ball", ball, {{0, 0, 0}, 0, (vertex + other) * 0.5f, kInf}, false},
               {"inside a triangle", ball, {{0, 0, 0}, 0, vertex * 0.5f + other * 0.4f, kInf}, false},
               {"in the middle of needles", needles, {{0.1f, 0, 0}, 0, {0, 0, 1}, kInf}, false}};
  for (const auto& c : cases) {
    INFO(c.name);
    const Oracle oracle(c.mesh);
    const ExactHit truth = oracle.closest_hit({&c.ray, 1}).front();
    REQUIRE(truth.hit.is_hit());
    CHECK(oracle.judge(c.ray, 0, truth, Hit{}).crack);
    CHECK(oracle.passes_vertex(c.ray, 0, truth) == c.vertex);
  }
}

TEST_CASE("any hit counts missed and false hits alone, and sizes must agree") {
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  const Oracle oracle(mesh);
  const Ray hit{{0, 0, 0}, 0, {0, 0, 1}, kInf}, miss{{5, 0, 0}, 0, {0, 0, 1}, kInf},
      short_of{{0, 0, 0}, 0, {0, 0, 1}, 0.5f};
  const std::vector<Ray> rays{hit, hit, miss, miss, short_of, short_of};
  const std::vector<std::uint8_t> truth = oracle.any_hit(rays);
  CHECK(truth == std::vector<std::uint8_t>{1, 1, 0, 0, 0, 0});
  const AnswerCheck check = oracle.check_any_hit(rays, truth, std::vector<std::uint8_t>{1, 0, 0, 1, 0, 1});
  CHECK(check.rays == 6);
  CHECK(check.hits == 3);
  CHECK(check.missed_hits == 1);
  CHECK(check.false_hits == 2);
  CHECK(check.wrong_answers() == 3);
  CHECK(check.cracks == 0);
  // A kernel that writes nothing is wrong on every ray, whatever stood there, and has hit nothing.
  const AnswerCheck unwritten = oracle.check_any_hit(rays, truth, std::vector<std::uint8_t>(6, 0xff));
  CHECK(unwritten.hits == 0);
  CHECK(unwritten.missed_hits == 2);
  CHECK(unwritten.false_hits == 4);
  CHECK_THROWS_AS(oracle.check_any_hit(rays, truth, std::vector<std::uint8_t>{1}), std::invalid_argument);
  CHECK_THROWS_AS(oracle.check_closest_hit(rays, oracle.closest_hit(rays), {}), std::invalid_argument);
}
