// Radiance against what it must be: furnaces, point and area lights, mirrors, glass, holes, motion, a lens.

#include <numbers>

#include "rendering/bsdf.h"
#include "rendering/surface_point.h"
#include "scenes/camera.h"
#include "tests/folder.h"
#include "tests/render_scenes.h"
#include "tests/small_meshes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr double kPi = std::numbers::pi;

/// Looks at one point, so narrowly that all that it sees is that point.
Camera aimed(Vec3f from, Vec3f at) {
  const Vec3f up = from.x == at.x && from.z == at.z ? Vec3f{0, 0, 1} : Vec3f{0, 1, 0};
  return {.position = from, .look_at = at, .up = up, .vertical_fov = 0.01f};
}

/// Mean radiance along the middle of the view, of a quarter of the samples in each of four pixels: most bounds below
/// are three standard deviations and more.
Vec3f seen(const Scene& scene, unsigned samples, EffectSet effects, Integrator integrator = Integrator::path,
           unsigned depth = 64) {
  const Picture p =
      picture_of(scene, effects,
                 {.integrator = integrator,
                  .width = 2,
                  .height = 2,
                  .samples = (samples + 3) / 4,
                  .depth = integrator == Integrator::whitted ? std::min(depth, kMaxWhittedDepth) : depth});
  return {float(mean(p, 0)), float(mean(p, 1)), float(mean(p, 2))};
}
Vec3f seen(const Scene& scene, unsigned samples = 1, Integrator integrator = Integrator::path, unsigned depth = 64) {
  return seen(scene, samples, detected(scene), integrator, depth);
}

Scene convex(Material material) {
  Scene scene;
  scene.mesh = sphere(16, 32, true);
  scene.mesh.materials.assign(scene.mesh.size(), 0);
  scene.materials = {std::move(material)};
  scene.camera = aimed({3, 1, 2}, {0.2f, 0.1f, 0.1f});
  return scene;
}

/// Of a small horizontal patch to a parallel rectangle 2a x 2b right above it at height c (Howell's catalogue, B-3,
/// four quarters).
double form_factor(double a, double b, double c) {
  const double x = a / c, y = b / c, p = std::sqrt(1 + x * x), q = std::sqrt(1 + y * y);
  return 4.0 / (2.0 * kPi) * (x / p * std::atan(y / p) + y / q * std::atan(x / q));
}

void check_near(Vec3f value, Vec3f wanted, double relative) {
  for (std::size_t channel = 0; channel < 3; ++channel)
    CHECK(double(value[channel]) == Approx(double(wanted[channel])).epsilon(relative));
}

}  // namespace

TEST_CASE("furnace: a convex diffuse thing under a sky of radiance L gives back albedo times L, in every sample") {
  Scene scene = convex({.diffuse = {0.9f, 0.5f, 0.1f}});
  scene.environment = {2, 4, 8};
  for (const Integrator integrator : {Integrator::path, Integrator::whitted})
    check_near(seen(scene, 8, integrator), {1.8f, 2.0f, 0.8f}, 1e-6);
  check_near(seen(scene, 8, detected(scene).without(EffectKind::diffuse_gi)), {1.8f, 2.0f, 0.8f}, 1e-6);
  check_near(seen(scene, 8, detected(scene).without(EffectKind::env_light)), {0, 0, 0}, 1e-6);
}

TEST_CASE("ambient occlusion: open is white, closed in is black, and so is where nothing is") {
  Scene open = convex({});
  check_near(seen(open, 64, Integrator::ambient_occlusion), {1, 1, 1}, 1e-6);
  open.camera = aimed({3, 1, 2}, {30, 10, 2});
  CHECK(seen(open, 64, Integrator::ambient_occlusion) == Vec3f{0, 0, 0});
  // In a flat room the ceiling is nearer than a fifth of the diagonal, but for the most slanted rays: those of cosine c
  // go as far as 0.1 / c.
  Scene closed;
  add_box(closed, {-1, 0, -1}, {1, 0.1f, 1});
  closed.materials = {{}};
  closed.camera = aimed({0, 0.05f, 0}, {0.01f, 0, 0.01f});
  // a share least^2 of cosine-distributed rays is more slanted
  const double reach = 0.2 * std::sqrt(4 + 4 + 0.01), least = 0.1 / reach;
  check_near(seen(closed, 40000, Integrator::ambient_occlusion), Vec3f{1, 1, 1} * float(least * least), 0.1);
}

TEST_CASE("furnace: inside a closed room of albedo a that glows with e, radiance is e / (1 - a)") {
  Scene scene;
  add_box(scene, {-1, -2, -3}, {2, 1, 2});
  scene.materials = {{.diffuse = {0.5f, 0.8f, 0.0f}, .emission = {1, 1, 1}}};
  scene.camera = aimed({0.1f, -0.2f, 0.3f}, {0.5f, -2, 0.4f});
  check_near(seen(scene, 20000), {2, 5, 1}, 0.01);
  // Cut off after n scatterings: a geometric sum.
  check_near(seen(scene, 20000, Integrator::path, 2), {1.75f, 1 + 0.8f + 0.64f, 1}, 0.01);
  check_near(seen(scene, 20000, Integrator::path, 0), {1, 1, 1}, 1e-6);
  check_near(seen(scene, 20000, detected(scene).without(EffectKind::diffuse_gi)), {1.5f, 1.8f, 1}, 0.01);
}

namespace {

/// 8 x 4 pixels, every one another colour, one of them a hundred times as bright.
RadianceImage sky_image() {
  RadianceImage image{8, 4, {}};
  for (int i = 0; i < 32; ++i)
    image.pixels.push_back(Vec3f{0.1f * float(i % 5), 0.2f, 0.05f * float(i % 7)} * (i == 13 ? 100.0f : 1.0f));
  return image;
}

}  // namespace

TEST_CASE("an image around the scene: where its pixels are, and densities that add up") {
  const Environment sky(sky_image());
  const std::vector<Vec3f>& pixels = sky_image().pixels;
  const double slope = kPi / 8, turn = kPi / 8;
  const auto towards = [&](int column, int row) {  // a pixel's middle
    const double down = (2 * row + 1) * slope, around = (2 * column + 1 - 8) * turn;
    return Vec3d{std::sin(down) * std::sin(around), std::cos(down), -std::sin(down) * std::cos(around)};
  };
  for (int i = 0; i < 32; ++i) CHECK(length(sky.radiance(towards(i % 8, i / 8)) - pixels[std::size_t(i)]) < 1e-5f);
  CHECK(towards(4, 1).z < 0.0);  // the middle is towards -z, the next columns towards +x
  CHECK(towards(4, 1).x > 0.0);
  CHECK(towards(0, 0).y > 0.0);
  double sum = 0.0;
  Dice dice(3);
  for (int i = 0; i < 2000; ++i) {
    const Environment::Sample s = sky.sample(double(dice.uniform(0, 1)), double(dice.uniform(0, 1)));
    CHECK(length(s.direction) == Approx(1.0));
    CHECK(s.pdf == Approx(sky.pdf(s.direction)).epsilon(1e-6));
    CHECK(s.radiance == sky.radiance(s.direction));
  }
  constexpr int kSteps = 800;
  for (int i = 0; i < kSteps * kSteps; ++i) {
    const double y = 2 * (i % kSteps + 0.5) / kSteps - 1, around = 2 * kPi * (i / kSteps + 0.5) / kSteps,
                 r = std::sqrt(1 - y * y);
    sum += sky.pdf({r * std::sin(around), y, r * std::cos(around)}) * 4 * kPi / (kSteps * kSteps);
  }
  CHECK(sum == Approx(1.0).epsilon(0.005));
  CHECK(Environment(RadianceImage{2, 1, {{1, 2, 3}, {1, 2, 3}}}).is_constant());
  CHECK(Environment(RadianceImage{2, 1, {{0, 0, 0}, {0, 0, 0}}}).radiance({0, 1, 0}) == Vec3f{0, 0, 0});
}

TEST_CASE("a floor under an image: paths and shadow rays against the integral") {
  const RadianceImage image = sky_image();
  const Environment sky(image);
  std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";  // flat RGBE pixels
  for (const Vec3f& p : image.pixels) {
    int exponent = 0;
    const float scale = std::frexp(std::max({p.x, p.y, p.z}), &exponent) * 256.0f / std::max({p.x, p.y, p.z});
    for (const float c : {p.x, p.y, p.z}) bytes += char(std::uint8_t(c * scale));
    bytes += char(exponent + 128);
  }
  const Folder folder;
  const fs::path file = folder.write("sky.hdr", bytes);
  const Environment stored(read_radiance(file));
  for (const float roughness : {0.0f, 0.5f}) {
    Scene scene = floor_scene();
    scene.materials[0] = {.diffuse = {0.5f, 0.5f, 0.5f},
                          .specular = Vec3f{1, 1, 1} * (roughness > 0 ? 0.3f : 0.0f),
                          .roughness = roughness};
    scene.environment = mean_radiance(image), scene.environment_image = file.string();
    const Vec3d at{0.25, 0, -0.3}, viewer{1, 2, 1.5};
    scene.camera = aimed(to_float(viewer), to_float(at));
    const Surface surface = make_surface(scene.materials[0], EffectSet::all());
    const auto local = [](Vec3d v) { return Vec3d{v.x, -v.z, v.y}; };
    const Bsdf bsdf(surface, surface.diffuse, local(normalize(viewer - at)), true);
    Vec3d sum;
    constexpr int kSteps = 600;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const double y = (i % kSteps + 0.5) / kSteps, around = 2 * kPi * (i / kSteps + 0.5) / kSteps,
                   r = std::sqrt(1 - y * y);
      const Vec3d in{r * std::sin(around), y, r * std::cos(around)};
      const Bsdf::Value value = bsdf.evaluate(local(in));
      sum = sum + Vec3d((value.diffuse + value.glossy) * stored.radiance(in)) * (2 * kPi / (kSteps * kSteps));
    }
    INFO("roughness " << roughness);
    check_near(seen(scene, 100000), to_float(sum), 0.01);
    check_near(seen(scene, 100000, detected(scene).without(EffectKind::diffuse_gi)), to_float(sum), 0.01);
    check_near(seen(scene, 100000, Integrator::whitted), to_float(sum), 0.01);
  }
}

TEST_CASE("clamped paths bring no more than that from beyond the first hit") {
  Scene scene = convex({.diffuse = {1.0f, 0.5f, 0.25f}});
  scene.environment = {8, 8, 8};
  const auto clamped = [&](float most) {
    return picture_of(scene, detected(scene), {.width = 1, .height = 1, .samples = 2, .clamp = most}).pixels[0];
  };
  check_near(clamped(100), {8, 4, 2}, 1e-6);
  check_near(clamped(2), {2, 1, 0.5f}, 1e-6);
  scene.camera->look_at = {-3, 20, 2};  // the sky itself
  check_near(clamped(2), {8, 8, 8}, 1e-6);
}

TEST_CASE("furnace: mirrors and clear glass lose nothing but what Ks and Tf say") {
  Scene scene = convex({.diffuse = {0, 0, 0}, .specular = {0.8f, 0.5f, 0.2f}, .illum = 3});
  scene.environment = {1, 1, 1};
  for (const Integrator integrator : {Integrator::path, Integrator::whitted})
    check_near(seen(scene, 4, integrator), {0.8f, 0.5f, 0.2f}, 1e-6);
  scene.materials[0] = {.diffuse = {0.1f, 0.5f, 0.9f}, .specular = {0.8f, 0.5f, 0.2f}, .illum = 3};
  for (const Integrator integrator : {Integrator::path, Integrator::whitted})
    check_near(seen(scene, 20000, integrator), {0.9f, 1.0f, 1.0f}, 0.01);
  scene.materials[0] = {.diffuse = {0, 0, 0}, .ior = 1.5f, .opacity = 0, .illum = 7};
  check_near(seen(scene, 20000), {1, 1, 1}, 0.01);
  check_near(seen(scene, 1, Integrator::whitted), {1, 1, 1}, 0.01);  // branches that hold less than 2^-10 end
}

TEST_CASE("illum 5 is opaque: a mirror that reflects more at a slant, and a coat on what is diffuse") {
  Scene scene = floor_scene();
  scene.environment = {1, 1, 1};
  scene.materials[0] = {.diffuse = {0, 0, 0}, .specular = {0.1f, 0.5f, 1}, .illum = 5};
  for (const float height : {0.05f, 0.5f, 3.0f}) {
    scene.camera = aimed({1, height, 0.5f}, {0, 0, 0});
    const double cosine = double(height) / length(Vec3d(scene.camera->position));
    const auto fresnel = [&](double normal) { return normal + (1 - normal) * std::pow(1 - cosine, 5); };
    const Vec3f mirrored{float(fresnel(0.1f)), float(fresnel(0.5f)), 1};
    INFO("height " << height);
    scene.materials[0].diffuse = {0, 0, 0};
    for (const Integrator integrator : {Integrator::path, Integrator::whitted})
      check_near(seen(scene, 4, integrator), mirrored, 1e-3);
    // Light passes the coat at a cosine-distributed direction, where it lets 20 / 21 of 1 - Ks through, and then at the
    // viewer's.
    scene.materials[0].diffuse = {0.5f, 0.9f, 0.9f};
    const auto below = [&](double kd, double ks) { return float(kd * (1 - ks) * 20 / 21 * (1 - fresnel(ks))); };
    const Vec3f both = mirrored + Vec3f{below(0.5, 0.1), below(0.5, 0.5), 0};
    check_near(seen(scene, 20000), both, 0.01);
    check_near(seen(scene, 20000, Integrator::whitted), both, 0.01);
    CHECK(std::max({both.x, both.y, both.z}) <= 1.0f);
  }
}

TEST_CASE("point, directional and spot lights over a floor") {
  Scene scene = floor_scene();
  const Vec3f at{0.5f, 0, -0.25f};
  scene.camera = aimed({1, 2, 3}, at);
  scene.materials[0].diffuse = {0.5f, 0.25f, 1.0f};
  const Vec3d to_light = Vec3d{-1, 3, 1} - Vec3d(at);
  const double distance2 = dot(to_light, to_light), cosine = to_light.y / std::sqrt(distance2);
  const auto wanted = [](double irradiance) { return Vec3f{0.5f, 0.25f, 1.0f} * float(irradiance / kPi); };
  scene.lights = {{.position = {-1, 3, 1}, .intensity = {20, 20, 20}}};
  for (const Integrator integrator : {Integrator::path, Integrator::whitted})
    check_near(seen(scene, 4, integrator), wanted(20 * cosine / distance2), 1e-3);
  scene.lights[0].type = Light::Type::spot, scene.lights[0].direction = to_float(to_light * -1.0),
  scene.lights[0].cone_degrees = 1;
  check_near(seen(scene), wanted(20 * cosine / distance2), 1e-3);
  scene.lights[0].direction = {0, -1, 0};
  check_near(seen(scene), {0, 0, 0}, 1e-3);
  scene.lights = {{.type = Light::Type::directional, .direction = {1, -2, 0}, .intensity = {3, 3, 3}}};
  check_near(seen(scene), wanted(3 * 2 / std::sqrt(5.0)), 1e-3);
  scene.lights[0].direction = {1, 2, 0};  // from below
  check_near(seen(scene), {0, 0, 0}, 1e-3);
  // Two lights: each is chosen by its power, the sum is right.
  scene.lights = {{.position = {-1, 3, 1}, .intensity = {20, 20, 20}},
                  {.type = Light::Type::directional, .direction = {1, -2, 0}, .intensity = {3, 3, 3}}};
  const double both = 20 * cosine / distance2 + 3 * 2 / std::sqrt(5.0);
  check_near(seen(scene, 1, Integrator::whitted), wanted(both), 1e-3);
  check_near(seen(scene, 20000), wanted(both), 0.01);
  // A thing in between.
  add_box(scene, {-0.4f, 1.2f, 0.1f}, {0.1f, 1.6f, 0.6f});
  check_near(seen(scene, 1, Integrator::whitted), wanted(3 * 2 / std::sqrt(5.0)), 1e-3);
}

TEST_CASE("area light: the form factor of a rectangle above a floor") {
  Scene scene = floor_scene();
  scene.materials[0].diffuse = {0.6f, 0.6f, 0.6f};
  scene.materials.push_back({.diffuse = {0, 0, 0}, .emission = {7, 5, 3}});
  scene.camera = aimed({2, 1, 3}, {0.5f, 0, 0.25f});
  for (const double height : {0.5, 1.5, 4.0}) {
    Scene lit = scene;
    add_square(lit, {-0.5f, float(height), -0.5f}, {2, 0, 0}, {0, 0, 1.5f}, 1);
    const Vec3f wanted = Vec3f{7, 5, 3} * float(0.6 * form_factor(1.0, 0.75, height));
    INFO("height " << height);
    // Shadow rays and paths weighed together
    check_near(seen(lit, 160000, detected(lit)), wanted, 0.01);
    check_near(seen(lit, 160000, detected(lit).without(EffectKind::diffuse_gi)), wanted, 0.01);  // shadow rays alone
    check_near(seen(lit, 160000, Integrator::whitted), wanted, 0.01);
    // Without choosing, one of the two triangles alone lights: less, and not nothing.
    const Vec3f half = seen(lit, 20000, detected(lit).without(EffectKind::multi_light));
    CHECK(half.x > 0.2f * wanted.x);
    CHECK(half.x < 0.8f * wanted.x);
  }
}

TEST_CASE("a glossy floor under an area light: paths against the integral over the light") {
  for (const float roughness : {0.1f, 0.4f, 0.9f}) {
    Scene scene = floor_scene();
    scene.materials[0] = {
        .diffuse = {0.3f, 0.2f, 0.1f}, .specular = {0.2f, 0.3f, 0.5f}, .roughness = roughness, .illum = 2};
    scene.materials.push_back({.diffuse = {0, 0, 0}, .emission = {1, 1, 1}});
    add_square(scene, {-1, 2, -2}, {1.5f, 0, 0}, {0, 0, 1.5f}, 1);
    const Vec3d at{0.25, 0, -0.3}, viewer{1, 2, 1.5};
    scene.camera = aimed(to_float(viewer), to_float(at));
    const Surface surface = make_surface(scene.materials[0], EffectSet::all());
    const auto local = [](Vec3d v) { return Vec3d{v.x, -v.z, v.y}; };  // y up becomes z up
    const Bsdf bsdf(surface, surface.diffuse, local(normalize(viewer - at)), true);
    Vec3d sum;
    constexpr int kSteps = 400;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const Vec3d light{-1 + 1.5 * (i % kSteps + 0.5) / kSteps, 2, -2 + 1.5 * (i / kSteps + 0.5) / kSteps},
          way = light - at;
      const Bsdf::Value value = bsdf.evaluate(local(normalize(way)));
      const double solid_angle = 1.5 * 1.5 / (kSteps * kSteps) * way.y / std::pow(dot(way, way), 1.5);
      sum = sum + Vec3d(value.diffuse + value.glossy) * solid_angle;
    }
    INFO("roughness " << roughness);
    check_near(seen(scene, 100000, Integrator::path, 1), to_float(sum), 0.01);
    check_near(seen(scene, 100000, detected(scene).without(EffectKind::diffuse_gi)), to_float(sum), 0.01);
    // Else too few shadow rays hit the lobe
    if (roughness > 0.1f) check_near(seen(scene, 100000, Integrator::whitted), to_float(sum), 0.01);
  }
}

TEST_CASE("a mirror shows a lamp by Ks, a holed screen by its holes, and lets that much of a shadow go") {
  Scene scene = floor_scene();
  scene.materials[0] = {.diffuse = {0, 0, 0}, .specular = {0.5f, 0.25f, 1}, .illum = 3};
  scene.materials.push_back({.diffuse = {0, 0, 0}, .emission = {4, 4, 4}});
  add_square(scene, {-3, 0.5f, -3}, {6, 0, 0}, {0, 2, 0}, 1);
  scene.camera = aimed({0, 1, 1}, {0, 0, -1});
  for (const Integrator integrator : {Integrator::path, Integrator::whitted})
    check_near(seen(scene, 2, integrator), {2, 1, 4}, 1e-6);

  scene.materials.push_back({.diffuse = {0, 0, 0}, .opacity = 0.3f});
  add_square(scene, {-1, 0.1f, 0}, {2, 0, 0}, {0, 2, 0}, 2);  // crossed once, before the mirror
  check_near(seen(scene, 20000), Vec3f{2, 1, 4} * 0.7f, 0.02);
  add_square(scene, {-3, 0.1f, -2.8f}, {6, 0, 0}, {0, 3, 0}, 2);  // and once behind it
  check_near(seen(scene, 20000), Vec3f{2, 1, 4} * 0.49f, 0.02);

  Scene shadow = floor_scene();
  shadow.lights = {{.position = {0, 3, 0}, .intensity = {9, 9, 9}}};
  shadow.camera = aimed({1, 2, 3}, {0, 0, 0});
  const float open = seen(shadow).x;
  shadow.materials.push_back({.diffuse = {0, 0, 0}, .opacity = 0.3f});
  for (int layers = 1; layers <= 3; ++layers) {
    add_square(shadow, {-0.3f, 1 + 0.5f * float(layers), 0.3f}, {0.6f, 0, 0}, {0, 0, -0.6f}, 1);
    CHECK(double(seen(shadow, 20000).x) == Approx(double(open) * std::pow(0.7, layers)).epsilon(0.03));
  }
}

TEST_CASE(
    "through a slab of glass a ray goes on in its direction, moved aside by Snell's law, less what is reflected") {
  Scene scene;
  add_box(scene, {-50, -50, -1}, {50, 50, 0}, 0);  // a pane one thick
  scene.materials = {{.diffuse = {0, 0, 0},
                      .specular = {1, 1, 1},
                      .transmission = {0.5f, 1, 1},
                      .ior = 1.6f,
                      .opacity = 0,
                      .illum = 7},
                     {.diffuse = {0, 0, 0}, .emission = {1, 1, 1}}};
  const double sine = 0.8, cosine = 0.6, inside = 0.8 / 1.6, inside_cosine = std::sqrt(1 - inside * inside);
  scene.camera = aimed({float(-4 * sine / cosine), 0, 4}, {0, 0, 0});             // enters at the origin
  const double exit = inside / inside_cosine, behind = exit + 2 * sine / cosine;  // at z = -1 and -3
  const double s = (cosine - 1.6 * inside_cosine) / (cosine + 1.6 * inside_cosine),
               p = (1.6 * cosine - inside_cosine) / (1.6 * cosine + inside_cosine);
  const double through = std::pow(1 - 0.5 * (s * s + p * p), 2);
  for (const double aside : {0.0, 0.3}) {  // what bounced within comes out farther on
    Scene lit = scene;
    add_square(lit, {float(behind + aside - 0.1), -0.1f, -3}, {0.2f, 0, 0}, {0, 0.2f, 0}, 1);
    const Vec3f wanted = aside == 0.0 ? Vec3f{0.25f, 1, 1} * float(through) : Vec3f{0, 0, 0};
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
      INFO(to_string(integrator) << ", " << aside);
      check_near(seen(lit, integrator == Integrator::path ? 40000 : 4, integrator), wanted,
                 integrator == Integrator::path ? 0.01 : 1e-4);
    }
  }
}

TEST_CASE("no light leaks into a closed room, near the origin and 100 from it, nor out of a closed lamp") {
  for (const float far : {0.0f, 100.0f, 10000.0f}) {
    INFO("at " << far);
    const auto at = [&](Vec3f p) { return p + Vec3f{far, -0.7f * far, 0.4f * far}; };
    Scene room;
    add_box(room, at({-1, -2, -3}), at({2, 1, 2}));
    add_box(room, at({0.3f, -2, -1}), at({0.9f, -0.8f, 0.1f}));  // stands on the floor: its faces meet that
    room.materials = {{.diffuse = {0.9f, 0.9f, 0.9f}, .specular = {0.05f, 0.05f, 0.05f}, .roughness = 0.3f}};
    room.environment = {1, 1, 1};
    room.lights = {{.position = at({5, 5, 5}), .intensity = {1e4f, 1e4f, 1e4f}},
                   {.type = Light::Type::directional, .direction = {1, -2, -3}, .intensity = {9, 9, 9}}};
    room.camera = Camera{.position = at({-0.7f, 0.3f, 1.6f}), .look_at = at({0.5f, -1, -1}), .vertical_fov = 80};
    const Picture picture = picture_of(room, detected(room), {.width = 48, .height = 48, .samples = 8});
    // At 10^4 float32 is so coarse (2^-10) that the step off a wall may pass the next one at an edge (docs/numerics.md:
    // leaks).
    CHECK(std::ranges::count_if(picture.pixels, [](Vec3f p) { return is_bright(p); }) <= (far < 1e3f ? 0 : 20));

    Scene lamp;  // within a black box within a box
    add_box(lamp, at({-1, -1, -1}), at({1, 1, 1}), 1), add_box(lamp, at({-2, -2, -2}), at({2, 2, 2})),
        add_box(lamp, at({-9, -9, -9}), at({9, 9, 9}));
    lamp.materials = {{.diffuse = {0.9f, 0.9f, 0.9f}}, {.diffuse = {0, 0, 0}, .emission = {5, 5, 5}}};
    lamp.camera = Camera{.position = at({-7, 3, 6}), .look_at = at({0, 0, 0}), .vertical_fov = 80};
    const Picture dark = picture_of(lamp, detected(lamp), {.width = 48, .height = 48, .samples = 8});
    CHECK(std::ranges::count_if(dark.pixels, [](Vec3f p) { return is_bright(p); }) == 0);
  }
}

TEST_CASE("a thing that passes by while the shutter is open is seen for as long as it is there") {
  Scene scene;
  add_square(scene, {-2, -1, 0}, {2, 0, 0}, {0, 2, 0});
  scene.mesh.later_frames = {scene.mesh.vertices};
  // Its right edge runs from 0 to 4, its left one from -2 to 2
  for (Vec3f& v : scene.mesh.later_frames[0]) v.x += 4.0f;
  scene.key_frames = 2, scene.shutter = {0, 1};
  scene.materials = {{.diffuse = {0, 0, 0}, .emission = {1, 1, 1}}};
  scene.camera = aimed({1, 0, 5}, {1, 0, 0});  // there from time 1/4 to 3/4
  check_near(seen(scene, 20000), {0.5f, 0.5f, 0.5f}, 0.02);
  scene.shutter = {0.5f, 1};
  check_near(seen(scene, 20000), {0.5f, 0.5f, 0.5f}, 0.02);
  scene.shutter = {0.25f, 0.5f};
  check_near(seen(scene, 2000), {1, 1, 1}, 0.01);
}

TEST_CASE("lens: all rays of a picture position meet at the focus distance, and only there") {
  const Camera camera{
      .position = {1, 2, 3}, .look_at = {0, 0, -1}, .vertical_fov = 50, .aperture_radius = 0.25f, .focus_distance = 4};
  const RayGenerator generator(camera, 64, 48);
  const Vec3d forward = normalize(Vec3d(camera.look_at) - Vec3d(camera.position));
  const auto at_depth = [&](const Ray& ray, double depth) {
    const Vec3d o(ray.origin), d(ray.direction);
    return o + d * ((depth - dot(o - Vec3d(camera.position), forward)) / dot(d, forward));
  };
  const Ray pinhole = generator.ray(10.5, 40.25);
  for (const auto& [x, y] : {std::pair{1.0, 0.0}, {0.0, 1.0}, {-0.6, 0.3}}) {
    const Ray ray = generator.ray(10.5, 40.25, x, y);
    CHECK(length(Vec3d(ray.origin) - Vec3d(camera.position)) == Approx(0.25 * std::hypot(x, y)).epsilon(1e-5));
    CHECK(std::abs(dot(Vec3d(ray.origin) - Vec3d(camera.position), forward)) < 1e-6);
    CHECK(length(at_depth(ray, 4) - at_depth(pinhole, 4)) < 1e-5);
    CHECK(length(at_depth(ray, 8) - at_depth(pinhole, 8)) == Approx(0.25 * std::hypot(x, y)).epsilon(1e-4));
  }
  const Ray middle = generator.ray(10.5, 40.25, 0, 0);
  CHECK(middle.direction == pinhole.direction);
  CHECK(middle.origin == pinhole.origin);
}
