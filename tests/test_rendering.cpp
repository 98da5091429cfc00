// The parts of rendering: effect sets, random numbers, textures, surfaces and their lobes, lights, pictures in files.
#include <sys/resource.h>

#include <csignal>
#include <numbers>
#include <numeric>
#include <set>

#include "rendering/bsdf.h"
#include "rendering/directions.h"
#include "rendering/heat_map.h"
#include "rendering/lights.h"
#include "rendering/picture.h"
#include "rendering/sampler.h"
#include "rendering/texture.h"
#include "rendering/transfer.h"
#include "scenes/camera.h"
#include "tests/render_scenes.h"
#include "tests/scene_files.h"
#include "tests/small_meshes.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("effect sets: auto, all, names, and the nearest name") {
  const EffectSet found = EffectSet{}.with(EffectKind::mirror);
  CHECK(parse_effects("auto", found) == found);
  CHECK(parse_effects("all", found) == EffectSet::all());
  CHECK(parse_effects("dof,shadow_soft", found) == EffectSet{}.with(EffectKind::dof).with(EffectKind::shadow_soft));
  for (std::size_t i = 0; i < kEffectNames.size(); ++i) {
    CHECK(EffectSet::all().has(EffectKind(i)));
    CHECK(parse_effects(std::string(kEffectNames[i]), {}) == EffectSet{}.with(EffectKind(i)));
  }
  CHECK(error_of([] { static_cast<void>(parse_effects("glosy", {})); }).find("did you mean 'glossy'") !=
        std::string::npos);
  CHECK(parse_effects(" dof,\tmirror ", {}) == EffectSet{}.with(EffectKind::dof).with(EffectKind::mirror));
  CHECK(parse_effects(" all", {}) == EffectSet::all());
  for (const char* const words : {"", " ", "dof,", ",dof", "dof, ,mirror"})
    CHECK(error_of([&] { static_cast<void>(parse_effects(words, {})); }).find("an empty name") != std::string::npos);
  CHECK(error_of([] { static_cast<void>(parse_effects("all,mirror", {})); }).find("'all' stands alone") !=
        std::string::npos);
  CHECK(error_of([] { static_cast<void>(parse_effects("mirror,auto", {})); }).find("'auto' stands alone") !=
        std::string::npos);
  CHECK(error_of([] { static_cast<void>(parse_integrator("pth")); }).find("did you mean 'path'") != std::string::npos);
}

TEST_CASE("random numbers: uniform, and other ones for every pixel, sample, hit and dimension") {
  std::set<double> numbers;
  double sum = 0.0;
  for (std::uint32_t pixel = 0; pixel < 20; ++pixel) {
    for (std::uint32_t sample = 0; sample < 20; ++sample) {
      const Sampler sampler(1, pixel, sample);
      for (std::uint64_t d = 0; d < 5; ++d) numbers.insert(sampler.camera(CameraDimension(d)));
      for (std::uint64_t node = 0; node < 4; ++node) {
        for (std::uint64_t d = 0; d < 10; ++d) numbers.insert(sampler.hit(node, HitDimension(d)));
        for (std::uint64_t d = 0; d < 3; ++d)
          numbers.insert(sampler.pass(node, PassDimension(d), 0)),
              numbers.insert(sampler.pass(node, PassDimension(d), 1));
      }
    }
  }
  CHECK(numbers.size() == 400 * (5 + 4 * (10 + 6)));
  for (const double x : numbers) sum += x;
  CHECK(*numbers.begin() >= 0.0);
  CHECK(*numbers.rbegin() < 1.0);
  CHECK(sum / double(numbers.size()) == Approx(0.5).epsilon(0.01));
}

TEST_CASE("textures: centres of pixels, bilinear between them, repeated, v upwards, sRGB") {
  // Red, green / blue, grey 128; the last has alpha 64.
  const Texture map(Image{2, 2, 4, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 128, 128, 128, 64}});
  CHECK_FALSE(map.is_constant());
  CHECK(map.color({0.25f, 0.75f}) == Vec3f{1, 0, 0});
  CHECK(map.color({0.75f, 0.75f}) == Vec3f{0, 1, 0});
  CHECK(map.color({0.25f, 0.25f}) == Vec3f{0, 0, 1});
  CHECK(map.color({0.75f, 0.25f}).x == Approx(0.2158605f));
  CHECK(map.color({3.25f, -1.25f}) == Vec3f{1, 0, 0});
  const Vec3f between = map.color({0.5f, 0.75f});
  CHECK(between.x == Approx(0.5f));
  CHECK(between.y == Approx(0.5f));
  CHECK(map.color({0.0f, 0.75f}).y == Approx(0.5f));  // around the edge
  CHECK(map.opacity({0.75f, 0.25f}) == Approx(64.0f / 255.0f));
  CHECK(map.opacity({0.25f, 0.75f}) == 1.0f);
  CHECK(map.mean_opacity() == Approx((3.0f + 64.0f / 255.0f) / 4.0f));
  CHECK(is_finite(map.color({std::nanf(""), std::numeric_limits<float>::infinity()})));
  const Texture grey(Image{2, 1, 1, {51, 51}});
  CHECK(grey.is_constant());
  CHECK(grey.opacity({0.3f, 0.4f}) == Approx(0.2f));
  CHECK(grey.mean_color() == grey.color({0.1f, 0.9f}));
}

TEST_CASE("texture coordinates come from files, for triangles and polygons, and stay with their triangles") {
  const Folder folder;
  const std::string obj =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1 2 5\nf 5 5 5\nf 1/1 2/2 3/3 "
      "4/4\nf 1/-1 3/-2 2/-3\nf 4 2 5\n";
  const Scene scene = load_file(folder.write("square.obj", obj));
  REQUIRE(scene.mesh.size() == 5);
  REQUIRE(scene.texture_coordinates.size() == 5);
  CHECK(scene.texture_coordinates[0] == TextureTriangle{});
  for (const std::size_t i : {1u, 2u}) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f corner = scene.mesh.corners(i)[k];
      CHECK(scene.texture_coordinates[i][k] == std::array<float, 2>{corner.x, corner.y});
    }
  }
  CHECK(scene.texture_coordinates[3] == TextureTriangle{{{0, 1}, {1, 1}, {1, 0}}});
  CHECK(scene.texture_coordinates[4] == TextureTriangle{});
  CHECK(error_of([&] {
          load_file(folder.write("bad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1/1 2/2 3/1\n"));
        }).find("bad.obj:5: texture index 2") != std::string::npos);
  CHECK(load_file(folder.write("plain.obj", obj_text())).texture_coordinates.empty());

  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float u\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float v\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0.5 0 0 0 1\n0.25 1 0 0 2\n0.125 0 1 0 3\n3 "
      "2 0 1\n";
  const Scene points = load_file(folder.write("a.ply", ply));
  REQUIRE(points.texture_coordinates.size() == 1);
  CHECK(points.texture_coordinates[0] == TextureTriangle{{{0.125f, 3}, {0.5f, 1}, {0.25f, 2}}});

  folder.write("plain.obj", obj_text());
  const Scene both = load_file(folder.write(
      "both.yaml",
      "meshes: [plain.obj, a.ply, square.obj]\ninstances: [{mesh: a, transforms: [{scale: 2}, {scale: 3}]}]\n"));
  REQUIRE(both.texture_coordinates.size() == both.mesh.size());
  CHECK(both.texture_coordinates[0] == points.texture_coordinates[0]);
  CHECK(both.texture_coordinates[1] == points.texture_coordinates[0]);
  CHECK(both.texture_coordinates[2] == TextureTriangle{});
  CHECK(both.texture_coordinates[2 + 4 + 1] == scene.texture_coordinates[1]);
}

namespace {

Scene lone_box() {
  Scene scene;
  add_box(scene, {-1, -1, -1}, {1, 1, 1});
  scene.materials.emplace_back();
  scene.camera = Camera{.position = {3, 2, 5}, .look_at = {0, 0, 0}, .vertical_fov = 50};
  return scene;
}

const Material kPlastic{.diffuse = {0.3f, 0.6f, 0.9f}, .specular = {0.04f, 0.04f, 0.04f}, .roughness = 0.5f};
const Material kSatin{.diffuse = {0.5f, 0.5f, 0.5f}, .specular = {0.4f, 0.6f, 0.5f}, .roughness = 0.7f};
const Material kMetal{.diffuse = {0, 0, 0}, .specular = {1, 1, 1}, .roughness = 0.4f, .illum = 3};
const Material kMatt{.diffuse = {0.3f, 0.6f, 0.9f}};
const Material kHalfMirror{.diffuse = {0.3f, 0.3f, 0.3f}, .specular = {0.5f, 0.5f, 0.5f}, .illum = 3};

Vec3d towards(double sine) { return {sine * 0.6, -sine * 0.8, std::sqrt(1.0 - sine * sine)}; }

/// Over the hemisphere, by the midpoint rule in cosine-weighted coordinates.
template <class Function>
auto integral(const Function& f) {
  constexpr int kSteps = 500;
  decltype(f(Vec3d{}) * 1.0) sum{};
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double z = (i + 0.5) / kSteps, r = std::sqrt(1.0 - z * z);
      const UnitCircle circle((j + 0.5) / kSteps);
      sum = sum + f({r * circle.cosine, r * circle.sine, z}) * (2.0 * std::numbers::pi / (kSteps * kSteps));
    }
  }
  return sum;
}

}  // namespace

TEST_CASE("lobes: densities add up to at most 1, directions follow them, weights to the same sum, no light is made") {
  for (const Material& m : {kPlastic, kSatin, kMetal, kMatt}) {
    const Surface surface = make_surface(m, EffectSet::all());
    for (const double sine : {0.0, 0.5, 0.9, 0.99}) {
      for (const Lobes lobes : {Lobes{}, Lobes{false, true, true}, Lobes{true, false, true}}) {
        const Bsdf bsdf(surface, surface.diffuse, towards(sine), true);
        const double density = integral([&](Vec3d in) { return bsdf.pdf(in, lobes); });
        CHECK(density <= 1.003);
        const Vec3d whole = integral([&](Vec3d in) {
          const Bsdf::Value value = bsdf.evaluate(in);
          return Vec3d((lobes.diffuse ? value.diffuse : Vec3f{}) + (lobes.glossy ? value.glossy : Vec3f{}));
        });
        CHECK(std::max({whole.x, whole.y, whole.z}) <= 1.0005);
        // By chance: the same albedo, and the same mean direction as by integration.
        Vec3d sum, mean;
        constexpr int kCount = 100000;
        Dice dice(7);
        for (int i = 0; i < kCount; ++i) {
          const auto scatter =
              bsdf.scatter(lobes, double(dice.uniform(0, 1)), double(dice.uniform(0, 1)), double(dice.uniform(0, 1)));
          if (!scatter) continue;
          CHECK(scatter->pdf == Approx(bsdf.pdf(scatter->direction, lobes)).epsilon(1e-6));
          CHECK(length(scatter->direction) == Approx(1.0));
          sum = sum + Vec3d(scatter->weight) * (1.0 / kCount), mean = mean + scatter->direction * (1.0 / kCount);
        }
        for (const auto& [drawn, wanted] : {std::pair{sum.x, whole.x}, {sum.y, whole.y}, {sum.z, whole.z}})
          CHECK(drawn == Approx(wanted).margin(0.006));
        const Vec3d direction = integral([&](Vec3d in) { return in * bsdf.pdf(in, lobes); });
        CHECK(length(mean - direction) < 0.01);
      }
    }
  }
}

TEST_CASE("circles by turns") {
  for (int i = 0; i < 1000; ++i) {
    const UnitCircle turn(i / 1000.0);
    CHECK(turn.cosine == Approx(std::cos(2 * std::numbers::pi * i / 1000)).margin(1e-14));
    CHECK(turn.sine == Approx(std::sin(2 * std::numbers::pi * i / 1000)).margin(1e-14));
  }
  CHECK(UnitCircle(0.0).cosine == 1.0);
  CHECK(UnitCircle(0.0).sine == 0.0);
}

TEST_CASE("lobes: light goes both ways alike (reciprocity)") {
  for (const Material& m : {kPlastic, kSatin, kMetal, kMatt}) {
    const Surface surface = make_surface(m, EffectSet::all());
    const Vec3d a = towards(0.3), b = normalize(Vec3d{-0.2, 0.7, 0.4});
    const auto value = [&](Vec3d out, Vec3d in) {
      const Bsdf::Value v = Bsdf(surface, surface.diffuse, out, true).evaluate(in);
      return (v.diffuse + v.glossy) * float(1.0 / in.z);
    };
    const Vec3f there = value(a, b), back = value(b, a);
    for (std::size_t channel = 0; channel < 3; ++channel) CHECK(there[channel] == Approx(back[channel]).epsilon(1e-5));
  }
}

TEST_CASE("a half mirror: the two lobes share by what they give back") {
  const Surface surface = make_surface(kHalfMirror, EffectSet::all());
  const Bsdf bsdf(surface, surface.diffuse, towards(0.5), true);
  const auto matt = bsdf.scatter({}, 0.374, 0.3, 0.3), mirrored = bsdf.scatter({}, 0.376, 0.3, 0.3);
  REQUIRE((matt && mirrored));
  CHECK(matt->kind == ScatterKind::diffuse);
  CHECK(matt->weight.x == Approx(0.8f));
  CHECK(mirrored->kind == ScatterKind::mirror);
  CHECK(mirrored->pdf == 0.0);
  CHECK(mirrored->weight.x == Approx(0.8f));
  CHECK(mirrored->direction.z == Approx(towards(0.5).z));
  CHECK(mirrored->direction.x == Approx(-towards(0.5).x));
}

TEST_CASE("glass: Fresnel's share, Snell's law, total reflection") {
  Material glass{.diffuse = {0, 0, 0}, .specular = {1, 1, 1}, .transmission = {0.5f, 1, 1}, .ior = 1.5f, .illum = 7};
  const Surface surface = make_surface(glass, EffectSet::all());
  const auto branches = [&](double sine, bool front) {
    return Bsdf(surface, surface.diffuse, towards(sine), front).branches();
  };
  CHECK(branches(0, true).directions[0].weight.x == Approx(0.04f));
  CHECK(branches(0, false).directions[0].weight.x == Approx(0.04f));
  CHECK(branches(0, true).directions[1].weight.x == Approx(0.48f));
  const Bsdf::Branches bent = branches(0.6, true);
  REQUIRE(bent.count == 2);
  CHECK(bent.directions[1].direction.z == Approx(-std::sqrt(1 - 0.16)));
  CHECK(std::hypot(bent.directions[1].direction.x, bent.directions[1].direction.y) == Approx(0.4));
  const double s = (0.8 - 1.5 * std::sqrt(0.84)) / (0.8 + 1.5 * std::sqrt(0.84)),
               p = (1.5 * 0.8 - std::sqrt(0.84)) / (1.5 * 0.8 + std::sqrt(0.84));
  CHECK(bent.directions[0].weight.x == Approx(0.5 * (s * s + p * p)));
  CHECK(branches(0.66, false).count == 2);
  CHECK(branches(0.67, false).count == 1);
  CHECK(branches(0.67, false).directions[0].weight.x == 1.0f);
  const Bsdf bsdf(surface, surface.diffuse, towards(0.6), true);
  CHECK(bsdf.scatter({}, 0.0, 0.5, 0.5)->direction.z > 0.0);
  CHECK(bsdf.scatter({}, 0.9, 0.5, 0.5)->direction.z < 0.0);
  CHECK_FALSE(bsdf.scatter({true, true, false}, 0.9, 0.5, 0.5));
  glass.ior = 1.0f;  // a filter
  const Surface filter = make_surface(glass, EffectSet::all());
  const Bsdf::Branches straight = Bsdf(filter, {}, towards(0.9), true).branches();
  REQUIRE(straight.count > 0);
  CHECK(straight.directions[straight.count - 1].direction.z == Approx(-towards(0.9).z));
  CHECK(straight.directions[straight.count - 1].weight.x == Approx(0.5f));
}

TEST_CASE("lights are chosen by power, and their densities add up") {
  Scene scene = floor_scene();
  scene.materials.push_back({.emission = {2, 2, 2}});
  add_square(scene, {-1, 2, -1}, {2, 0, 0}, {0, 0, 1}, 1);
  scene.lights = {{.position = {0, 3, 0}, .intensity = {1, 1, 1}},
                  {.position = {0, 3, 0}, .intensity = {0, 0, 0}},
                  {.position = {3, 3, 0}, .intensity = {3, 3, 3}}};
  std::vector<Surface> surfaces;
  for (const Material& m : scene.materials) surfaces.push_back(make_surface(m, EffectSet::all()));
  const LightTable table(scene.mesh, surfaces, scene.lights, EffectSet::all());
  CHECK(table.size() == 4);
  CHECK(table.delta_lights() == 2);
  CHECK(table.emission(0) == Vec3f{0, 0, 0});
  CHECK(table.emission(2) == Vec3f{2, 2, 2});
  // Powers: 4 pi, 12 pi, and each triangle 2 pi x 1 x 2.
  const Vec3d from{0.2, 0, 0.1};
  const auto chosen = [&](double choice) { return *table.sample(from, 0, choice, 0.5, 0.5); };
  CHECK_FALSE(chosen(0.16).on);
  CHECK(chosen(0.16).radiance.x == Approx(6.0 / (9.0 + 0.05)));
  CHECK(chosen(0.17).distance > 4.0);
  CHECK(chosen(0.66).distance > 4.0);
  CHECK(chosen(0.67).on->primitive == 2);
  CHECK(chosen(0.999999).on->primitive == 3);
  const LightSample area = chosen(0.7);
  CHECK(area.pdf == Approx(table.pdf(2, from, from + area.direction * area.distance, 0)));
  // The density of a direction, integrated over the light, is the probability of the choice.
  double sum = 0.0;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps * kSteps; ++i) {
    const Vec3d point{-1 + 2 * (i % kSteps + 0.5) / kSteps, 2, -1 + (i / kSteps + 0.5) / kSteps}, way = point - from;
    const std::uint32_t triangle = (point.x + 1) / 2 > point.z + 1 ? 2 : 3;
    sum += table.pdf(triangle, from, point, 0) * 2.0 / (kSteps * kSteps) * way.y / std::pow(dot(way, way), 1.5);
  }
  CHECK(sum == Approx(1.0 / 3.0).epsilon(1e-3));
  // A delta light that holds all power but 2^-80 of it leaves the areas' shares as they are.
  scene.lights[0].intensity = Vec3f{1, 1, 1} * 1e24f;
  const LightTable dim(scene.mesh, surfaces, scene.lights, EffectSet::all());
  for (const double choice : {0.0, 0.49, 0.51, 0.999999}) {
    const LightSample among = *dim.sample_area(from, 0, choice, 0.5, 0.5),
                      before = *table.sample_area(from, 0, choice, 0.5, 0.5);
    CHECK(among.on->primitive == (choice < 0.5 ? 2u : 3u));
    CHECK(among.radiance == before.radiance);
    // a third of the power is theirs
    CHECK(before.radiance.x == Approx(chosen(choice < 0.5 ? 0.7 : 0.9).radiance.x / 3));
  }
  scene.lights[0].intensity = {1, 1, 1};
  const LightTable strongest(scene.mesh, surfaces, scene.lights, EffectSet::all().without(EffectKind::multi_light));
  CHECK(strongest.size() == 1);
  CHECK(strongest.emission(2) == Vec3f{0, 0, 0});
  CHECK(strongest.sample(from, 0, 0.0, 0.5, 0.5)->distance > 4.0);
}

TEST_CASE("an emitter counts by the largest area that it has while it moves") {
  Scene scene;
  scene.materials = {{.emission = {1, 1, 1}}};
  const std::vector<Surface> surfaces{make_surface(scene.materials[0], EffectSet::all())};
  const auto table_of = [&](std::vector<std::vector<Vec3f>> frames) {
    scene.mesh.vertices = frames[0], scene.mesh.later_frames.assign(frames.begin() + 1, frames.end());
    scene.mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
    return LightTable(scene.mesh, surfaces, {}, EffectSet::all());
  };
  const auto both = [](Vec3f a, Vec3f b, Vec3f c) {
    return std::vector<Vec3f>{a, b, c, {0, 0, 9}, {1, 0, 9}, {0, 1, 9}};
  };
  const std::vector<Vec3f> nothing = both({0, 0, 0}, {0, 0, 0}, {0, 0, 0}),
                           large = both({0, 0, 0}, {3, 0, 0}, {0, 1, 0});
  CHECK(table_of({nothing, nothing}).size() == 1);
  for (const auto& frames :
       {std::vector{nothing, large}, std::vector{large, nothing}, std::vector{nothing, large, nothing}}) {
    const LightTable table = table_of(frames);
    REQUIRE(table.size() == 2);
    CHECK(table.emission(0) == Vec3f{1, 1, 1});
    const float time = frames.size() == 3 ? 0.5f : frames[0] == large ? 0.0f : 1.0f;  // 3/4 of the power
    CHECK(table.sample({0, 0, 5}, time, 0.74, 0.5, 0.5)->on->primitive == 0);
    CHECK(table.sample({0, 0, 5}, time, 0.76, 0.5, 0.5)->on->primitive == 1);
  }
  // Without area in both key frames, but not between them.
  CHECK(table_of({both({0, 0, 0}, {1, 0, 0}, {0, 0, 0}), both({0, 0, 0}, {0, 0, 0}, {0, 1, 0})}).size() == 2);
}

TEST_CASE("a material that is not there is an error") {
  Scene scene = floor_scene();
  scene.mesh.materials[1] = 1;
  CHECK(error_of([&] {
          static_cast<void>(RenderScene(scene, EffectSet::all()));
        }).find("triangle 1 is of material 1") != std::string::npos);
  scene.mesh.materials.resize(1);
  CHECK(error_of([&] { static_cast<void>(RenderScene(scene, EffectSet::all())); }).find("2 triangles have 1") !=
        std::string::npos);
}

namespace {

/// As if the disk were full beyond so many bytes a file.
class LimitedFiles {
 public:
  explicit LimitedFiles(rlim_t bytes) : before_(std::signal(SIGXFSZ, SIG_IGN)) {
    REQUIRE(::getrlimit(RLIMIT_FSIZE, &limit_) == 0);
    const rlimit less{bytes, limit_.rlim_max};
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &less) == 0);
  }
  ~LimitedFiles() { ::setrlimit(RLIMIT_FSIZE, &limit_), std::signal(SIGXFSZ, before_); }
  LimitedFiles(const LimitedFiles&) = delete;
  LimitedFiles& operator=(const LimitedFiles&) = delete;

 private:
  void (*before_)(int);
  rlimit limit_{};
};

}  // namespace

TEST_CASE("pictures: developed by exposure and sRGB, and the same again from their file") {
  const Folder folder;
  Picture picture{
      3, 2, {{0, 0.5f, 1}, {2, -1, 0.0031308f}, {0.25f, 0.1f, 0.001f}, {1, 1, 1}, {0, 0, 0}, {0.2158605f, 0, 0}}};
  const std::vector<std::uint8_t> plain = develop(picture, 0);
  CHECK(std::vector<std::uint8_t>(plain.begin(), plain.begin() + 6) ==
        std::vector<std::uint8_t>{0, 188, 255, 255, 0, 10});
  CHECK(plain[15] == 128);
  CHECK(develop(picture, 1)[1] == 255);
  CHECK(develop(picture, -1)[2] == 188);
  for (int i = 0; i < 256; ++i) CHECK(int(linear_to_srgb(srgb_to_linear(float(i) / 255)) * 255 + 0.5f) == i);
  const fs::path png = folder.path() / "a.png", pfm = folder.path() / "a.pfm";
  write_picture(png, picture, 0);
  const std::optional<Image> read = read_image(png);
  REQUIRE(read);
  CHECK(read->width == 3);
  CHECK(read->height == 2);
  CHECK(read->pixels == plain);
  write_picture(pfm, picture, 5);
  std::ifstream file(pfm, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const std::string header = "PF\n3 2\n-1.0\n";
  REQUIRE(bytes.size() == header.size() + 72);
  CHECK(bytes.substr(0, header.size()) == header);
  CHECK(std::memcmp(bytes.data() + header.size() + 36, picture.pixels.data(), 36) == 0);  // the first row comes last
  {
    // What cannot be written leaves the picture that was there.
    const auto bytes_of = [](const fs::path& path) {
      std::ifstream stream(path, std::ios::binary);
      return std::string{std::istreambuf_iterator<char>(stream), {}};
    };
    const std::string before = bytes_of(pfm);
    std::string refusal;
    {
      const LimitedFiles limited(16);
      refusal = error_of([&] { write_picture(pfm, picture, 5); });
    }
    CHECK(refusal.find("cannot be written") != std::string::npos);
    CHECK(bytes_of(pfm) == before);
  }
  CHECK(error_of([&] { write_picture(folder.path() / "a.jpg", picture, 0); }).find(".png") != std::string::npos);
  CHECK(error_of([&] { write_picture(folder.path() / "no" / "a.png", picture, 0); }).find("no such folder") !=
        std::string::npos);
}

TEST_CASE("heat colours: lightness rises evenly") {
  const auto lightness = [](std::array<std::uint8_t, 3> c) {
    const double y = luminance(
        {srgb_to_linear(float(c[0]) / 255), srgb_to_linear(float(c[1]) / 255), srgb_to_linear(float(c[2]) / 255)});
    return y > 0.008856 ? 116.0 * std::cbrt(y) - 16.0 : 903.3 * y;
  };
  CHECK(lightness(heat_color(0)) < 8.0);
  CHECK(lightness(heat_color(1)) > 94.0);
  CHECK(heat_color(-1) == heat_color(0));
  CHECK(heat_color(2) == heat_color(1));
  for (int i = 0; i <= 32; ++i) CHECK(lightness(heat_color(i / 32.0)) == Approx(6.0 + 90.0 * i / 32.0).margin(0.5));
}

TEST_CASE("of a renderer's rays the camera's alone are marked coherent, as those of the workloads") {
  static std::vector<bool> marked;
  marked.clear();
  KernelRow row;
  row.timed.closest_hit = [](const Accel&, const KernelRow&, RayBatch rays, std::span<Hit>, Counters*) {
    marked.push_back(rays.coherent);
  };
  row.timed.any_hit = [](const Accel&, const KernelRow&, RayBatch rays, std::span<std::uint8_t>, Counters*) {
    marked.push_back(rays.coherent);
  };
  const Scene scene = lone_box();
  const RenderScene ready(scene, {});
  BuildReport report;
  BuildSettings build;
  build.builder = "morton", build.leaf = "triangle1";
  const auto accel = build_structure("bvh2", ready.mesh(), build, report);
  const BatchTracer tracer(ready, *accel, row);
  TracedRays rays;
  rays.rays.resize(1);
  Hit hit;
  std::uint8_t occluded = 0;
  RenderStatistics statistics;
  tracer.closest_hit(rays, 0, {&hit, 1}, RayKind::camera, statistics);
  tracer.any_hit(rays, 0, {&occluded, 1}, RayKind::shadow_hard, statistics);
  CHECK(marked == std::vector<bool>{true, false});
}

TEST_CASE("heat maps: what the counting kernel counts for each pixel's ray, with a bar") {
  Scene scene = lone_box();
  const RenderScene ready(scene, {});
  const std::string_view leaf = default_leaf("bvh4", "watertight", best_isa());
  const KernelRow* row = find_kernel("bvh4", leaf, "watertight", "padded", "single", best_isa());
  REQUIRE(row);
  BuildSettings build;
  build.leaf = leaf, build.isa = best_isa();
  BuildReport report;
  const auto accel = build_structure("bvh4", ready.mesh(), build, report);
  const BatchTracer tracer(ready, *accel, *row);
  const RenderSettings settings{.width = 20, .height = 10};
  const RayGenerator camera(*scene.camera, 20, 10);
  Counters all;
  for (unsigned y = 0; y < 10; ++y) {
    for (unsigned x = 0; x < 20; ++x) {
      const Ray ray = camera.ray(x + 0.5, y + 0.5);
      Hit hit;
      row->closest_hit(*accel, RayBatch({&ray, 1}, {}), {&hit, 1}, &all);
    }
  }
  const HeatMap nodes = count_work(tracer, settings, HeatCount::nodes),
                triangles = count_work(tracer, settings, HeatCount::triangles);
  CHECK(std::accumulate(nodes.counts.begin(), nodes.counts.end(), std::uint64_t{0}) == all.nodes);
  CHECK(std::accumulate(triangles.counts.begin(), triangles.counts.end(), std::uint64_t{0}) == all.triangles);
  CHECK(triangles.mean == Approx(double(all.triangles) / 200));
  CHECK(triangles.most == *std::ranges::max_element(triangles.counts));
  const DrawnPicture drawn = draw(triangles, "triangles a ray");
  CHECK(drawn.width > 20);
  CHECK(drawn.rgb.size() == std::size_t(3) * drawn.width * drawn.height);
  const auto pixel = [&](unsigned x, unsigned y) {
    const std::uint8_t* p = drawn.rgb.data() + 3 * (std::size_t(y) * drawn.width + x);
    return std::array<std::uint8_t, 3>{p[0], p[1], p[2]};
  };
  for (const unsigned x : {0u, 9u, 19u})
    CHECK(pixel(x, 4) == heat_color(double(triangles.counts[4 * 20 + x]) / double(triangles.top)));
  CHECK(drawn_size_at_most(20, 10, "triangles a ray")[0] >= drawn.width);
  CHECK(drawn_size_at_most(20, 10, "triangles a ray")[1] == drawn.height);
  CHECK(error_of([] { static_cast<void>(parse_heat_count("node")); }).find("did you mean 'nodes'") !=
        std::string::npos);
}

TEST_CASE("labels beside a heat map's bar do not overlap") {
  for (const unsigned length : {40u, 56u, 80u, 200u, 1000u}) {
    for (std::uint64_t top = 1; top < 3000; ++top) {
      const std::vector<HeatTick> ticks = heat_ticks(top, 24, 24 + length, 8);
      INFO("top " << top << ", " << length << " pixels");
      REQUIRE(ticks.size() >= 2);
      REQUIRE(ticks.size() <= 10);
      REQUIRE((ticks.front().count == 0 && ticks.front().y == 24 + length && ticks.back().count == top &&
               ticks.back().y == 24));
      for (std::size_t i = 1; i < ticks.size(); ++i) REQUIRE(ticks[i].y + 8 <= ticks[i - 1].y);
    }
  }
  CHECK(heat_ticks(std::uint64_t(1) << 60, 24, 400, 8).size() >= 2);
}

TEST_CASE("pictures that a .png cannot hold are refused before they are made") {
  check_png_size(18000, 18000);
  CHECK(error_of([] { check_png_size(65536, 65536); }).find(".pfm") != std::string::npos);
  CHECK(error_of([] { check_png_size(30000, 30000); }).find(".pfm") != std::string::npos);  // beyond 2^31 bytes
  check_png_size(65536, 5461);
  CHECK(error_of([] { check_png_size(65536, 5462); }).find(".pfm") != std::string::npos);
}

TEST_CASE("settings that cannot be") {
  const auto error = [](RenderSettings s) { return error_of([&] { check(s); }); };
  CHECK(error({.integrator = Integrator::whitted, .depth = 33}).find("0 to 32") != std::string::npos);
  for (const float clamp : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()})
    CHECK(error({.clamp = clamp}).find("clamp") != std::string::npos);
  CHECK(error({.clamp = 0.0f}) == "a clamp of 0 is not possible; one above 0 is, or none");
  check({.integrator = Integrator::whitted, .depth = 32}), check({.depth = 4096});
  for (const double stops : {1e9, -301.0, std::numeric_limits<double>::quiet_NaN()})
    CHECK(error_of([&] { check_exposure(stops); }).find("stops is not possible; -300 to 300 are") != std::string::npos);
  check_exposure(-300), check_exposure(300);
}

TEST_CASE("automatic exposure brings three quarters of what is not black below half of white") {
  Picture picture{32, 32, std::vector<Vec3f>(1024, Vec3f{4, 4, 4})};
  CHECK(auto_exposure(picture) == -3.0);
  for (std::size_t i = 0; i < 256; ++i) picture.pixels[i] = {0, 0, 0};
  CHECK(auto_exposure(picture) == -3.0);
  for (std::size_t y = 8; y < 16; ++y)
    for (std::size_t x = 0; x < 16; ++x) picture.pixels[32 * y + x] = {1e9f, 1e9f, 1e9f};
  CHECK(auto_exposure(picture) == -3.0);
  CHECK(auto_exposure(Picture{2, 1, {{0, 0, 0}, {0, 0, 0}}}) == 0.0);
}
