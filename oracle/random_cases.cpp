#include "oracle/random_cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/random.h"

namespace arboretum {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// No two rolls in one expression: their order would be the compiler's.
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t index) : seed_(seed), index_(index) {}
  std::uint64_t bits() { return random_bits(seed_, index_, next_++); }
  std::uint32_t below(std::size_t n) { return static_cast<std::uint32_t>(bits() % n); }
  float uniform(float low = -1.0f, float high = 1.0f) {
    return low + (high - low) * random_float(seed_, index_, next_++);
  }
  /// Signed, 2^low .. 2^high in size.
  float exponential(int low, int high) {
    const int exponent = low + static_cast<int>(below(static_cast<std::size_t>(high - low)));
    return std::ldexp(below(2) ? uniform(1, 2) : uniform(-2, -1), exponent);
  }
  Vec3f cube() {
    const float x = uniform(), y = uniform(), z = uniform();
    return {x, y, z};
  }
  Vec3f wide(int low, int high) {
    const float x = exponential(low, high), y = exponential(low, high), z = exponential(low, high);
    return {x, y, z};
  }
  /// A point of a lattice: many equal coordinates, exact sums.
  Vec3f lattice(std::size_t steps) {
    const float x = float(below(steps)), y = float(below(steps)), z = float(below(steps));
    return {x, y, z};
  }

 private:
  std::uint64_t seed_, index_, next_ = 0;
};

void add(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

void soup(TriangleMesh& mesh, Dice& dice) {
  const int range = 1 + static_cast<int>(dice.below(20));
  for (std::size_t n = 2 + dice.below(40); n > 0; --n) {
    const Vec3f c = dice.wide(-range, range), b = dice.wide(-range, range), a = dice.wide(-range, range);
    add(mesh, a, b, c);
  }
}

/// Two fans base to base: closed, with two vertices of many triangles.
void bipyramid(TriangleMesh& mesh, Dice& dice) {
  const std::uint32_t n = 3 + dice.below(46);
  const float height = std::fabs(dice.exponential(-12, 3));
  mesh.vertices = {{0, 0, height}, {0, 0, -height}};
  for (std::uint32_t i = 0; i < n; ++i) {
    const float turn = 4.0f * (float(i) + dice.uniform(0, 0.9f)) / float(n);  // round a square
    const float s = turn - std::floor(turn);
    const Vec3f ring[4] = {{1, s, 0}, {1 - s, 1, 0}, {-s, 1 - s, 0}, {s, -s, 0}};
    Vec3f p = ring[std::min<std::size_t>(static_cast<std::size_t>(turn), 3)];
    p = p - Vec3f{0.25f, 0.4f, 0};
    p.z = dice.uniform() * 0x1p-6f * height;
    mesh.vertices.push_back(p);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t a = 2 + i, b = 2 + (i + 1) % n;
    mesh.triangles.push_back({0, a, b}), mesh.triangles.push_back({1, b, a});
  }
}

void height_field(TriangleMesh& mesh, Dice& dice) {
  const std::uint32_t n = 2 + dice.below(5);
  const float height = dice.below(3) == 0 ? 0.0f : std::fabs(dice.exponential(-30, 1));
  const std::size_t up = dice.below(3);
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x) {
      Vec3f p;
      p[up] = height * dice.uniform(), p[(up + 1) % 3] = float(x), p[(up + 2) % 3] = float(y);
      mesh.vertices.push_back(p);
    }
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d}), mesh.triangles.push_back({a, d, c});
    }
}

void slivers(TriangleMesh& mesh, Dice& dice) {
  const float width = std::fabs(dice.exponential(-24, -2));
  const std::uint32_t n = 2 + dice.below(30);
  for (std::uint32_t i = 0; i <= n; ++i) {
    const float x = float(i) * width, bend = width * dice.uniform();
    mesh.vertices.push_back({x, 0, bend}), mesh.vertices.push_back({x + width * dice.uniform(0, 0.5f), 1, -bend});
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t a = 2 * i;
    mesh.triangles.push_back({a, a + 2, a + 3}), mesh.triangles.push_back({a, a + 3, a + 1});
  }
}

/// Random triangles over few vertices of a lattice: shared edges, coplanar and duplicate triangles, degenerate ones.
void tangle(TriangleMesh& mesh, Dice& dice) {
  const std::size_t vertices = 4 + dice.below(8), steps = 2 + dice.below(6);
  for (std::size_t i = 0; i < vertices; ++i) mesh.vertices.push_back(dice.lattice(steps));
  for (std::size_t n = 3 + dice.below(50); n > 0; --n) {
    const std::uint32_t a = dice.below(vertices), b = dice.below(vertices), c = dice.below(vertices);
    mesh.triangles.push_back({a, b, c});
  }
}

/// Octahedra about one centre, each an ulp to twice as large as the last.
void shells(TriangleMesh& mesh, Dice& dice) {
  float size = 1.0f;
  const Vec3f middle = dice.below(2) ? dice.cube() : Vec3f{};
  for (std::size_t n = 1 + dice.below(8); n > 0; --n) {
    for (unsigned octant = 0; octant < 8; ++octant) {
      const Vec3f x = middle + Vec3f{octant & 1 ? size : -size, 0, 0},
                  y = middle + Vec3f{0, octant & 2 ? size : -size, 0};
      add(mesh, x, y, middle + Vec3f{0, 0, octant & 4 ? size : -size});
    }
    size = dice.below(2) ? std::nextafter(size, kInfinity) : size * (1 + std::fabs(dice.exponential(-23, 1)));
  }
}

RandomSubject with_rays(TriangleMesh mesh, std::uint64_t seed, std::uint64_t index, std::size_t count) {
  RandomSubject subject{std::move(mesh), {}};
  const HardRayMaker maker(subject.mesh);
  std::vector<HardKind> kinds;
  for (std::size_t k = 0; k < kMadeKinds; ++k)
    if (maker.has(static_cast<HardKind>(k))) kinds.push_back(static_cast<HardKind>(k));
  subject.rays = maker.make(mix64(seed ^ 0x7261797365656421u), index * count, count, kinds);
  return subject;
}

}  // namespace

RandomSubject random_subject(std::uint64_t seed, std::uint64_t index, std::size_t rays) {
  Dice dice(seed, index);
  TriangleMesh mesh;
  constexpr std::array kRecipes{soup, bipyramid, height_field, slivers, tangle, shells};
  kRecipes[dice.below(kRecipes.size())](mesh, dice);
  const double offset = dice.below(2) ? 0.0 : double(dice.exponential(-10, 17));
  const int exponent = dice.below(2) ? 0 : static_cast<int>(dice.below(41)) - 30;  // the far ones reach 2^27 radii
  return with_rays(moved_and_scaled(mesh, offset, exponent), seed, index, rays);
}

namespace {

/// x next to itself, times about 1, negated or nothing.
float mutated(float x, Dice& dice) {
  switch (dice.below(4)) {
    case 0: return std::nextafter(x, dice.below(2) ? kInfinity : -kInfinity);
    case 1: return -x;
    case 2: return x * (1 + dice.exponential(-22, -1));
    default: return dice.below(2) ? 0.0f : -0.0f;
  }
}

}  // namespace

RandomSubject mutated_subject(const TriangleMesh& given, const Ray& given_ray, std::uint64_t seed, std::uint64_t index,
                              std::size_t rays) {
  Dice dice(seed, index);
  TriangleMesh mesh = given;
  Ray ray = given_ray;
  // a case may have it below where nothing lies there; its mutations may have something
  if (ray.tnear < 0) ray.tnear = 0;
  const auto any_float = [&]() -> float& {
    if (dice.below(2)) return mesh.vertices[dice.below(mesh.vertices.size())][dice.below(3)];
    return (dice.below(2) ? ray.origin : ray.direction)[dice.below(3)];
  };
  /// A vertex of a case is one of several at its position: they move together.
  const auto change = [&](float& x, float to) {
    for (Vec3f& v : mesh.vertices)
      for (std::size_t a = 0; a < 3; ++a)
        if (&v[a] == &x) {
          const Vec3f before = v;
          for (Vec3f& w : mesh.vertices)
            if (&w != &v && w == before) w[a] = to;
        }
    x = to;
  };
  for (std::size_t n = 1 + dice.below(4); n > 0; --n) {
    float& x = any_float();
    switch (dice.below(6)) {
      case 0: change(x, any_float()); break;
      case 1: change(x, x + dice.exponential(-20, 1)); break;
      default: change(x, mutated(x, dice)); break;
    }
  }
  for (Vec3f& v : mesh.vertices)
    for (std::size_t a = 0; a < 3; ++a)
      if (!(std::fabs(v[a]) <= kMaxCoordinate)) v[a] = std::copysign(1.0f, v[a]);
  if (dice.below(3) == 0) {
    const int exponent = static_cast<int>(dice.below(21)) - 10;
    const auto scale = [&](Vec3f v) {
      return Vec3f{std::ldexp(v.x, exponent), std::ldexp(v.y, exponent), std::ldexp(v.z, exponent)};
    };
    for (Vec3f& v : mesh.vertices) v = scale(v);
    ray.origin = scale(ray.origin), ray.direction = scale(ray.direction);
  }
  RandomSubject subject = with_rays(std::move(mesh), seed, index, rays);
  if (!subject.rays.rays.empty())
    subject.rays.rays[0] = ray, subject.rays.kinds[0] = HardKind::given, subject.rays.sources[0] = kNoPrimitive;
  return subject;
}

std::vector<Ray> in_company(const Ray& ray, std::uint64_t seed, std::size_t count, std::size_t place) {
  std::vector<Ray> rays(count, ray);
  for (std::size_t i = 0; i < count; ++i) {
    if (i == place) continue;
    Dice dice(seed, i);
    Ray& other = rays[i];
    for (std::size_t n = 1 + dice.below(3); n > 0; --n) {
      float& x = (dice.below(3) ? other.direction : other.origin)[dice.below(3)];
      x = mutated(x, dice);
    }
    if (dice.below(4) != 0) continue;
    constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
    switch (dice.below(5)) {
      case 0: other.direction = {0, -0.0f, 0}; break;
      case 1: other.direction[dice.below(3)] = kInfinity; break;
      case 2: other.origin[dice.below(3)] = dice.below(2) ? kNaN : -kInfinity; break;
      case 3: other.direction[dice.below(3)] = kNaN; break;
      default: other.tnear = 1.0f, other.tfar = 0.0f; break;
    }
  }
  return rays;
}

}  // namespace arboretum
