// cornell_box: a room of own measures after the Cornell box (Goral et al. 1984), with a lamp, a glass and a
// mirror sphere, a block of rough metal and a matt one. Tessellated to the count; with few triangles the
// things come in this order: floor, back wall, lamp, sides, ceiling, glass sphere, mirror sphere, blocks.
#include <array>
#include <vector>

#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {
namespace {

enum Color : std::uint16_t { kWhite, kRed, kGreen, kLamp, kGlass, kMirror, kMetal };

struct Wall {
  Vec3d corner, u, v;
  Color color;
  std::size_t weight;
};

struct Ball {
  Vec3d center;
  double radius;
  Color color;
};

// A room of 2 x 2 x 2 with its floor at y = 0, open towards +z. Walls face inwards.
const Wall kFloor{{-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, kWhite, 4};
const std::array<Wall, 5> kWalls{{
    {{-1, 0, -1}, {2, 0, 0}, {0, 2, 0}, kWhite, 4},
    {{-0.3, 1.99, -0.3}, {0.6, 0, 0}, {0, 0, 0.6}, kLamp, 1},
    {{-1, 0, 1}, {0, 0, -2}, {0, 2, 0}, kRed, 4},
    {{1, 0, -1}, {0, 0, 2}, {0, 2, 0}, kGreen, 4},
    {{-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, kWhite, 4},
}};
const std::array<Ball, 2> kBalls{{{{0.42, 0.39, 0.4}, 0.33, kGlass}, {{-0.45, 0.42, -0.3}, 0.4, kMirror}}};
constexpr std::size_t kBallWeight = 24, kSmallestBall = 24, kBox = 12;

void add_wall(MeshBuilder& builder, const Wall& wall, std::size_t count) {
  builder.add_patch(count, length(wall.u) / length(wall.v), wall.color,
                    [&wall](double u, double v) { return wall.corner + wall.u * u + wall.v * v; });
}

void add_ball(MeshBuilder& builder, const Ball& ball, std::size_t count) {
  builder.add_closed(count, 0.5, ball.color, [&ball](double v, double turns) {
    const UnitCircle latitude(0.5 * v), longitude(turns);
    return ball.center +
           Vec3d{latitude.sine * longitude.cosine, -latitude.cosine, -latitude.sine * longitude.sine} * ball.radius;
  });
}

}  // namespace

Scene generate_cornell_box(std::size_t triangles, std::uint64_t) {
  // What fits at its least size comes in; what is left over is shared by weight, the floor takes the
  // remainder.
  std::size_t left = triangles - 1, weights = kFloor.weight;
  std::array<std::size_t, kWalls.size()> walls{};
  std::array<std::size_t, kBalls.size()> balls{};
  for (std::size_t i = 0; i < kWalls.size() && left >= 2; ++i) walls[i] = 2, left -= 2, weights += kWalls[i].weight;
  for (std::size_t i = 0; i < kBalls.size() && left >= kSmallestBall; ++i)
    balls[i] = kSmallestBall, left -= kSmallestBall, weights += kBallWeight;
  std::size_t boxes = 0;
  for (; boxes < 2 && left >= kBox; ++boxes) left -= kBox;
  const std::size_t shared = left;
  for (std::size_t i = 0; i < kWalls.size(); ++i)
    if (walls[i] > 0) walls[i] += shared * kWalls[i].weight / weights, left -= shared * kWalls[i].weight / weights;
  for (std::size_t& ball : balls) {
    if (ball == 0) continue;
    const std::size_t more = shared * kBallWeight / weights & ~std::size_t{1};
    ball += more, left -= more;
  }
  MeshBuilder builder;
  add_wall(builder, kFloor, left + 1);
  for (std::size_t i = 0; i < kWalls.size(); ++i)
    if (walls[i] > 0) add_wall(builder, kWalls[i], walls[i]);
  for (std::size_t i = 0; i < kBalls.size(); ++i)
    if (balls[i] > 0) add_ball(builder, kBalls[i], balls[i]);
  // A little below the floor, so that no two faces lie in one plane.
  if (boxes > 0) builder.add_box({0.25, -0.01, -0.75}, {0.8, 1.1, -0.25}, kMetal);
  if (boxes > 1) builder.add_box({-0.75, -0.01, 0.35}, {-0.35, 0.3, 0.75}, kWhite);

  Scene scene;
  scene.mesh = builder.take();
  scene.materials = {
      Material{.name = "white", .diffuse = {0.73f, 0.73f, 0.73f}},
      Material{.name = "red", .diffuse = {0.65f, 0.05f, 0.05f}},
      Material{.name = "green", .diffuse = {0.12f, 0.45f, 0.15f}},
      Material{.name = "lamp", .diffuse = {0.8f, 0.8f, 0.8f}, .emission = {15, 13, 10}},
      Material{.name = "glass", .diffuse = {0, 0, 0}, .specular = {1, 1, 1}, .ior = 1.5f, .illum = 7},
      Material{.name = "mirror", .diffuse = {0, 0, 0}, .specular = {0.9f, 0.9f, 0.9f}, .illum = 3},
      Material{.name = "metal", .diffuse = {0, 0, 0}, .specular = {0.8f, 0.6f, 0.4f}, .roughness = 0.2f, .illum = 3},
  };
  // Off the middle: from there the room's edges would run through pixel centres.
  scene.camera = Camera{.position = {0.05f, 1.04f, 3.9f}, .look_at = {0.02f, 1, 0}, .vertical_fov = 40};
  return scene;
}

}  // namespace arboretum
