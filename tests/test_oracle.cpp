#include "oracle/oracle.h"

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/exact/exact_predicate.h"
#include "tests/catch.h"
#include "tests/hard_cases.h"
#include "tests/rational_brute_force.h"
#include "tests/small_meshes.h"

using namespace arboretum;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

struct Scene {
  TriangleMesh mesh;
  std::vector<Ray> rays;
};

Scene random_soup(Dice& dice) {
  Scene s;
  for (int i = 0; i < 12; ++i) add_triangle(s.mesh, dice.point(), dice.point(), dice.point());
  for (int i = 0; i < 40; ++i)
    s.rays.push_back({dice.point() * 2.0f, 0.0f, dice.point(), dice.integer(3) ? kInf : 1.0f});
  return s;
}

Scene exponential_soup(Dice& dice) {
  Scene s;
  const auto p = [&dice] {
    return Vec3f{dice.exponential(-20, 20), dice.exponential(-20, 20), dice.exponential(-20, 20)};
  };
  for (int i = 0; i < 12; ++i) add_triangle(s.mesh, p(), p(), p());
  for (int i = 0; i < 20; ++i) s.rays.push_back({p(), 0.0f, p(), kInf});
  for (const Triangle& t : s.mesh.triangles) {
    const Vec3f o = p(),
                target = s.mesh.vertices[t.a] * 0.5f + s.mesh.vertices[t.b] * 0.25f + s.mesh.vertices[t.c] * 0.25f;
    s.rays.push_back({o, 0.0f, target - o, kInf});
  }
  return s;
}

/// The ends of the float32 range, where degree-3 terms in float32 would over- and underflow.
Scene whole_range(Dice& dice) {
  Scene s;
  const float scale = dice.exponential(-148, 126), size = dice.exponential(-148, 126);
  const auto p = [&](float k) { return dice.point() * k; };
  for (int i = 0; i < 6; ++i) add_triangle(s.mesh, p(scale), p(scale), p(scale));
  for (int i = 0; i < 6; ++i) add_triangle(s.mesh, p(scale), p(size), p(scale));
  for (const Triangle& t : s.mesh.triangles) {
    const Vec3f o = p(scale),
                target = s.mesh.vertices[t.a] * 0.5f + s.mesh.vertices[t.b] * 0.25f + s.mesh.vertices[t.c] * 0.25f;
    s.rays.push_back({o, 0.0f, target * 0.5f - o * 0.5f, kInf});
    s.rays.push_back({o, 0.0f, p(size), kInf});
  }
  return s;
}

/// A fan on small whole numbers: rays at its vertices, its edges' middles and within its plane are exact hits
/// of both sides.
Scene aimed_fan(Dice& dice) {
  Scene s;
  const auto whole = [&dice](int n) { return static_cast<float>(dice.integer(2 * n + 1) - n); };
  const Vec3f apex{whole(4), whole(4), whole(4)};
  std::vector<Vec3f> ring;
  for (int i = 0; i < 6; ++i) ring.push_back({whole(8), whole(8), dice.integer(2) ? apex.z : whole(8)});
  for (std::size_t i = 0; i < ring.size(); ++i) add_triangle(s.mesh, apex, ring[i], ring[(i + 1) % ring.size()]);
  add_triangle(s.mesh, ring[0], apex, ring[1]);  // a copy, wound the other way
  add_triangle(s.mesh, apex, apex, ring[1]);     // without area
  for (const Vec3f& p : ring) {
    const Vec3f o{whole(16), whole(16), whole(16)};
    s.rays.push_back({o, 0.0f, apex - o, kInf});
    s.rays.push_back({o, 0.0f, apex - o, 1.0f});
    s.rays.push_back({o, 1.0f, p - o, kInf});
    s.rays.push_back({o, 0.0f, (p + apex) * 0.5f - o, kInf});
    s.rays.push_back({p, 0.0f, apex - p, kInf});                 // along an edge
    s.rays.push_back({o, 0.0f, p - apex, kInf});                 // parallel to one
    s.rays.push_back({o, 0.0f, {0.0f, -0.0f, whole(1)}, kInf});  // axis-parallel, or no direction
    s.rays.push_back({{p.x, p.y, -20.0f}, 0.0f, {-0.0f, 0.0f, 3.0f}, kInf});
    s.rays.push_back({{o.x, apex.y, apex.z}, 0.0f, {1.0f, 1e-42f, -0.0f}, kInf});
  }
  return s;
}

/// Vertices with many bits: rays aimed at them and at edges are rounded, and pass within a rounding of the
/// feature.
Scene nearly_aimed(Dice& dice) {
  Scene s;
  std::vector<Vec3f> p;
  for (int i = 0; i < 8; ++i) p.push_back(dice.point() + Vec3f{dice.integer(2) * 1000.0f, 0, 0});
  for (int i = 0; i < 14; ++i) {
    add_triangle(s.mesh, p[static_cast<std::size_t>(dice.integer(8))], p[static_cast<std::size_t>(dice.integer(8))],
                 p[static_cast<std::size_t>(dice.integer(8))]);
  }
  for (int i = 0; i < 40; ++i) {
    const Vec3f o = dice.point() * 3.0f, q = p[static_cast<std::size_t>(dice.integer(8))],
                r = p[static_cast<std::size_t>(dice.integer(8))];
    const float w = dice.integer(3) == 0 ? 0.0f : dice.uniform(0, 1);
    const Vec3f d = q * (1 - w) + r * w - o;
    s.rays.push_back({o, 0.0f, dice.integer(2) ? normalize(d) : d, kInf});
  }
  return s;
}

/// Axis-aligned and flat: boxes without thickness, planes through the origin, intervals that end on the
/// surface.
Scene flat_grid(Dice& dice) {
  Scene s;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      const Vec3f a{float(x), float(y), 1}, b{float(x + 1), float(y), 1}, c{float(x + 1), float(y + 1), 1},
          d{float(x), float(y + 1), 1};
      add_triangle(s.mesh, a, b, c);
      add_triangle(s.mesh, a, c, d);
    }
  }
  for (int i = 0; i < 40; ++i) {
    const Vec3f o{dice.integer(13) * 0.25f, dice.integer(13) * 0.25f, static_cast<float>(dice.integer(3))};
    const float slope = dice.integer(2) ? 0.0f : dice.integer(9) * 0.25f - 1.0f;
    const float end = static_cast<float>(dice.integer(3));
    s.rays.push_back({o,
                      dice.integer(2) ? 0.0f : 1.0f,
                      {slope, dice.integer(2) ? 0.0f : slope, static_cast<float>(dice.integer(3) - 1)},
                      dice.integer(2) ? kInf : end});
  }
  return s;
}

/// The edge from p to -p, seen from p * 2^-85 or a float32 step beside it: the sign hangs on bits that lie
/// beyond the 106 of a double-double.
Scene three_scales(Dice& dice) {
  Scene s;
  const Vec3f p = dice.point();
  add_triangle(s.mesh, p, -p, dice.point());
  add_triangle(s.mesh, -p, p, -s.mesh.vertices.back());
  for (int i = 0; i < 20; ++i) {
    Vec3f o = p * std::ldexp(1.0f, -80 - dice.integer(12));
    float& c = o[static_cast<std::size_t>(dice.integer(3))];
    c = std::nextafter(c, dice.integer(2) ? kInf : -kInf);
    s.rays.push_back({i == 0 ? p * 0x1p-80f : o, 0.0f, dice.point(), kInf});
  }
  return s;
}

void check_scene(const Scene& scene, const std::string& label, DecisionCounts& counts) {
  const Oracle oracle(scene.mesh);
  const std::vector<ExactHit> closest = oracle.closest_hit(scene.rays, &counts);
  const std::vector<std::uint8_t> any = oracle.any_hit(scene.rays, &counts);
  for (std::size_t i = 0; i < scene.rays.size(); ++i) {
    INFO(label << ", ray " << i);
    const rational::Answer exact = rational::closest_hit(scene.mesh, scene.rays[i]);
    REQUIRE(closest[i].hit.is_hit() == !exact.nearest.empty());
    REQUIRE((any[i] != 0) == !exact.nearest.empty());
    if (exact.nearest.empty()) {
      CHECK(closest[i].hit.t == kInf);
      continue;
    }
    CHECK(closest[i].hit.primitive == exact.nearest.front());
    CHECK(closest[i].tie == (exact.nearest.size() > 1));
    CHECK(rational::is_rounded(exact.t, closest[i].hit.t));
    CHECK(rational::is_rounded(exact.u, closest[i].hit.u));
    CHECK(rational::is_rounded(exact.v, closest[i].hit.v));
    const rational::Number error = abs(rational::Number(closest[i].t) - exact.t);
    CHECK(error <= abs(exact.t) * rational::Number(0x1p-50));
  }
}

}  // namespace

TEST_CASE("the oracle answers every hard case") {
  const std::vector<HardCase> cases = load_hard_cases();
  REQUIRE(cases.size() >= 96);
  for (const HardCase& c : cases) {
    INFO(c.id << ": " << c.why);
    const Oracle oracle(c.mesh);
    const ExactHit answer = oracle.closest_hit({&c.ray, 1}).front();
    const bool any = oracle.any_hit({&c.ray, 1}).front() != 0;
    CHECK(answer.hit.is_hit() == c.hit);
    CHECK(any == c.hit);
    if (!c.hit || !answer.hit.is_hit()) continue;
    CHECK(answer.hit.primitive == c.nearest_ids.front());
    CHECK(answer.tie == (c.nearest_ids.size() > 1));
    CHECK(std::fabs(answer.t - c.t) <= std::fabs(c.t) * 0x1p-50);
    CHECK(answer.hit.t == static_cast<float>(c.t));
  }
}

TEST_CASE("the rational brute force agrees with the hard cases") {
  for (const HardCase& c : load_hard_cases()) {
    INFO(c.id << ": " << c.why);
    const rational::Answer answer = rational::closest_hit(c.mesh, c.ray);
    CHECK(answer.nearest == c.nearest_ids);
    CHECK(answer.hits == c.closed_hits);
  }
}

TEST_CASE("the oracle equals rational brute force on nasty scenes, and each level is used where it must be") {
  struct Family {
    const char* name;
    std::function<Scene(Dice&)> make;
    int scenes;
    bool needs_double_double, needs_integers;
  };
  const Family families[] = {
      {"random soup", random_soup, 25, true, false},       {"exponential soup", exponential_soup, 25, true, false},
      {"whole float range", whole_range, 25, true, false}, {"aimed fan", aimed_fan, 30, true, true},
      {"nearly aimed", nearly_aimed, 25, true, true},      {"flat grid", flat_grid, 20, true, true},
      {"three scales", three_scales, 30, true, true},
  };
  std::uint64_t seed = 1;
  for (const Family& family : families) {
    DecisionCounts counts;
    for (int i = 0; i < family.scenes; ++i) {
      Dice dice(seed++);
      check_scene(family.make(dice), std::string(family.name) + " " + std::to_string(i), counts);
    }
    INFO(family.name << ": double " << counts.in_double << ", double-double " << counts.in_double_double
                     << ", integers " << counts.in_integers);
    CHECK(counts.in_double > 0);
    if (family.needs_double_double) CHECK(counts.in_double_double > 0);
    if (family.needs_integers) CHECK(counts.in_integers > 0);
  }
}

TEST_CASE("sign of an edge function that doubles get wrong") {
  // The ray passes 2^-60 beside the edge: the double determinant is 0 or of either sign, the truth is not.
  const Corners left{Vec3f{1, 1, 1}, Vec3f{-1, -1, 1}, Vec3f{-1, 1, 1}},
      right{Vec3f{1, 1, 1}, Vec3f{1, -1, 1}, Vec3f{-1, -1, 1}};
  const Ray beside{{0x1p-60f, 0, 0}, 0, {0, 0, 1}, kInf}, upon{{0, 0, 0}, 0, {0, 0, 1}, kInf};
  Enclosure t;
  ExactPredicate near(beside), on(upon);
  CHECK_FALSE(near.meets(left, t));
  CHECK(near.meets(right, t));
  CHECK(near.counts().in_double_double > 0);
  CHECK(on.meets(left, t));
  CHECK(on.meets(right, t));
  CHECK(on.counts().in_integers > 0);
}

TEST_CASE("a ray exactly through a vertex needs no whole numbers, one an ulp beside it is not taken for such") {
  const Vec3f hub{0.25f, 0.5f, 2.0f}, origin{0.125f, -0.75f, -1.0f};
  const Corners first{hub, Vec3f{3, 0.1f, 2.3f}, Vec3f{0.3f, 5, 1.7f}},
      second{Vec3f{-2, 0.3f, 1.1f}, hub, Vec3f{0.3f, 5, 1.7f}},
      missed{Vec3f{3, 0.1f, 2.3f}, Vec3f{0.3f, 5, 1.7f}, Vec3f{4, 5, 2.5f}};
  const Ray through{origin, 0, {0.5f * (hub.x - origin.x), 0.5f * (hub.y - origin.y), 0.5f * (hub.z - origin.z)}, kInf};
  Enclosure t;
  ExactPredicate on(through);
  CHECK(on.meets(first, t));
  CHECK((t.lower <= 2.0 && t.upper >= 2.0));
  CHECK(on.meets(second, t));
  CHECK_FALSE(on.meets(missed, t));
  CHECK(on.compare_t(first, second) == 0);
  CHECK(on.counts().in_integers == 0);

  Ray beside = through;
  beside.direction.x = std::nextafter(beside.direction.x, 1.0f);
  ExactPredicate off(beside);
  TriangleMesh mesh;
  for (const Corners& c : {first, second}) {
    const auto at = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), c.begin(), c.end());
    mesh.triangles.push_back({at, at + 1, at + 2});
  }
  const rational::Answer truth = rational::closest_hit(mesh, beside);
  CHECK(truth.hits == 1);
  CHECK(off.meets(first, t) == (truth.nearest == std::vector<std::uint32_t>{0}));
  CHECK(off.meets(second, t) == (truth.nearest == std::vector<std::uint32_t>{1}));
}

TEST_CASE("exact integers round to float32 as the standard asks") {
  struct Case {
    long long numerator, denominator;
    int exponent;
    float expected;
  };
  const Case cases[] = {
      {1, 3, 0, 1.0f / 3.0f},
      {0, 5, 17, 0.0f},
      {-1, 3, 0, -1.0f / 3.0f},
      {(1 << 24) + 1, 1, 0, 16777216.0f},  // a tie goes to the even neighbour below
      {(1 << 24) + 3, 1, 0, 16777220.0f},  // and to the one above
      {1, 1, -150, 0.0f},                  // half the least denormal: a tie, zero is even
      {3, 1, -151, 0x1p-149f},             // above the tie
      {1, 1, 128, kInf},
      {-1, 1, 300, -kInf},
      {0x1ffffff, 1, 103, kInf},  // halfway between the largest number and 2^128
      {0x1fffffe, 1, 103, std::numeric_limits<float>::max()},
  };
  for (const Case& c : cases) {
    INFO(c.numerator << "/" << c.denominator << " * 2^" << c.exponent);
    CHECK(round_to_float({ExactInteger(c.numerator), ExactInteger(c.denominator), c.exponent}) == c.expected);
  }
  // Just above a midpoint by far less than a double shows.
  const ExactInteger one = 1;
  CHECK(round_to_float({(((one << 24) + 1) << 100) + 1, one << 100, 0}) == 16777218.0f);
  CHECK(round_to_float({(((one << 24) + 1) << 100) - 1, one << 100, 0}) == 16777216.0f);
}

TEST_CASE("the search tree finds what a plain loop finds, on a mesh with depth") {
  const TriangleMesh mesh = sphere(40, 80, true);
  const Oracle oracle(mesh);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < mesh.vertices.size(); i += 7)
    rays.push_back({{0.1f, 0.2f, -0.05f}, 0, mesh.vertices[i] - Vec3f{0.1f, 0.2f, -0.05f}, kInf});
  for (std::uint64_t i = 0; i < 300; ++i) {
    Dice dice(i);
    rays.push_back({dice.point() * 2.0f, 0, dice.integer(4) ? dice.point() : Vec3f{0, dice.uniform(), -0.0f},
                    dice.integer(2) ? kInf : 1.5f});
  }
  const std::vector<ExactHit> truth = oracle.closest_hit(rays);
  const std::vector<std::uint8_t> any = oracle.any_hit(rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    INFO("ray " << i);
    ExactPredicate predicate(rays[i]);
    std::uint32_t nearest = kNoPrimitive;
    for (std::uint32_t k = 0; k < mesh.size(); ++k) {
      Enclosure t;
      if (!predicate.meets(mesh.corners(k), t)) continue;
      if (nearest == kNoPrimitive || predicate.compare_t(mesh.corners(k), mesh.corners(nearest)) < 0) nearest = k;
    }
    CHECK(truth[i].hit.primitive == nearest);
    CHECK((any[i] != 0) == (nearest != kNoPrimitive));
  }
}

TEST_CASE("meshes and rays that mean nothing") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  TriangleMesh empty;
  const Ray ray{{0, 0, -1}, 0, {0, 0, 1}, kInf};
  CHECK_FALSE(Oracle(empty).closest_hit({&ray, 1}).front().hit.is_hit());
  CHECK(Oracle(empty).closest_hit({}).empty());

  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, nan}, {1, -1, 0}, {0, 1, 0});
  add_triangle(mesh, {-1, -1, -0.5f}, {kInf, -1, 0}, {0, 1, 0});
  for (int i = 0; i < 1000; ++i) add_triangle(mesh, {-1, -1, 0}, {1, -1, 0}, {0, 1, 0});  // one place: no split helps
  const Oracle oracle(mesh);
  const ExactHit answer = oracle.closest_hit({&ray, 1}).front();
  CHECK(answer.hit.primitive == 2);
  CHECK(answer.tie);
  for (const Ray& bad : {Ray{{nan, 0, 0}, 0, {0, 0, 1}, kInf}, Ray{{0, 0, -1}, 0, {0, 0, 0}, kInf},
                         Ray{{0, 0, -1}, 0, {0, 0, kInf}, kInf}, Ray{{0, 0, -1}, 2, {0, 0, 1}, 1},
                         Ray{{0, 0, -1}, nan, {0, 0, 1}, kInf}, Ray{{0, 0, -1}, kInf, {0, 0, 1}, kInf}}) {
    CHECK_FALSE(oracle.closest_hit({&bad, 1}).front().hit.is_hit());
    CHECK(oracle.any_hit({&bad, 1}).front() == 0);
  }
}

TEST_CASE("a deep tree does not overflow the search") {
  TriangleMesh mesh;
  for (int i = -120; i <= 120; ++i) {
    const float x = std::ldexp(1.0f, i), s = std::ldexp(1.0f, i - 2);
    add_triangle(mesh, {x, -s, -s}, {x, s, -s}, {x, 0, s});
  }
  const Oracle oracle(mesh);
  for (int i = -120; i <= 120; ++i) {
    const float x = std::ldexp(1.0f, i);
    const Ray from_left{{x * 0.75f, 0, 0}, 0, {1, 0, 0}, kInf};
    CHECK(oracle.closest_hit({&from_left, 1}).front().hit.primitive == static_cast<std::uint32_t>(i + 120));
  }
}
