// A picture with the effects that a scene calls for is the picture with all of them, bit for bit; and the same for
// every structure, way of traversal and number of threads.
#include "scenes/generators/generators.h"
#include "tests/render_scenes.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr RenderSettings kSmall{.width = 24, .height = 18, .samples = 3, .depth = 8};

/// Both integrators, detected effects against all, one by one on top of the detected too.
void check_detected_is_all(const Scene& scene) {
  const EffectSet found = detected(scene);
  for (const Integrator integrator : {Integrator::path, Integrator::whitted}) {
    INFO(to_string(integrator));
    RenderSettings settings = kSmall;
    settings.integrator = integrator;
    const Picture picture = picture_of(scene, found, settings);
    CHECK(same_bits(picture, picture_of(scene, EffectSet::all(), settings)));
    for (std::size_t i = 0; i < kEffectNames.size(); ++i) {
      if (found.has(EffectKind(i))) continue;
      INFO("with " << kEffectNames[i]);
      CHECK(same_bits(picture, picture_of(scene, found.with(EffectKind(i)), settings)));
    }
  }
}

/// The floor with a lamp above it, a box on it, and a sky.
Scene lit_scene() {
  Scene scene = floor_scene();
  scene.materials.push_back({.name = "lamp", .diffuse = {0, 0, 0}, .emission = {9, 8, 7}});
  scene.materials.push_back({.name = "thing", .diffuse = {0.2f, 0.5f, 0.7f}});
  add_square(scene, {-0.5f, 3, 0.5f}, {0, 0, -1}, {1, 0, 0}, 1);
  add_box(scene, {-0.8f, -0.01f, -0.7f}, {0.6f, 1.2f, 0.7f}, 2);
  return scene;
}

bool is_black(const Picture& picture) {
  return std::ranges::all_of(picture.pixels, [](Vec3f p) { return p == Vec3f{0, 0, 0}; });
}

}  // namespace

TEST_CASE("generated scenes: the detected effects give the picture of all effects, bit for bit") {
  for (const GeneratorInfo& generator : generators()) {
    INFO(generator.name);
    check_detected_is_all(generate_scene(generator.name, 600, 1));
  }
}

TEST_CASE("small scenes of every material: the detected effects give the picture of all") {
  const Material materials[] = {
      {.name = "mirror", .diffuse = {0.1f, 0.2f, 0.1f}, .specular = {0.8f, 0.7f, 0.9f}, .illum = 3},
      {.name = "varnish", .diffuse = {0.8f, 0.2f, 0.2f}, .specular = {0.1f, 0.1f, 0.1f}, .illum = 5},
      {.name = "metal", .diffuse = {0, 0, 0}, .specular = {0.8f, 0.7f, 0.3f}, .roughness = 0.3f, .illum = 3},
      {.name = "plastic", .diffuse = {0.1f, 0.6f, 0.3f}, .specular = {0.04f, 0.04f, 0.04f}, .roughness = 0.1f},
      {.name = "shiny", .diffuse = {0.1f, 0.6f, 0.3f}, .specular = {0.5f, 0.5f, 0.5f}, .shininess = 100},
      {.name = "glass",
       .diffuse = {0, 0, 0},
       .specular = {1, 1, 1},
       .transmission = {0.9f, 1, 0.8f},
       .ior = 1.5f,
       .opacity = 0,
       .illum = 7},
      {.name = "filter", .diffuse = {0, 0, 0}, .transmission = {0.9f, 0.1f, 0.1f}, .ior = 1.0f, .illum = 4},
      {.name = "veil", .diffuse = {0.7f, 0.6f, 0.3f}, .opacity = 0.4f},
      {.name = "glowing", .diffuse = {0.7f, 0.6f, 0.3f}, .emission = {0, 2, 0}},
  };
  for (const Material& m : materials) {
    INFO(m.name);
    Scene scene = lit_scene();
    scene.materials[2] = m;
    check_detected_is_all(scene);
    scene.environment = {0.2f, 0.3f, 0.5f};
    scene.lights = {{.position = {2, 4, 2}, .intensity = {20, 20, 20}},
                    {.type = Light::Type::directional, .direction = {1, -2, -1}, .intensity = {0.4f, 0.4f, 0.3f}},
                    {.type = Light::Type::spot,
                     .position = {0, 5, 0},
                     .direction = {0.2f, -1, 0},
                     .intensity = {9, 9, 20},
                     .cone_degrees = 40}};
    check_detected_is_all(scene);
    scene.materials[1].emission = {0, 0, 0};
    scene.lights.resize(1), scene.environment = {0, 0, 0};
    check_detected_is_all(scene);
  }
}

TEST_CASE("a model without materials gives the same picture from every kind of file") {
  const Folder folder;
  Scene obj = load_file(folder.write("a.obj", obj_text()));
  obj.lights.push_back({.position = {2, 3, 4}, .intensity = {60, 60, 60}});
  for (const auto& [name, text] : {std::pair{"a.stl", stl_ascii()}, {"a.off", off_text()}, {"a.ply", ply_ascii()}}) {
    INFO(name);
    Scene other = load_file(folder.write(name, text));
    other.lights = obj.lights;
    for (const Integrator integrator : {Integrator::path, Integrator::whitted}) {
      RenderSettings settings = kSmall;
      settings.integrator = integrator;
      const Picture picture = picture_of(obj, detected(obj), settings);
      CHECK_FALSE(is_black(picture));
      CHECK(same_bits(picture, picture_of(other, detected(other), settings)));
    }
  }
}

TEST_CASE("a map that cannot be read is named by its place, once, and its material goes without") {
  Scene scene = floor_scene();
  scene.environment = {1, 1, 1};
  const Picture plain = picture_of(scene, detected(scene), kSmall);
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = "none.png";
  scene.materials[0].diffuse_map_place = "floor.mtl:3: map_Kd",
  scene.materials[0].opacity_map_place = "floor.mtl:4: map_d";
  const EffectSet effects = detected(scene).with(EffectKind::texture).with(EffectKind::alpha_cutout);
  CHECK(RenderScene(scene, effects).warnings() ==
        std::vector<std::string>{"floor.mtl:3: map_Kd none.png: no such file; its material goes without"});
  CHECK(same_bits(plain, picture_of(scene, effects, kSmall)));
}

TEST_CASE("a light of intensity 0 is no light") {
  Scene scene = floor_scene();
  scene.lights.push_back({.position = {0, 3, 0}, .intensity = {0, 0, 0}});
  CHECK_FALSE(detected(scene).has(EffectKind::shadow_hard));
  check_detected_is_all(scene);
  RenderStatistics statistics;
  CHECK(is_black(picture_of(scene, EffectSet::all(), kSmall, {}, &statistics)));
  CHECK(statistics[RayKind::shadow_hard].rays == 0);
}

TEST_CASE("no lights at all: black, and no shadow rays") {
  const Scene scene = floor_scene();
  check_detected_is_all(scene);
  RenderStatistics statistics;
  CHECK(is_black(picture_of(scene, detected(scene), kSmall, {}, &statistics)));
  CHECK(statistics.total().rays == statistics[RayKind::camera].rays);
  CHECK(statistics[RayKind::camera].rays == 24 * 18 * 3);
}

TEST_CASE("glass of ior exactly 1 is as if it were not there") {
  Scene scene = lit_scene();
  scene.materials[2] = {
      .name = "air", .diffuse = {0, 0, 0}, .specular = {1, 1, 1}, .ior = 1.0f, .opacity = 0, .illum = 7};
  CHECK_FALSE(detected(scene).has(EffectKind::dielectric));
  check_detected_is_all(scene);
  Scene without = scene;
  without.mesh.triangles.resize(4), without.mesh.materials.resize(4);
  CHECK(same_bits(picture_of(scene, detected(scene), kSmall), picture_of(without, detected(without), kSmall)));
  const std::vector<std::string> warnings = RenderScene(scene, detected(scene)).warnings();
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0], Catch::StartsWith("material 'air' is glass (illum 7) of Ni 1 without colour: 12 triangles"));
  CHECK(RenderScene(without, detected(without)).warnings().empty());
  scene.materials[2].ior = 1.5f;
  CHECK_FALSE(same_bits(picture_of(scene, detected(scene), kSmall), picture_of(without, detected(without), kSmall)));
}

TEST_CASE("an aperture of 0, of 1e-30 and of 0.2") {
  Scene scene = lit_scene();
  const Picture pinhole = picture_of(scene, detected(scene), kSmall);
  scene.camera->focus_distance = 5.0f;
  CHECK_FALSE(detected(scene).has(EffectKind::dof));
  check_detected_is_all(scene);
  scene.camera->aperture_radius = 1e-30f;
  CHECK(detected(scene).has(EffectKind::dof));
  check_detected_is_all(scene);
  CHECK(same_bits(pinhole, picture_of(scene, detected(scene), kSmall)));
  scene.camera->aperture_radius = 0.2f;
  check_detected_is_all(scene);
  CHECK_FALSE(same_bits(pinhole, picture_of(scene, detected(scene), kSmall)));
  CHECK(same_bits(pinhole, picture_of(scene, detected(scene).without(EffectKind::dof), kSmall)));
  scene.camera->focus_distance = 0.0f;  // nothing is in focus anywhere: no lens
  check_detected_is_all(scene);
}

TEST_CASE("equal key frames do not move, others do") {
  Scene still = lit_scene(), scene = still;
  scene.key_frames = 2, scene.shutter = {0, 1};
  scene.mesh.later_frames = {scene.mesh.vertices};
  CHECK_FALSE(detected(scene).has(EffectKind::motion_blur));
  check_detected_is_all(scene);
  const Picture unmoved = picture_of(still, detected(still), kSmall);
  CHECK(same_bits(unmoved, picture_of(scene, detected(scene), kSmall)));
  for (std::size_t i = 8; i < scene.mesh.vertices.size(); ++i) scene.mesh.later_frames[0][i].x += 0.5f;
  CHECK(detected(scene).has(EffectKind::motion_blur));
  check_detected_is_all(scene);
  CHECK_FALSE(same_bits(unmoved, picture_of(scene, detected(scene), kSmall)));
  CHECK(same_bits(unmoved, picture_of(scene, detected(scene).without(EffectKind::motion_blur), kSmall)));
  scene.shutter = {0.5f, 0.5f};  // never open
  CHECK_FALSE(detected(scene).has(EffectKind::motion_blur));
  check_detected_is_all(scene);
}

namespace {

std::string pixels(std::initializer_list<int> greys) {
  std::string bytes = "P6 " + std::to_string(greys.size()) + " 1 255\n";
  for (const int grey : greys) bytes += std::string(3, char(grey));
  return bytes;
}

void map_floor(Scene& scene) {
  scene.texture_coordinates.assign(scene.mesh.size(), TextureTriangle{});
  scene.texture_coordinates[0] = {{{0, 0}, {1, 0}, {1, 1}}};
  scene.texture_coordinates[1] = {{{0, 0}, {1, 1}, {0, 1}}};
}

}  // namespace

TEST_CASE("opacity maps: all 1 is none, 0 is no surface, holes let light and shadow rays through") {
  const Folder folder;
  Scene scene = lit_scene();
  map_floor(scene);
  const Picture opaque = picture_of(scene, detected(scene), kSmall);
  scene.materials[0].opacity_map = folder.write("white.ppm", pixels({255, 255, 255})).string();
  CHECK_FALSE(detected(scene).has(EffectKind::alpha_cutout));
  check_detected_is_all(scene);
  CHECK(same_bits(opaque, picture_of(scene, EffectSet::all(), kSmall)));

  scene.materials[0].opacity_map = folder.write("holes.ppm", pixels({255, 0, 255, 128})).string();
  CHECK(detected(scene).has(EffectKind::alpha_cutout));
  check_detected_is_all(scene);
  CHECK_FALSE(same_bits(opaque, picture_of(scene, detected(scene), kSmall)));
  CHECK(same_bits(opaque, picture_of(scene, detected(scene).without(EffectKind::alpha_cutout), kSmall)));

  // The box as one great hole, its lamp's shadow gone with it.
  scene = lit_scene();
  scene.materials[2].opacity = 0.0f;
  check_detected_is_all(scene);
  Scene without = scene;
  without.mesh.triangles.resize(4), without.mesh.materials.resize(4);
  const Picture open = picture_of(scene, detected(scene), kSmall),
                bare = picture_of(without, detected(without), kSmall);
  // Rays begin at tnear > 0: not the same bits, but the same picture
  for (std::size_t i = 0; i < open.pixels.size(); ++i)
    CHECK(std::abs(open.pixels[i].x - bare.pixels[i].x) <= 1e-4f * std::abs(bare.pixels[i].x));
}

TEST_CASE("an image around the scene: of one colour as that colour, black as none") {
  const Folder folder;
  folder.write("thing.obj", obj_text());
  const auto under = [&](const std::string& environment) {
    return load_file(folder.write("scene.yaml",
                                  "meshes: [thing.obj]\nenvironment: " + environment +
                                      "\ncamera: {position: [0.4, -3, 2], look_at: [0.5, 0.5, 0.4], up: [0, 0, 1]}\n"));
  };
  folder.write("white.ppm", pixels({255, 255, 255})), folder.write("black.ppm", pixels({0, 0})),
      folder.write("sky.ppm", pixels({10, 255, 90, 20, 0, 0, 0, 40}));
  const Scene white = under("{image: white.ppm}"), black = under("{image: black.ppm}"), sky = under("{image: sky.ppm}"),
              constant = under("{radiance: 1}");
  for (const Scene* scene : {&white, &black, &sky}) check_detected_is_all(*scene);
  CHECK(same_bits(picture_of(white, detected(white), kSmall), picture_of(constant, detected(constant), kSmall)));
  CHECK_FALSE(detected(black).has(EffectKind::env_light));
  CHECK(is_black(picture_of(black, EffectSet::all(), kSmall)));
  RenderStatistics of_constant, of_sky;
  static_cast<void>(picture_of(constant, detected(constant), kSmall, {}, &of_constant));
  static_cast<void>(picture_of(sky, detected(sky), kSmall, {}, &of_sky));
  CHECK(of_constant[RayKind::env_light].rays == 0);
  CHECK(of_sky[RayKind::env_light].rays > 0);
}

TEST_CASE("diffuse maps: of one colour no texture, of several one") {
  const Folder folder;
  Scene scene = lit_scene();
  map_floor(scene);
  const Picture plain = picture_of(scene, detected(scene), kSmall);
  scene.materials[0].diffuse_map = folder.write("white.ppm", pixels({255, 255, 255})).string();
  CHECK_FALSE(detected(scene).has(EffectKind::texture));
  check_detected_is_all(scene);
  CHECK(same_bits(plain, picture_of(scene, detected(scene), kSmall)));
  scene.materials[0].diffuse_map = folder.write("grey.ppm", pixels({100, 100})).string();
  check_detected_is_all(scene);
  scene.materials[0].diffuse_map = folder.write("stripes.ppm", pixels({255, 20, 90})).string();
  CHECK(detected(scene).has(EffectKind::texture));
  check_detected_is_all(scene);
  CHECK_FALSE(same_bits(plain, picture_of(scene, detected(scene), kSmall)));
  scene.texture_coordinates.clear();
  check_detected_is_all(scene);
}

TEST_CASE("identity instances, and instances in a structure of two levels") {
  const Folder folder;
  folder.write("thing.obj", obj_text());
  const std::string rest =
      "environment: {radiance: 1}\ncamera: {position: [0.4, -3, 2], look_at: [0.5, 0.5, 0.4], up: [0, 0, 1]}\n";
  const Scene plain = load_file(folder.write("plain.yaml", "meshes: [thing.obj]\n" + rest));
  const Scene one = load_file(folder.write(
      "one.yaml", "meshes: [thing.obj]\ninstances: [{mesh: thing, transforms: [{translate: [0, 0, 0]}]}]\n" + rest));
  const Scene two = load_file(folder.write("two.yaml",
                                           "meshes: [thing.obj]\ninstances: [{mesh: thing, transforms: [{translate: "
                                           "[0, 0, 0]}, {translate: [2, 1, 0]}]}]\n" +
                                               rest));
  CHECK_FALSE(detected(one).has(EffectKind::instancing));
  CHECK(detected(two).has(EffectKind::instancing));
  check_detected_is_all(one), check_detected_is_all(two);
  const Picture picture = picture_of(plain, detected(plain), kSmall);
  CHECK_FALSE(is_black(picture));
  CHECK(same_bits(picture, picture_of(one, detected(one), kSmall)));
  CHECK(same_bits(picture, picture_of(one, EffectSet::all(), kSmall, {.structure = "two_level"})));
  CHECK(same_bits(picture_of(two, detected(two), kSmall, {.structure = "two_level", .intersector = "exact"}),
                  picture_of(two, detected(two), kSmall, {.structure = "bvh8", .intersector = "exact"})));
}

TEST_CASE("an emissive triangle without area is dropped with its light") {
  const Folder folder;
  folder.write("m.mtl", "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 5 5 5\n");
  const std::string obj =
      "mtllib m.mtl\nv -4 0 4\nv 4 0 4\nv 0 0 -4\nv 1 2 1\nv 2 2 2\nv 3 2 3\nusemtl grey\nf 1 2 3\nusemtl lamp\nf 4 5 "
      "6\n";
  const Scene scene = load_file(folder.write("m.obj", obj));
  CHECK(scene.report.degenerate == 1);
  CHECK(detected(scene).empty());
  check_detected_is_all(scene);
  // One that no loader has seen.
  Scene raw = floor_scene();
  raw.materials.push_back({.name = "lamp", .emission = {5, 5, 5}});
  raw.mesh.vertices.insert(raw.mesh.vertices.end(), {{1, 2, 1}, {2, 2, 2}, {3, 2, 3}});
  raw.mesh.triangles.push_back({4, 5, 6}), raw.mesh.materials.push_back(1);
  check_detected_is_all(raw);
  CHECK(is_black(picture_of(raw, EffectSet::all(), kSmall)));
}

TEST_CASE("what is left out sends no rays, and what is simulated does") {
  const Scene box = generate_scene("cornell_box", 2000, 1);
  RenderStatistics all, less;
  const Picture whole = picture_of(box, detected(box), kSmall, {}, &all);
  for (const RayKind kind :
       {RayKind::mirror, RayKind::glossy, RayKind::dielectric, RayKind::diffuse_gi, RayKind::shadow_soft})
    CHECK(all[kind].rays > 0);
  CHECK(all[RayKind::shadow_hard].rays == 0);
  CHECK(all[RayKind::env_light].rays == 0);
  CHECK(all[RayKind::alpha_cutout].rays == 0);
  const std::pair<EffectKind, RayKind> own[] = {{EffectKind::mirror, RayKind::mirror},
                                                {EffectKind::glossy, RayKind::glossy},
                                                {EffectKind::dielectric, RayKind::dielectric},
                                                {EffectKind::diffuse_gi, RayKind::diffuse_gi},
                                                {EffectKind::shadow_soft, RayKind::shadow_soft}};
  for (const auto& [effect, kind] : own) {
    INFO(to_string(effect));
    CHECK_FALSE(same_bits(whole, picture_of(box, detected(box).without(effect), kSmall, {}, &less)));
    CHECK(less[kind].rays == 0);
    CHECK(less.total().rays < all.total().rays);
  }
}

TEST_CASE("pictures are the same for every structure, way of traversal and number of threads") {
  const Scene box = generate_scene("cornell_box", 2000, 1);
  Scene veiled = lit_scene();
  veiled.materials[2].opacity = 0.5f, veiled.environment = {1, 1, 1};
  for (const std::string_view intersector : {"watertight", "exact", "pluecker"}) {
    for (const Scene* scene : {&box, static_cast<const Scene*>(&veiled)}) {
      RenderSettings settings = kSmall;
      const Picture picture =
          picture_of(*scene, detected(*scene), settings, {.structure = "brute_force", .intersector = intersector});
      for (const std::string_view structure :
           {"bvh2", "bvh4", "bvh8", "bvh16", "bvh4_aos", "kdtree", "grid", "octree"}) {
        for (const std::string_view traversal :
             {"single", "queued", "stream", "packet8", "packet64", "hybrid8", "auto"}) {
          const std::string_view leaf = default_leaf(structure, intersector, best_isa());
          if (!find_kernel(structure, leaf, intersector, "padded", traversal, best_isa())) continue;
          INFO(intersector << " " << structure << " " << traversal);
          CHECK(
              same_bits(picture, picture_of(*scene, detected(*scene), settings, {structure, traversal, intersector})));
        }
      }
      for (const unsigned threads : {2u, 5u, 0u}) {
        settings.threads = threads;
        CHECK(same_bits(picture, picture_of(*scene, detected(*scene), settings,
                                            {.structure = "bvh8", .intersector = intersector})));
      }
    }
  }
}

TEST_CASE("a picture's pixels do not depend on how many samples are taken together, and seeds differ") {
  const Scene box = generate_scene("cornell_box", 2000, 1);
  RenderSettings settings{.width = 8, .height = 8, .samples = 33, .depth = 3};
  const Picture picture = picture_of(box, detected(box), settings);
  settings.seed = 2;
  CHECK_FALSE(same_bits(picture, picture_of(box, detected(box), settings)));
  settings.samples = 0;
  CHECK(error_of([&] { picture_of(box, detected(box), settings); }).find("samples") != std::string::npos);
}
