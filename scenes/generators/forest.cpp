// forest: four kinds of trees, each made once and placed hundreds of times, on a ground. Instances are kept.
#include "core/random.h"
#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"
#include "scenes/layout.h"

namespace arboretum {
namespace {

constexpr std::size_t kKinds = 4, kWantedTrees = 1000, kSmallestTree = 36, kLargestTree = 4096;

/// A trunk and a crown of one to three cones with wavy rims, all closed: `count` triangles, even.
TriangleMesh tree(std::size_t kind, std::size_t count) {
  MeshBuilder builder;
  const std::size_t trunk = MeshBuilder::closed_count(count / 6), cones = 1 + kind % 3;
  const double height = 4.0 + double(kind), width = 1.4 - 0.15 * double(kind);
  builder.add_closed(trunk, 3.0, 0, [&](double v, double turns) {
    const UnitCircle around(-turns);  // v goes up
    const double radius = 0.12 * height / 5.0 * (1.0 - 0.5 * v);
    const double r = v > 0.0 && v < 1.0 ? radius : 0.0;
    return Vec3d{r * around.cosine, 0.45 * height * v - 0.05, r * around.sine};
  });
  for (std::size_t i = 0; i < cones; ++i) {
    const std::size_t left = count - builder.size();
    const std::size_t own = i + 1 == cones ? left : MeshBuilder::closed_count(left / (cones - i));
    const double base = height * (0.25 + 0.5 * double(i) / double(cones)),
                 top = base + height * (0.75 - 0.1 * double(i)) / double(cones) + 0.4;
    const double radius = width * (1.0 - 0.25 * double(i));
    builder.add_closed(own, 1.0, std::uint16_t(1 + kind % 2), [&](double v, double turns) {
      const UnitCircle around(-turns), waves(turns * double(5 + 2 * kind) + 0.3 * double(i));
      const double rim = v <= 0.25 ? v * 4.0 : (1.0 - v) / 0.75;  // out along the underside, up along the cone
      const double r = radius * rim * (1.0 + 0.15 * waves.sine);
      const double y = v <= 0.25 ? base : base + (top - base) * (v - 0.25) / 0.75;
      return Vec3d{r * around.cosine, y - 0.1 * rim * waves.cosine, r * around.sine};
    });
  }
  return builder.take();
}

/// Scaled, turned about its own axis, leant a little, and put on the ground.
AffineMap place(std::uint64_t seed, std::size_t index, double x, double z) {
  const auto draw = [&](std::uint64_t dimension) { return random_double(seed, index, dimension); };
  const double scale = 0.7 + 0.7 * draw(2);
  const UnitCircle turn(draw(3)), lean(0.02 * (draw(4) - 0.5));
  AffineMap map;
  const double rows[3][3] = {{turn.cosine, 0.0, turn.sine},
                             {lean.sine * turn.sine, lean.cosine, -lean.sine * turn.cosine},
                             {-lean.cosine * turn.sine, lean.sine, lean.cosine * turn.cosine}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) map.m[i][j] = scale * rows[i][j];
  map.m[0][3] = x, map.m[2][3] = z;
  return map;
}

}  // namespace

Scene generate_forest(std::size_t triangles, std::uint64_t seed) {
  const std::size_t per_tree = std::clamp(triangles / kWantedTrees, kSmallestTree, kLargestTree) / 2 * 2;
  const std::size_t trees = (triangles - 1) / per_tree;
  const auto side = std::size_t(std::ceil(std::sqrt(double(std::max<std::size_t>(trees, 1)))));
  const double spacing = 2.6, half = 0.5 * spacing * double(side) + 2.0;

  Layout layout;
  for (std::size_t kind = 0; kind < kKinds; ++kind) layout.add_part(tree(kind, per_tree));
  MeshBuilder ground;
  ground.add_patch(triangles - trees * per_tree, 1.0, 3, [&](double u, double v) {
    return Vec3d{(2.0 * u - 1.0) * half, 0.0, (1.0 - 2.0 * v) * half};
  });
  for (std::size_t i = 0; i < trees; ++i) {
    const double x = (double(i % side) + 0.2 + 0.6 * random_double(seed, i, 0) - 0.5 * double(side)) * spacing;
    const double z = (double(i / side) + 0.2 + 0.6 * random_double(seed, i, 1) - 0.5 * double(side)) * spacing;
    layout.place(std::uint32_t(random_bits(seed, i, 5) % kKinds), place(seed, i, x, z), 0);
  }
  layout.place(layout.add_part(ground.take()), AffineMap{}, 0);

  Scene scene;
  scene.mesh = layout.take(true);
  scene.instances = trees + 1;
  scene.materials.push_back(Material{.name = "bark", .diffuse = {0.3f, 0.2f, 0.12f}});
  scene.materials.push_back(Material{.name = "needles", .diffuse = {0.1f, 0.3f, 0.12f}});
  scene.materials.push_back(Material{.name = "leaves", .diffuse = {0.25f, 0.4f, 0.1f}});
  scene.materials.push_back(Material{.name = "soil", .diffuse = {0.35f, 0.3f, 0.2f}});
  const auto f = [](double a) { return float(a); };
  scene.camera = Camera{.position = {f(0.4 * half), f(5.0 + 0.25 * half), f(1.15 * half + 4.0)},
                        .look_at = {0, 2, 0},
                        .vertical_fov = 45};
  scene.lights.push_back(
      Light{.position = {f(half), f(30.0 + half), f(half)}, .intensity = Vec3f{1, 1, 1} * f(half * half + 900.0)});
  return scene;
}

}  // namespace arboretum
