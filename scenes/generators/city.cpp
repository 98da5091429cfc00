// city: lots on a square grid, a street after every fourth; on each lot a tower of one to three boxes, higher
// downtown.
#include "core/random.h"
#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {

Scene generate_city(std::size_t triangles, std::uint64_t seed) {
  constexpr std::size_t kBox = 12, kGround = 2;
  MeshBuilder builder;
  const std::size_t boxes = triangles < kBox + kGround ? 0 : (triangles - kGround) / kBox;
  const std::size_t lots = std::max<std::size_t>(1, (boxes + 1) / 2);  // two boxes a lot on average
  const auto side = std::size_t(std::ceil(std::sqrt(double(lots))));
  const auto place = [](std::size_t i) { return double(i) + 0.8 * double(i / 4); };
  const double extent = place(side - 1) + 1.0, half = 0.5 * extent;

  builder.add_patch(triangles - boxes * kBox, 1.0, 0, [&](double u, double v) {
    return Vec3d{(2.0 * u - 1.0) * (half + 1.0), 0.0, (1.0 - 2.0 * v) * (half + 1.0)};
  });
  std::size_t left = boxes;
  for (std::size_t lot = 0; left > 0; ++lot) {
    std::uint64_t dimension = 0;
    const auto draw = [&](double low, double high) {
      return low + (high - low) * random_double(seed, lot, dimension++);
    };
    const std::size_t cell = lot % (side * side), row = cell / side, column = cell % side;
    const std::size_t storeys = std::min<std::size_t>(left, 1 + std::size_t(draw(0.0, 3.0)));
    const double x = place(column) + 0.5 - half, z = place(row) + 0.5 - half;
    const double from_center = std::min(1.0, (x * x + z * z) / (half * half));
    const double least = draw(0.4, 1.2);
    double height = least + draw(0.0, 1.0) * 5.0 * (1.0 - from_center) * (1.0 - from_center);
    // Lots that come round again (the grid is full, boxes are left) get roof structures that start higher up.
    double base = lot < side * side ? -0.02 : 0.3, width = lot < side * side ? draw(0.36, 0.47) : draw(0.05, 0.2);
    const std::uint16_t material = std::uint16_t(1 + std::uint64_t(draw(0.0, 3.0)));
    for (std::size_t i = 0; i < storeys; ++i) {
      const double depth = width * draw(0.75, 1.0);
      builder.add_box({x - width, base, z - depth}, {x + width, base + height, z + depth}, material);
      // The next box stands inside this one by a little, so that no two faces lie in one plane.
      base += height - 0.01;
      height *= draw(0.25, 0.6), width *= draw(0.45, 0.8);
      --left;
    }
  }
  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(Material{.name = "asphalt", .diffuse = {0.2f, 0.2f, 0.22f}});
  scene.materials.push_back(Material{.name = "concrete", .diffuse = {0.6f, 0.58f, 0.55f}});
  scene.materials.push_back(Material{.name = "brick", .diffuse = {0.5f, 0.25f, 0.18f}});
  scene.materials.push_back(
      Material{.name = "glass_front", .diffuse = {0.1f, 0.13f, 0.16f}, .specular = {0.6f, 0.6f, 0.65f}, .illum = 3});
  const auto f = [](double a) { return float(a); };
  scene.camera = Camera{.position = {f(half * 0.55), f(2.5 + half * 0.35), f(half * 1.15 + 2.0)},
                        .look_at = {0, 1, 0},
                        .vertical_fov = 50};
  scene.lights.push_back(Light{.position = {f(half), f(20.0 + half), f(half * 0.5)},
                               .intensity = Vec3f{1, 1, 1} * f(half * half + 400.0)});
  return scene;
}

}  // namespace arboretum
