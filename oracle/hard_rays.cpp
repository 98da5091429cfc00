#include "oracle/hard_rays.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/coordinates.h"
#include "core/motion.h"
#include "core/random.h"

namespace arboretum {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

float step(float x, std::uint64_t choice) {
  return choice % 3 == 0 ? x : std::nextafter(x, choice % 3 == 1 ? kInfinity : -kInfinity);
}

/// Rounded once for each coordinate.
Vec3f between(Vec3f p, Vec3f q, double s) {
  Vec3f r;
  for (std::size_t a = 0; a < 3; ++a) r[a] = float((1 - s) * p[a] + s * q[a]);
  return r;
}

/// Not a ray in one of the ways that there are; `ray` is one.
Ray spoilt(Ray ray, std::uint64_t way) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::size_t axis = way / 16 % 3;
  switch (way % 8) {
    case 0: ray.origin[axis] = nan; break;
    case 1: ray.direction[axis] = nan; break;
    case 2: ray.origin[axis] = way & 8 ? kInfinity : -kInfinity; break;
    case 3: ray.direction[axis] = way & 8 ? kInfinity : -kInfinity; break;
    case 4: ray.direction = way & 8 ? Vec3f{0, -0.0f, 0} : Vec3f{0, 0, 0}; break;
    case 5: (way & 8 ? ray.tnear : ray.tfar) = nan; break;
    case 6: ray.tnear = 1.0f, ray.tfar = way & 8 ? 0.5f : -kInfinity; break;
    default: ray.tnear = kInfinity, ray.tfar = way & 8 ? -kInfinity : 1.0f; break;
  }
  return ray;
}

}  // namespace

/// The random choices of one ray. Each draw is a statement or declarator of its own: within one expression the order
/// is the compiler's, and rays would differ from compiler to compiler.
class HardRayMaker::Draw {
 public:
  Draw(const HardRayMaker& maker, std::uint64_t seed, std::uint64_t index, float time)
      : maker_(maker), seed_(seed), index_(index), at_(frame_at(time, maker.mesh_.frames())) {}

  std::uint64_t bits() { return random_bits(seed_, index_, next_++); }
  std::size_t below(std::size_t n) { return bits() % n; }
  float uniform(float low = -1.0f, float high = 1.0f) {
    return low + (high - low) * random_float(seed_, index_, next_++);
  }
  Vec3f point() {  // of the cube [-1, 1]^3
    const float x = uniform(), y = uniform(), z = uniform();
    return {x, y, z};
  }
  Vec3f unit() {
    for (;;) {
      const Vec3f p = point();
      const float size = dot(p, p);
      if (size > 0.01f && size <= 1.0f) return normalize(p);
    }
  }
  std::array<Vec3f, 3> corners(std::size_t triangle) const { return maker_.mesh_.corners(triangle, at_); }
  std::size_t triangle() { return below(maker_.mesh_.size()); }

  Vec3f vertex() { return corners(triangle())[below(3)]; }
  Vec3f on_edge(const std::vector<EdgeOf>& edges) {
    const EdgeOf e =
        edges.empty() ? EdgeOf{std::uint32_t(triangle()), std::uint32_t(below(3))} : edges[below(edges.size())];
    const auto c = corners(e.triangle);
    return between(c[e.edge], c[(e.edge + 1) % 3], below(4) == 0 ? 0.5 : random_double(seed_, index_, next_++));
  }
  Vec3f within(std::size_t triangle) {
    double u = random_double(seed_, index_, next_++), v = random_double(seed_, index_, next_++);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const auto c = corners(triangle);
    Vec3f p;
    for (std::size_t a = 0; a < 3; ++a) p[a] = float((1 - u - v) * c[0][a] + u * c[1][a] + v * c[2][a]);
    return p;
  }
  Vec3f target() {
    const std::size_t what = below(3);
    return what == 0 ? vertex() : what == 1 ? on_edge(maker_.shared_) : within(triangle());
  }

  /// Where a ray at `p` starts: within the scene's box, around it, or close to p.
  Vec3f start(Vec3f p) {
    const Bounds3f& box = maker_.bounds_;
    const std::size_t where = below(4);
    if (where == 0) {
      const float distance = std::ldexp(maker_.radius_, -static_cast<int>(below(18)));
      return p + unit() * distance;
    }
    const Vec3f middle = box.lower * 0.5f + box.upper * 0.5f;
    if (where == 1) return middle + unit() * (3 * maker_.radius_);
    Vec3f inside;
    for (std::size_t a = 0; a < 3; ++a) inside[a] = middle[a] + uniform(-0.5f, 0.5f) * (box.upper[a] - box.lower[a]);
    return inside;
  }
  /// A ray from `o` at `p`; its t there is about 1, or the distance.
  Ray aimed(Vec3f o, Vec3f p) {
    Ray ray{o, 0.0f, p - o, kInfinity};
    if (ray.direction == Vec3f{}) ray.direction = unit();
    if (below(4) == 0) {
      const Vec3f d = normalize(ray.direction);
      if (is_finite(d) && d != Vec3f{}) ray.direction = d;
    }
    return ray;
  }
  Ray aimed(Vec3f p) { return aimed(start(p), p); }

  /// o + d = p exactly where p's numbers leave room; else a ray aimed as others are.
  Ray exactly_at(Vec3f p) {
    const float grid = std::ldexp(1.0f, std::ilogb(maker_.radius_) - 11);
    Vec3f d, o;
    for (std::size_t a = 0; a < 3; ++a) {
      d[a] = grid * (float(below(4096)) - 2048.0f);
      o[a] = p[a] - d[a];
      if (double(p[a]) - double(d[a]) != double(o[a])) return aimed(p);
    }
    return d == Vec3f{} ? aimed(p) : Ray{o, 0.0f, d, kInfinity};
  }

  Ray grazing() {
    const auto c = corners(triangle());
    const Vec3f e1 = c[1] - c[0], e2 = c[2] - c[0];
    const float v = uniform(0, 1), u = uniform(0, 1), along_v = uniform(), along_u = uniform();
    const Vec3f p = c[0] + e1 * u + e2 * v, along = e1 * along_u + e2 * along_v;
    const int smaller = static_cast<int>(below(26));
    const float lift = std::ldexp(uniform(), -smaller);
    const Vec3f n = normalize(cross(e1, e2));
    const float size = std::max(length(along), maker_.radius_ * 0x1p-20f);
    const Vec3f o = p - along * uniform(0, 4) + (is_finite(n) ? n * (lift * size) : Vec3f{});
    return below(2) == 0 ? aimed(o, below(2) == 0 ? c[below(3)] : p)
                         : Ray{o, 0.0f, along == Vec3f{} ? unit() : along, kInfinity};
  }
  Ray along_axis() {
    const Vec3f p = target();
    const std::size_t axis = below(3);
    const float sign = below(2) ? 1.0f : -1.0f;
    const bool negative_zero = below(2);
    Ray ray{p, 0.0f, negative_zero ? Vec3f{-0.0f, -0.0f, -0.0f} : Vec3f{}, kInfinity};
    ray.origin[axis] = p[axis] - sign * maker_.radius_ * uniform(0, 4);
    ray.direction[axis] = sign * (below(2) ? 1.0f : maker_.radius_);
    return ray;
  }
  Ray in_plane() {
    const Vec3f p = vertex();
    const std::size_t axis = below(3), tiny = below(8);
    Vec3f o = start(p), at = below(2) ? p : target();
    o[axis] = at[axis] = p[axis];
    Ray ray = aimed(o, at);
    if (ray.direction[axis] != 0.0f || below(2)) ray.direction[axis] = below(2) ? 0.0f : -0.0f;
    if (tiny == 0) {
      const int exponent = -70 - static_cast<int>(below(70));
      ray.direction[axis] = std::ldexp(uniform(), exponent);
    }
    if (ray.direction == Vec3f{}) ray.direction[(axis + 1) % 3] = 1.0f;
    return ray;
  }
  Ray from_surface(std::uint32_t& source) {
    source = static_cast<std::uint32_t>(triangle());
    Vec3f p = within(source), d = unit();
    if (below(2)) {
      const auto c = corners(source);
      const Vec3f n = normalize(cross(c[1] - c[0], c[2] - c[0]));
      const float size = largest_coordinate(p) * 0x1p-20f;
      if (is_finite(n)) p = p + n * (dot(n, d) < 0 ? -size : size);
    }
    return {p, 0.0f, d, kInfinity};
  }
  Ray from_far() {
    const Vec3f p = target();
    const float distance = std::ldexp(maker_.radius_, 2 + static_cast<int>(below(26)));
    return aimed(p + unit() * distance, p);
  }
  Ray ending() {
    const Vec3f p = target(), o = start(p);
    Ray ray{o, 0.0f, p - o, kInfinity};
    if (ray.direction == Vec3f{}) ray.direction = unit();
    (below(2) ? ray.tnear : ray.tfar) = step(1.0f, below(3));
    return ray;
  }

  Ray ray(HardKind kind, std::uint32_t& source) {
    const Ray made = of_kind(kind, source);
    return kind != HardKind::invalid && below(8) == 0 ? at_another_speed(made) : made;
  }

 private:
  /// The same ray where a power of two makes its direction longer or shorter by up to 2^40, and its distances the other
  /// way round; `ray` itself where numbers do not reach so far.
  Ray at_another_speed(Ray ray) {
    const int k = static_cast<int>(below(81)) - 40;
    const Ray before = ray;
    bool exact = true;
    const auto scale = [&exact](float& x, int by) {
      const float scaled = std::ldexp(x, by);
      exact &= std::ldexp(scaled, -by) == x;
      x = scaled;
    };
    for (std::size_t a = 0; a < 3; ++a) scale(ray.direction[a], k);
    scale(ray.tnear, -k), scale(ray.tfar, -k);
    return exact ? ray : before;
  }

  Ray of_kind(HardKind kind, std::uint32_t& source) {
    switch (kind) {
      case HardKind::vertex: {
        const Vec3f p = vertex();
        return below(4) == 0 ? exactly_at(p) : aimed(p);
      }
      case HardKind::edge: return aimed(on_edge(maker_.shared_));
      case HardKind::border: return aimed(on_edge(maker_.border_));
      case HardKind::interior: return aimed(within(triangle()));
      case HardKind::grazing: return grazing();
      case HardKind::axis: return along_axis();
      case HardKind::plane: return in_plane();
      case HardKind::surface: return from_surface(source);
      case HardKind::far: return from_far();
      case HardKind::interval: return ending();
      case HardKind::invalid: {
        const std::uint64_t way = bits();
        return spoilt(aimed(target()), way);
      }
      case HardKind::given: break;
    }
    return {};
  }

  const HardRayMaker& maker_;
  std::uint64_t seed_, index_, next_ = 0;
  FrameTime at_;
};

HardRayMaker::HardRayMaker(const TriangleMesh& mesh) : mesh_(mesh), bounds_(mesh.bounds()) {
  const Vec3f half = bounds_.upper * 0.5f - bounds_.lower * 0.5f;
  radius_ = std::max({half.x, half.y, half.z, std::numeric_limits<float>::min()});
  const SurfaceAdjacency adjacency(mesh);
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::size_t there = adjacency.triangles_at_edge(i, k);
      if (there == 2) shared_.push_back({i, k});
      if (there == 1 || there > 2) border_.push_back({i, k});
    }
  }
}

bool HardRayMaker::has(HardKind kind) const noexcept {
  return kind == HardKind::edge ? !shared_.empty() : kind != HardKind::border || !border_.empty();
}

HardRays HardRayMaker::make(std::uint64_t seed, std::uint64_t first, std::size_t count,
                            std::span<const HardKind> kinds) const {
  HardRays made;
  made.rays.resize(count), made.kinds.resize(count);
  made.sources.assign(count, kNoPrimitive);
  if (mesh_.moves()) made.times.resize(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const std::uint64_t index = first + i;
    const float time = mesh_.moves() ? random_float(seed, index, ~std::uint64_t{0}) : 0.0f;
    if (mesh_.moves()) made.times[i] = time;
    made.kinds[i] = kinds[index % kinds.size()];
    made.rays[i] = Draw(*this, seed, index, time).ray(made.kinds[i], made.sources[i]);
  });
  return made;
}

TriangleMesh moved_and_scaled(const TriangleMesh& mesh, double offset, int exponent) {
  TriangleMesh result = mesh;
  if (offset == 0.0 && exponent == 0) return result;
  result.instancing.reset();
  const std::array<double, 3> by = displacement(offset);
  const auto move = [&](Vec3f& v) {
    for (std::size_t a = 0; a < 3; ++a) v[a] = std::ldexp(float(double(v[a]) + by[a]), exponent);
  };
  for (Vec3f& v : result.vertices) move(v);
  for (auto& frame : result.later_frames)
    for (Vec3f& v : frame) move(v);
  return result;
}

}  // namespace arboretum
