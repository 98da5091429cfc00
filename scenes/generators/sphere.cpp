// sphere, fan, sphere_flake. The flake follows the one of Haines' Standard Procedural Databases (1987): on each
// sphere nine of a third of its radius, six around its equator and three above.
#include <deque>

#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {
namespace {

struct Ball {
  Vec3d center;
  double radius;
  Frame frame;  ///< its normal points away from the parent; the children's poles too
  int level;
};

void add_ball(MeshBuilder& builder, const Ball& ball, std::size_t count, std::uint16_t material) {
  builder.add_closed(count, 0.5, material, [&ball](double v, double turns) {
    const UnitCircle latitude(0.5 * v), longitude(turns);  // v = 0: the pole at -normal
    return ball.center + ball.frame.to_world(Vec3d{latitude.sine * longitude.cosine, latitude.sine * longitude.sine,
                                                   -latitude.cosine}) *
                             ball.radius;
  });
}

constexpr int kMostLevels = 7;

/// A ball's share of the triangles is as its radius, in units of the smallest ball of the deepest level.
std::size_t share(int level, int levels) {
  std::size_t s = 1;
  for (int i = level; i < levels; ++i) s *= 3;
  return s;
}

std::size_t all_shares(int levels) {
  std::size_t all = 0, balls = 1;
  for (int level = 0; level <= levels; ++level) all += balls * share(level, levels), balls *= 9;
  return all;
}

}  // namespace

Scene generate_sphere(std::size_t triangles, std::uint64_t) {
  MeshBuilder builder;
  add_ball(builder, Ball{{0, 0, 0}, 1.0, Frame({0, 1, 0}), 0}, MeshBuilder::closed_count(triangles), 0);
  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(Material{.name = "matt", .diffuse = {0.7f, 0.6f, 0.5f}});
  scene.camera = Camera{.position = {1.2f, 1.4f, 2.6f}, .look_at = {0, 0, 0}};
  scene.lights.push_back(Light{.position = {3, 4, 3}, .intensity = {20, 20, 20}});
  return scene;
}

Scene generate_fan(std::size_t triangles, std::uint64_t) {
  MeshBuilder builder;
  // So squat that a single ring stands between the poles.
  builder.add_closed(MeshBuilder::closed_count(triangles), 1e-9, 0, [](double v, double turns) {
    const UnitCircle longitude(turns);
    const double radius = v > 0.0 && v < 1.0 ? 1.0 : 0.0;
    return Vec3d{radius * longitude.sine, v - 0.5, radius * longitude.cosine};
  });
  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(Material{.name = "matt", .diffuse = {0.6f, 0.7f, 0.5f}});
  scene.camera = Camera{.position = {1.2f, 1.9f, 2.6f}, .look_at = {0, 0, 0}};
  scene.lights.push_back(Light{.position = {3, 4, 3}, .intensity = {20, 20, 20}});
  return scene;
}

Scene generate_sphere_flake(std::size_t triangles, std::uint64_t) {
  constexpr std::size_t kSmallestBall = 48;  // with fewer triangles it looks like a crystal
  const std::size_t wanted = MeshBuilder::closed_count(triangles);
  int levels = 0;
  while (levels < kMostLevels && all_shares(levels + 1) * kSmallestBall <= wanted) ++levels;

  MeshBuilder builder;
  std::deque<Ball> waiting{Ball{{0, 0, 0}, 1.0, Frame({0, 1, 0}), 0}};
  std::size_t shares = all_shares(levels);
  while (!waiting.empty()) {
    const Ball ball = waiting.front();
    waiting.pop_front();
    const std::size_t own = share(ball.level, levels);
    add_ball(builder, ball, MeshBuilder::closed_count((wanted - builder.size()) * own / shares),
             std::uint16_t(ball.level % 2));
    shares -= own;
    if (ball.level == levels) continue;
    for (int child = 0; child < 9; ++child) {
      const bool upper = child >= 6;
      const UnitCircle latitude(upper ? 0.15 : 0.0), longitude(upper ? (child - 6) / 3.0 + 1.0 / 12.0 : child / 6.0);
      const Vec3d direction = normalize(
          ball.frame.to_world({latitude.cosine * longitude.cosine, latitude.cosine * longitude.sine, latitude.sine}));
      const double radius = ball.radius / 3.0;
      waiting.push_back({ball.center + direction * (ball.radius + radius), radius, Frame(direction), ball.level + 1});
    }
  }
  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(
      Material{.name = "mirror", .diffuse = {0.1f, 0.1f, 0.1f}, .specular = {0.8f, 0.7f, 0.5f}, .illum = 3});
  scene.materials.push_back(Material{.name = "matt", .diffuse = {0.3f, 0.4f, 0.7f}});
  scene.camera = Camera{.position = {2.1f, 2.0f, 3.6f}, .look_at = {0, 0.25f, 0}};
  scene.lights.push_back(Light{.position = {4, 6, 3}, .intensity = {40, 40, 40}});
  return scene;
}

}  // namespace arboretum
