// Every intersector on every leaf block that it reads and every instruction set, a few triangles at a time, against the
// exact predicate: what docs/numerics.md promises of each.
#include <algorithm>
#include <iostream>
#include <map>
#include <string>

#include "core/exact/exact_predicate.h"
#include "intersectors/leaf_tests.h"
#include "intersectors/precomputed.h"
#include "structures/leaves/leaf_form.h"
#include "tests/catch.h"
#include "tests/small_meshes.h"

using namespace arboretum;

namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

struct Promise {
  std::string_view intersector;
  bool edges, vertices;  ///< no ray at an edge, or a vertex, of a closed surface is lost
  int range;             ///< coordinates within 2^-range .. 2^range
  bool accurate;         ///< t is right to half a unit in the last place, and a little
};
constexpr Promise kPromises[] = {
    {"moller_trumbore", false, false, 40, false},
    {"pluecker", true, false, 40, false},
    {"watertight", true, true, 60, false},
    {"baldwin_weber", false, false, 60, false},
    {"havel_herout", false, false, 60, false},
    {"wald_projection", false, false, 60, false},
    {"moller_trumbore_double", false, false, 60, true},
    {"pluecker_double", true, false, 60, true},
    {"watertight_refined", true, true, 60, true},
    {"exact", true, true, 60, true},
};

/// One intersector's tests of one block on one instruction set, with what it promises.
struct Tested : LeafTests {
  Promise promise;
  [[nodiscard]] std::string name() const {
    return std::string(intersector) + "/" + std::string(leaf) + "/" + std::string(to_string(isa));
  }
};

const std::vector<Tested>& all_tests() {
  static const std::vector<Tested> tests = [] {
    std::vector<Tested> list;
    for (const LeafTests& t : leaf_tests()) {
      if (!is_available(t.isa)) continue;
      for (const Promise& p : kPromises)
        if (p.intersector == t.intersector) list.push_back({t, p});
    }
    return list;
  }();
  return tests;
}

/// The triangles of a mesh in leaf blocks.
class Leaf {
 public:
  Leaf(const Tested& tests, const TriangleMesh& mesh) : tests_(tests), mesh_(mesh) {
    count_ = unsigned((mesh.size() + tests.form->width - 1) / tests.form->width);
    lines_.resize((count_ * tests.form->bytes + sizeof(Line) - 1) / sizeof(Line));
    std::vector<std::uint32_t> ids(mesh.size());
    for (std::uint32_t i = 0; i < ids.size(); ++i) ids[i] = i;
    tests.form->fill(lines_[0].bytes, mesh, ids);
  }
  [[nodiscard]] Hit closest_hit(const Ray& ray) const {
    PreparedRay prepared;
    tests_.prepare(ray, prepared);
    NearestHit best{ray.tfar};
    const bool changed = tests_.closest_hit(prepared, lines_[0].bytes, count_, mesh_.vertices.data(), ray.tnear, best);
    const bool found = best.primitive != NearestHit::kNone;
    REQUIRE(changed == found);
    if (found && tests_.finish) tests_.finish(prepared, best);
    return found ? Hit{best.t, best.u, best.v, std::uint32_t(best.primitive)} : Hit{};
  }
  [[nodiscard]] bool any_hit(const Ray& ray) const {
    PreparedRay prepared;
    tests_.prepare(ray, prepared);
    return tests_.any_hit(prepared, lines_[0].bytes, count_, mesh_.vertices.data(), ray.tnear, ray.tfar);
  }

 private:
  struct alignas(64) Line {
    std::byte bytes[64];
  };
  const Tested& tests_;
  const TriangleMesh& mesh_;
  unsigned count_ = 0;
  std::vector<Line> lines_;
};

/// A ray at a triangle that stands among others which it misses, so that lanes, and a block with empty ones, all have
/// their turn.
struct Shot {
  TriangleMesh mesh;
  std::uint32_t target = 0;
  Ray ray;
  bool hit = false;
  RoundedPoint exact;  ///< where it is hit
  /// (|o| + |v0| + t |d|) / (|N.d| / |N|max), sums of absolute components: t's error over the unit roundoff
  double condition = 0;
};

double sum(Vec3f a) { return std::abs(double(a.x)) + std::abs(double(a.y)) + std::abs(double(a.z)); }

/// Aims at least 0.05 (in barycentrics) inside or outside a triangle that is no sliver, and not along it.
Shot shot(Dice& dice, bool inside, float offset, float scale) {
  const Vec3f shift{offset, -offset, offset};
  for (;;) {
    const Vec3f a = dice.point(), b = dice.point(), c = dice.point(), n = cross(b - a, c - a);
    const float longest = std::max({length(b - a), length(c - a), length(c - b)});
    if (length(n) < 0.2f * longest * longest) continue;
    float u = dice.uniform(0.05f, 0.85f), v = dice.uniform(0.05f, 0.95f);
    if (u + v > 0.95f) continue;
    if (!inside) (dice.integer(2) ? u : v) -= dice.integer(2) ? 1.0f : -1.0f;
    const Vec3f p = a + (b - a) * u + (c - a) * v, o = dice.point() * 3.0f, d = p - o;
    if (std::abs(dot(n, d)) < 0.1f * length(n) * length(d)) continue;
    Shot s;
    s.target = std::uint32_t(dice.integer(5));
    for (std::uint32_t i = 0; i < 5; ++i) {
      const Vec3f beside = i == s.target ? Vec3f{} : cross(d, n) * (100.0f * float(i + 1) / length(cross(d, n)));
      add_triangle(s.mesh, (a + beside + shift) * scale, (b + beside + shift) * scale, (c + beside + shift) * scale);
    }
    s.ray = {(o + shift) * scale, 0, ((p + shift) - (o + shift)) * (scale * dice.exponential(-8, 8)), kFar};
    if (dot(s.ray.direction, d) < 0) s.ray.direction = -s.ray.direction;
    const auto corners = s.mesh.corners(s.target);
    ExactPredicate predicate(s.ray);
    Enclosure t;
    s.hit = predicate.meets(corners, t);
    if (s.hit != inside) continue;  // far from the origin the rounded triangle may lie beside the ray
    if (s.hit) {
      s.exact = predicate.round(corners);
      const double height =
          std::abs(double(dot(n, s.ray.direction))) / std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
      s.condition = (sum(s.ray.origin) + sum(corners[0]) + s.exact.t * sum(s.ray.direction)) / height;
    }
    return s;
  }
}

double ulp_of(double t) { return std::exp2(std::floor(std::log2(std::abs(t))) - 23); }

}  // namespace

TEST_CASE("every intersector has a promise, and every block is read by one") {
  std::map<std::string_view, std::size_t> of_leaf;
  for (const LeafTests& t : leaf_tests()) {
    INFO(t.intersector);
    CHECK(std::ranges::count(kPromises, t.intersector, &Promise::intersector) == 1);
    REQUIRE(t.form);
    ++of_leaf[t.leaf];
  }
  for (const char* leaf :
       {"triangle4", "triangle4v", "triangle4i", "triangle4w", "triangle4h", "triangle4p", "triangle4a", "triangle1w"})
    CHECK(of_leaf[leaf] > 0);
  const Isa isa = all_tests().front().isa;
  CHECK_FALSE(find_leaf_tests("triangle4", "pluecker_double", isa));
  CHECK_FALSE(find_leaf_tests("triangle4w", "watertight", isa));
  CHECK_FALSE(find_leaf_tests("triangle4v", "baldwin_weber", isa));
}

TEST_CASE("a ray well inside a triangle hits it, at the right t; one well outside misses") {
  std::map<std::string, double> worst;
  Dice dice(5);
  for (int exponent : {0, -20, 20, -40, 40, -60, 60}) {
    for (int i = 0; i < 120; ++i) {
      const Shot s = shot(dice, i % 4 != 0, i % 3 == 0 ? 30.0f : 0.0f, std::exp2(float(exponent)));
      for (const Tested& tests : all_tests()) {
        // The scene is some 2^8 wide and sets off for 2^5 at most.
        if (std::abs(exponent) > std::max(0, tests.promise.range - 1)) continue;
        INFO(tests.name() << ", scale 2^" << exponent << ", shot " << i);
        const Leaf leaf(tests, s.mesh);
        const Hit hit = leaf.closest_hit(s.ray);
        REQUIRE(hit.is_hit() == s.hit);
        REQUIRE(leaf.any_hit(s.ray) == s.hit);
        if (!s.hit) continue;
        REQUIRE(hit.primitive == s.target);
        const double error = std::abs(hit.t - s.exact.t);
        const double bound = tests.promise.accurate ? 0.501 * ulp_of(s.exact.t) : 0x1p-22 * s.condition;
        double& most = worst[std::string(tests.intersector)];
        most = std::max(most, error / bound);
        REQUIRE(error <= bound);
        const float most_uv = tests.promise.accurate ? 0x1p-22f : 0x1p-10f;
        REQUIRE(std::abs(hit.u - s.exact.u) <= most_uv);
        REQUIRE(std::abs(hit.v - s.exact.v) <= most_uv);
      }
    }
  }
  for (const auto& [name, ratio] : worst) std::cout << name << ": t off by at most " << ratio << " of the bound\n";
}

TEST_CASE("far from the origin precomputed triangles lose t, and the others do not") {
  std::map<std::string, std::vector<double>> errors;
  Dice dice(6);
  for (int i = 0; i < 200; ++i) {
    const Shot s = shot(dice, true, 1e4f, 1.0f);
    for (const Tested& tests : all_tests()) {
      const Hit hit = Leaf(tests, s.mesh).closest_hit(s.ray);
      if (hit.is_hit())
        errors[std::string(tests.intersector)].push_back(std::abs(hit.t - s.exact.t) / ulp_of(s.exact.t));
    }
  }
  for (auto& [name, list] : errors) {
    INFO(name);
    std::ranges::sort(list);
    const double median = list[list.size() / 2];
    std::cout << name << ": median error of t at offset 1e4: " << median << " ulp\n";
    const bool precomputed = name == "baldwin_weber" || name == "havel_herout" || name == "wald_projection";
    CHECK((precomputed ? median > 100 : median < 4));
    for (const Promise& p : kPromises)
      if (p.intersector == name && p.accurate) CHECK(list.back() <= 0.501);
  }
}

TEST_CASE("edges and vertices of a closed fan are not lost where that is promised, and are elsewhere") {
  struct Lost {
    std::size_t edges = 0, vertices = 0;
  };
  std::map<std::string, Lost> lost;
  Dice dice(7);
  for (int i = 0; i < 700; ++i) {
    // Every other fan has small whole numbers, so that rays meet its edges and vertices exactly.
    const bool whole = i % 2 == 0;
    const float offset = i % 3 == 0 && !whole ? 1e3f : 0.0f;
    const auto rounded = [&](Vec3f p) {
      return whole ? Vec3f{std::round(p.x * 64), std::round(p.y * 64), std::round(p.z * 64)}
                   : p + Vec3f{offset, offset, -offset};
    };
    const Vec3f o = dice.point() * 3.0f, c = dice.point(), d = normalize(c - o);
    const Vec3f x = normalize(cross(d, std::abs(d.x) < 0.6f ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0})), y = cross(d, x);
    const int n = 3 + dice.integer(8);
    TriangleMesh fan;
    fan.vertices = {rounded(c)};
    for (int k = 0; k < n; ++k) {
      const float angle = 6.2831853f * (float(k) + dice.uniform(-0.2f, 0.2f)) / float(n),
                  radius = dice.uniform(0.6f, 1.4f);
      fan.vertices.push_back(
          rounded(c + (x * std::cos(angle) + y * std::sin(angle)) * radius + d * dice.uniform(-0.3f, 0.3f)));
      // Each begins with another corner: the edges from a common first corner are alike even in tests that promise
      // nothing.
      const std::uint32_t ring[] = {0, std::uint32_t(1 + k), std::uint32_t(1 + (k + 1) % n)};
      const int first = dice.integer(3);
      fan.triangles.push_back({ring[first], ring[(first + 1) % 3], ring[(first + 2) % 3]});
    }
    const Vec3f from = rounded(o), centre = fan.vertices[0];
    std::vector<Ray> rays{{from, 0, centre - from, kFar}};
    for (int k = 1; k <= n; ++k) {
      const Vec3f spoke = centre + (fan.vertices[std::size_t(k)] - centre) * (whole ? 0.5f : dice.uniform(0.2f, 0.8f));
      rays.push_back({from, 0, spoke - from, kFar});
    }
    for (const Tested& tests : all_tests()) {
      const Leaf leaf(tests, fan);
      Lost& l = lost[std::string(tests.intersector)];
      for (const Ray& ray : rays) {
        const bool at_vertex = &ray == &rays.front(), missed = !leaf.closest_hit(ray).is_hit();
        (at_vertex ? l.vertices : l.edges) += missed;
        INFO(tests.name() << ", fan " << i << ", ray " << &ray - rays.data());
        REQUIRE(leaf.any_hit(ray) == !missed);
        if (missed) REQUIRE_FALSE((at_vertex ? tests.promise.vertices : tests.promise.edges));
      }
    }
  }
  for (const char* name : {"moller_trumbore", "baldwin_weber", "havel_herout", "wald_projection"}) {
    INFO(name);
    CHECK(lost[name].edges > 0);
    CHECK(lost[name].vertices > 0);
  }
  for (const auto& [name, l] : lost)
    std::cout << name << ": lost " << l.edges << " at edges, " << l.vertices << " at vertices\n";
}

TEST_CASE("a ray within a closed mesh as small as floats allow is not lost, and t is right") {
  const TriangleMesh ball = sphere(6, 12, true);
  Dice dice(11);
  std::vector<std::pair<Vec3f, Vec3f>> lines;
  for (int i = 0; i < 150; ++i) {
    const Triangle t = ball.triangles[std::size_t(dice.integer(int(ball.size())))];
    const Vec3f a = ball.vertices[t.a], b = ball.vertices[t.b], c = ball.vertices[t.c], from = dice.point() * 0.3f;
    const float u = dice.uniform(0.1f, 0.9f);
    lines.emplace_back(from, a + (b - a) * u + (c - a) * (i % 2 == 0 ? 0.0f : 0.5f * (1.0f - u)) - from);
  }
  for (const Tested& tests : all_tests()) {
    if (!tests.promise.edges) continue;
    std::vector<float> at_1;
    for (const int exponent : {0, -40, -56, -70, -100, -140}) {
      TriangleMesh mesh = ball;
      for (Vec3f& v : mesh.vertices) v = v * std::ldexp(1.0f, exponent);
      const Leaf leaf(tests, mesh);
      for (std::size_t i = 0; i < lines.size(); ++i) {
        const auto [from, direction] = lines[i];
        INFO(tests.name() << " at 2^" << exponent << ", ray " << i);
        const Hit hit = leaf.closest_hit({from * std::ldexp(1.0f, exponent), 0, direction, kFar});
        REQUIRE(hit.is_hit());
        if (exponent == 0) at_1.push_back(hit.t);
        // Below 2^-126 corners are rounded as well.
        if (exponent >= -100) REQUIRE(std::ldexp(hit.t, -exponent) == Approx(at_1[i]).epsilon(1e-4));
      }
    }
  }
}

TEST_CASE("a triangle of zero area is never hit") {
  Dice dice(8);
  std::map<std::string, std::size_t> hits;
  for (int i = 0; i < 600; ++i) {
    const Vec3f a = dice.point(), b = i % 2 ? dice.point() : a * 2.0f;
    TriangleMesh mesh;
    switch (i % 6) {
      case 0: add_triangle(mesh, a, b, a * 4.0f); break;  // irregular and exactly on a line through the origin
      case 1: add_triangle(mesh, a, a, b); break;
      case 2: add_triangle(mesh, a, b, a); break;
      case 3: add_triangle(mesh, b, a, a); break;
      case 4: add_triangle(mesh, a, a, a); break;
      default: {  // the middle of two points of even whole numbers
        const auto even = [](Vec3f p) {
          return Vec3f{2 * std::round(p.x * 1e6f), 2 * std::round(p.y * 1e6f), 2 * std::round(p.z * 1e6f)};
        };
        add_triangle(mesh, even(a), even(b), (even(a) + even(b)) * 0.5f);
      }
    }
    const auto corner = mesh.corners(0);
    const Vec3f o = dice.point() * (3.0f * length(corner[0])),
                p = corner[0] + (corner[1] - corner[0]) * dice.uniform(0.0f, 1.0f);
    for (const Ray& ray : {Ray{o, 0, p - o, kFar}, Ray{o, 0, corner[2] - o, kFar}, Ray{{}, 0, corner[0], kFar},
                           Ray{corner[0] * -3.0f, 0, corner[0], kFar}}) {
      for (const Tested& tests : all_tests()) {
        // Indices name what the vertices are now: refit and motion may give them an area
        if (tests.leaf.ends_with('i')) continue;
        INFO(tests.name() << ", triangle " << i);
        hits[std::string(tests.intersector)] += Leaf(tests, mesh).closest_hit(ray).is_hit();
      }
    }
  }
  for (const auto& [name, count] : hits) {
    INFO(name);
    CHECK(count == 0);
  }
}

TEST_CASE("the interval is closed") {
  Dice dice(9);
  for (int i = 0; i < 60; ++i) {
    const Shot s = shot(dice, true, 0.0f, 1.0f);
    for (const Tested& tests : all_tests()) {
      // Near tnear watertight computes t again, more precisely; and what is exact rounds t after it has decided.
      if (tests.promise.vertices) continue;
      INFO(tests.name() << ", shot " << i);
      const Leaf leaf(tests, s.mesh);
      const float t = leaf.closest_hit(s.ray).t;
      const auto within = [&](float tnear, float tfar) { return Ray{s.ray.origin, tnear, s.ray.direction, tfar}; };
      for (const auto& [ray, expected] :
           {std::pair(within(t, t), true), std::pair(within(std::nextafter(t, kFar), kFar), false),
            std::pair(within(0, std::nextafter(t, 0.0f)), false)}) {
        REQUIRE(leaf.closest_hit(ray).is_hit() == expected);
        REQUIRE(leaf.any_hit(ray) == expected);
      }
    }
  }
}

TEST_CASE("precomputed numbers are those of their definitions") {
  Dice dice(10);
  for (int i = 0; i < 200; ++i) {
    const std::array<Vec3f, 3> corner = shot(dice, true, 0.0f, 1.0f).mesh.corners(0);
    const auto row = unit_triangle_transform(corner), plane = barycentric_planes(corner);
    const auto [number, axis] = projected_triangle(corner);
    const auto value = [](const auto& numbers, std::size_t at, Vec3f p) {
      return numbers[at] * p.x + numbers[at + 1] * p.y + numbers[at + 2] * p.z;
    };
    for (std::size_t k = 0; k < 3; ++k) {
      INFO("triangle " << i << ", corner " << k);
      const Vec3f p = corner[k];
      const float turned[3] = {p[std::size_t(axis)], p[std::size_t(axis + 1) % 3], p[std::size_t(axis + 2) % 3]};
      const float size = 1e-5f * (1.0f + float(sum(p)));
      CHECK(std::abs(turned[0] + number[0] * turned[1] + number[1] * turned[2] - number[2]) < size);
      CHECK(std::abs(value(row, 8, p) + row[11]) < size);
      CHECK(std::abs(value(plane, 0, p) - plane[3]) < 2 * size);
      for (std::size_t w : {1, 2}) {  // u, then v
        const float expected = w == k ? 1.0f : 0.0f, most = 2e-4f * (1.0f + float(sum(p)));
        CHECK(std::abs(value(row, 4 * (w - 1), p) + row[4 * w - 1] - expected) < most);
        CHECK(std::abs(value(plane, 4 * w, p) + plane[4 * w + 3] - expected) < most);
        CHECK(std::abs(number[3 * w] * turned[1] + number[3 * w + 1] * turned[2] + number[3 * w + 2] - expected) <
              most);
      }
    }
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(std::isnan(projected_triangle({Vec3f{0, 0, 0}, Vec3f{1, 1, 1}, Vec3f{3, 3, 3}}).number[0]));
  CHECK(std::isnan(barycentric_planes({Vec3f{0, 0, nan}, Vec3f{1, 0, 1}, Vec3f{0, 3, 3}})[0]));
}
