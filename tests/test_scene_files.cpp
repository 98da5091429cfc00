// Scene files, the words that name scenes, the catalogue, inspection, effects.
#include <iterator>
#include <sstream>

#include "scenes/catalogue.h"
#include "scenes/effects.h"
#include "scenes/inspect.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("scene files: everything that they may hold") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  folder.write("b.ply", ply_binary(false, true));
  const Scene scene = load_file(folder.write(
      "s.yaml",
      "name: two things\nsource: a test\nmeshes: [a.obj, {file: b.ply, name: other}]\n"
      "camera: {position: [0, 1, 5], look_at: [0, 0, 0], up: [0, 1, 0], vertical_fov: 50, mirror_x: true, "
      "resolution: [320, 200], aperture_radius: 0.5, focus_distance: 4}\n"
      "shutter: [0.25, 1]\nenvironment: {radiance: [0.5, 1, 2]}\n"
      "lights:\n  - {type: point, position: [1, 2, 3], intensity: 7}\n  - {type: directional, direction: [0, "
      "-1, 0]}\n"
      "  - {type: spot, position: [0, 3, 0], direction: [0, -1, 0], cone_degrees: 30, intensity: [1, 2, 3]}\n"
      "instances:\n  - mesh: other\n    transforms:\n      - [1, 0, 0, 10,  0, 1, 0, 20,  0, 0, 1, 30,  0, "
      "0, 0, 1]\n"
      "      - {translate: [0, 0, 5], rotate: {axis: [0, 0, 1], degrees: 90}, scale: 2}\n"));
  REQUIRE(scene.mesh.size() == 12);
  CHECK(scene.name == "two things");
  CHECK(scene.instances == 2);
  // Instanced meshes stand where their instances say, the other one once where it is; these come last.
  CHECK(scene.mesh.corners(0)[1] == Vec3f{11, 20, 30});
  CHECK(scene.mesh.corners(4)[1].y == Approx(2));
  CHECK(scene.mesh.corners(4)[1].z == 5);
  CHECK(scene.mesh.corners(8)[1] == Vec3f{1, 0, 0});
  REQUIRE(scene.materials.size() == 3);
  CHECK(scene.mesh.materials == std::vector<std::uint16_t>{1, 2, 1, 2, 1, 2, 1, 2, 0, 0, 0, 0});
  REQUIRE(scene.camera);
  CHECK(scene.camera->position == Vec3f{0, 1, 5});
  CHECK(scene.camera->vertical_fov == 50);
  CHECK(scene.camera->mirror_x);
  CHECK(scene.camera->width == 320);
  CHECK(scene.camera->height == 200);
  CHECK(scene.camera->aperture_radius == 0.5f);
  CHECK(scene.camera->focus_distance == 4);
  CHECK(scene.shutter.open == 0.25f);
  CHECK(scene.environment == Vec3f{0.5f, 1, 2});
  REQUIRE(scene.lights.size() == 3);
  CHECK(scene.lights[0].intensity == Vec3f{7, 7, 7});
  CHECK(scene.lights[1].type == Light::Type::directional);
  CHECK(scene.lights[2].cone_degrees == 30);
  CHECK(scene.report.warnings.empty());
}

TEST_CASE("scene files: a pinhole camera needs no focus distance, and exporters write 0 for it") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  const Scene scene = load_file(folder.write("s.yaml",
                                             "meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], "
                                             "aperture_radius: 0, focus_distance: 0}\n"));
  REQUIRE(scene.camera);
  CHECK(scene.camera->aperture_radius == 0);
}

TEST_CASE("scene files: key frames are kept, and must fit together") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  folder.write("b.obj", obj_text());
  folder.write("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Scene scene = load_file(folder.write("s.yaml", "meshes: [{keyframes: [a.obj, b.obj]}]\nshutter: [0, 1]\n"));
  CHECK(scene.mesh.size() == 4);
  CHECK(scene.key_frames == 2);
  CHECK(scene.mesh.frames() == 2);
  CHECK(scene.report.warnings.empty());
  CHECK_THAT(error_of([&] { (void)load_file(folder.write("t.yaml", "meshes: [{keyframes: [a.obj, c.obj]}]\n")); }),
             Catch::Contains("t.yaml:1: key frame 'c.obj' has other triangles"));
}

TEST_CASE("bad scene files: file, line, and the nearest key") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  const std::pair<const char*, const char*> cases[] = {
      {"mesh: [a.obj]\n", ":1: unknown key of the scene 'mesh'; did you mean 'meshes'?"},
      {"name: x\n", "the scene needs 'meshes'"},
      {"meshes: []\n", ":1: meshes must be a list with something in it"},
      {"meshes: a.obj\n", ":1: meshes must be a list"},
      {"- a.obj\n", "no scene file"},
      {"meshes: [a.obj\n", "s.yaml:2: not valid YAML: "},
      {"meshes:\n\t- a.obj\n", "s.yaml:2: a tab; YAML is indented with spaces: put spaces in its place"},
      {"meshes: [a.obj]\nmeshes: [a.obj]\n", ":2: the scene names 'meshes' twice"},
      {"meshes:\n  - a.obj\n  - b.obj\n", "s.yaml:3: "},
      {"meshes:\n  - a.obj\n  - b.obj\n", "b.obj: no such file; check the path"},
      {"meshes:\n  - {file: b.obj}\n", "s.yaml:2: "},
      {"meshes:\n  - keyframes:\n    - a.obj\n    - b.obj\nshutter: [0, 1]\n", "s.yaml:4: "},
      {"meshes: [a.obj]\nenvironment:\n  image: x.hdr\n", "s.yaml:3: "},
      {"name: a/b\nmeshes: [a.obj]\n", "s.yaml:1: name 'a/b' cannot be a part of a cell's name"},
      {"meshes: [a.obj]\nname: ''\n", "s.yaml:2: name must be a text"},
      {"meshes: [a.obj]\nname:\n", "s.yaml:2: name has no value"},
      {"meshes: [a.obj]\nname: ' '\n", "s.yaml:2: name '' cannot be a part of a cell's name"},
      {"meshes: [a.obj]\nname: \"a\\tb\"\n", "s.yaml:2: name 'a b' cannot be a part of a cell's name"},
      {"meshes: [{path: a.obj}]\n", ":1: unknown key of a mesh 'path'"},
      {"meshes: [a.obj]\ncamera:\n  position: [0, 0, 1]\n  lookat: [0, 0, 0]\n",
       ":4: unknown key of camera 'lookat'; did you mean 'look_at'?"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1]}\n", ":2: camera needs 'look_at'"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 1]}\n",
       ":2: camera position and look_at are the same point"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0]}\n",
       ":2: camera look_at must be a list of three numbers"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, x, 0]}\n",
       ":2: camera look_at must be a finite number, not 'x'"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, .nan], look_at: [0, 1, 0]}\n",
       ":2: camera position must be a finite number"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], up: [0, 0, 1]}\n",
       ":2: camera up is zero or parallel"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], vertical_fov: 180}\n",
       ":2: camera vertical_fov must lie between"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], resolution: [0, 10]}\n",
       ":2: camera width must be a whole number"},
      {"meshes: [a.obj]\nlights: [{type: pint, position: [0, 0, 0]}]\n",
       ":2: unknown light type 'pint'; did you mean 'point'?"},
      {"meshes: [a.obj]\nlights: [{type: point, direction: [0, 0, 1]}]\n",
       ":2: unknown key of a point light 'direction'"},
      {"meshes: [a.obj]\nlights: [{position: [0, 0, 1]}]\n", ":2: a light needs 'type'"},
      {"meshes: [a.obj]\nlights: [{type: point, position: [0, 0, 0], intensity: -1}]\n",
       ":2: a light's intensity must not be negative"},
      {"meshes: [a.obj]\nenvironment: {radiance: 1, image: x.hdr}\n", ":2: environment needs either"},
      {"meshes: [a.obj]\nenvironment: {image: x.hdr}\n", "x.hdr: no such file"},
      {"meshes: [a.obj]\nenvironment: {image: a.obj}\n", "a.obj: no image of a kind that is read"},
      {"meshes: [a.obj]\ncamera:\n  position: [0, 0, 1]\n  look_at: [0, 0, 0]\n  aperture_radius: 1\n  focus_distance: "
       "0\n",
       ":6: a camera with an aperture_radius needs a focus_distance above 0"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], aperture_radius: 1}\n",
       ":2: a camera with an aperture_radius needs a focus_distance above 0"},
      {"meshes: [a.obj]\nshutter: [0, 2]\n", ":2: the shutter [0, 2] must lie within [0, 1]"},
      {"meshes: [a.obj]\nshutter: [-1, 7]\n", ":2: the shutter [-1, 7] must lie within [0, 1]"},
      {"meshes: [a.obj]\nshutter: [1, 0]\n", ":2: the shutter closes before it opens"},
      {"meshes: [a.obj]\ninstances: [{mesh: b, transforms: [{scale: 1}]}]\n", ":2: unknown mesh 'b' (valid: a)"},
      {"meshes: [a.obj, {file: a.obj, name: a}]\ninstances: [{mesh: a, transforms: [{scale: 1}]}]\n",
       ":2: 2 meshes are called 'a'"},
      {"meshes: [a.obj]\ninstances: [{mesh: 1, transforms: [{scale: 1}]}]\n", ":2: mesh 1 does not exist"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [{scale: 0}]}]\n", ":2: a transform flattens its mesh"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [[1, 2, 3]]}]\n", ":2: a transform has 16 numbers"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [{rotation: 1}]}]\n",
       ":2: unknown key of a transform 'rotation'; did you mean 'rotate'?"},
  };
  for (const auto& c : cases) {
    INFO(c.first);
    CHECK_THAT(error_of([&] { (void)load_file(folder.write("s.yaml", c.first)); }), Catch::Contains(c.second));
  }
}

namespace {

/// The keys that the reader names as valid where it meets one that is not.
std::vector<std::string> valid_keys(const std::string& error) {
  const std::size_t begin = error.find("(valid: ");
  REQUIRE(begin != std::string::npos);
  std::string list = error.substr(begin + 8, error.rfind(')') - begin - 8);
  std::ranges::replace(list, ',', ' ');
  std::istringstream words(list);
  return {std::istream_iterator<std::string>(words), {}};
}

}  // namespace

TEST_CASE("docs/scenes.md has a row for every key that scene files may hold, and for no other") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  std::ifstream stream(fs::path(ARBORETUM_SOURCE_DIR) / "docs" / "scenes.md");
  const std::string page(std::istreambuf_iterator<char>(stream), {});
  const std::string mesh = "meshes: [a.obj]\n", instance = mesh + "instances: [{mesh: a, transforms: [";
  const std::pair<const char*, std::string> kinds[] = {
      {"The scene", mesh + "zzzz: 1\n"},
      {"A mesh", "meshes: [{zzzz: 1}]\n"},
      {"An instance", mesh + "instances: [{zzzz: 1}]\n"},
      {"A transform", instance + "{zzzz: 1}]}]\n"},
      {"A rotation", instance + "{rotate: {zzzz: 1}}]}]\n"},
      {"The camera", mesh + "camera: {zzzz: 1}\n"},
      {"The environment", mesh + "environment: {zzzz: 1}\n"},
      {"A point light", mesh + "lights: [{type: point, zzzz: 1}]\n"},
      {"A directional light", mesh + "lights: [{type: directional, zzzz: 1}]\n"},
      {"A spot light", mesh + "lights: [{type: spot, zzzz: 1}]\n"},
  };
  std::size_t sections = 0;
  for (std::size_t at = page.find("\n## "); at != std::string::npos; at = page.find("\n## ", at + 1)) ++sections;
  CHECK(sections == std::size(kinds));
  for (const auto& [heading, text] : kinds) {
    INFO(heading);
    const std::size_t begin = page.find(std::string("\n## ") + heading + "\n");
    REQUIRE(begin != std::string::npos);
    const std::string section = page.substr(begin, page.find("\n## ", begin + 1) - begin);
    const std::vector<std::string> keys =
        valid_keys(error_of([&, &text = text] { (void)load_file(folder.write("s.yaml", text)); }));
    CHECK(keys.size() >= 2);
    for (const std::string& key : keys) {
      INFO(key);
      CHECK(section.find("\n| `" + key + "` | ") != std::string::npos);
    }
    std::size_t rows = 0;
    for (std::size_t at = section.find("\n| `"); at != std::string::npos; at = section.find("\n| `", at + 1)) ++rows;
    CHECK(rows == keys.size());
  }
}

TEST_CASE("words of the command line, and what scenes are called") {
  const Folder folder;
  CHECK(parse_scene_word("bunny").catalogue == "bunny");
  CHECK(parse_scene_word("models/a.obj").file == "models/a.obj");
  CHECK(parse_scene_word("a.yaml").scene == "a.yaml");
  const SceneSpec generated = parse_scene_word("needles:5000:7");
  CHECK(generated.generator == "needles");
  CHECK(generated.triangles == 5000);
  CHECK(generated.seed == 7);
  CHECK(generated.name() == "needles-5000-seed7");
  CHECK(parse_scene_word("city:12").name() == "city-12");
  CHECK(parse_scene_word("models/a.obj").name() == "a");
  CHECK(parse_scene_word("not_there.yaml").name() == "not_there");
  CHECK(parse_scene_word(folder.write("room.yaml", "meshes: [none.obj]\n").string()).name() == "room");
  CHECK(parse_scene_word(folder.write("room.yaml", "meshes: [none.obj]\nname: chamber\n").string()).name() ==
        "chamber");
  CHECK_THAT(error_of([] { (void)parse_scene_word("buny"); }), Catch::Contains("did you mean 'bunny'?"));
  CHECK_THAT(error_of([] { (void)parse_scene_word("citty:100"); }), Catch::Contains("did you mean 'city'?"));
  CHECK_THAT(error_of([] { (void)parse_scene_word("city:many"); }), Catch::Contains("'many' is no whole number"));
  CHECK_THAT(error_of([] { (void)parse_scene_word("city:-5"); }), Catch::Contains("no whole number"));
  CHECK_THAT(error_of([] { (void)parse_scene_word(""); }), Catch::Contains("empty"));
  CHECK_THAT(error_of([] { (void)load_scene(SceneSpec{}); }), Catch::Contains("exactly one"));
}

TEST_CASE("the catalogue is sound, and says how to bring what is not there") {
  const std::vector<CatalogueEntry> entries = catalogue();
  std::size_t generated = 0;
  for (const CatalogueEntry& entry : entries) {
    INFO(entry.name);
    CHECK_FALSE(entry.description.empty());
    CHECK_FALSE(entry.licence.empty());
    CHECK(find_catalogue_entry(entry.name).name == entry.name);
    generated += entry.source == CatalogueEntry::Source::generator;
  }
  CHECK(generated == 11);
  CHECK(find_catalogue_entry("bunny").triangles == 69666);
  CHECK(find_catalogue_entry("dragon").triangles == 871414);

  const Folder folder;
  const fs::path list =
      folder.write("list.yaml", "scenes: [{name: thing, description: d, package: {debian: thing-data}, file: " +
                                    (folder.path() / "thing.obj").string() + ", licence: free, triangles: 4}]\n");
  ::setenv("ARBORETUM_CATALOGUE", list.c_str(), 1);
  const SceneSpec thing{.catalogue = "thing", .file = {}, .scene = {}, .generator = {}};
  CHECK_THAT(error_of([&] { (void)load_scene(thing); }), Catch::Contains("./arboretum fetch thing"));
  folder.write("thing.obj", obj_text());
  check_pyramid(load_scene(thing));
  folder.write("list.yaml", "scenes: [{name: thing, descripton: d}]\n");
  CHECK_THAT(error_of([&] { (void)catalogue(); }), Catch::Contains("did you mean 'description'?"));
  ::unsetenv("ARBORETUM_CATALOGUE");
}

TEST_CASE("inspection counts what is wrong with a mesh") {
  const Folder folder;
  // A closed tetrahedron; a copy of one of its faces, turned round; a sliver; a zero-area triangle.
  const Scene scene =
      load_file(folder.write("a.obj",
                             "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 4 2 "
                             "1\nv 5 0 0\nv 9 0 0\nv 7 0.001 0\nf 5 6 7\nf 5 6 6\n"));
  const SceneInfo info = inspect_scene(scene);
  CHECK(info.triangles == 6);
  CHECK(info.report.degenerate == 1);
  CHECK(info.duplicates == 1);
  CHECK(info.slivers == 1);
  CHECK(info.boundary_edges == 3);
  CHECK(info.non_manifold_edges == 3);
  CHECK_FALSE(info.closed);
  // vertices joined by position
  CHECK(inspect_scene(load_file(folder.write("b.stl", stl_ascii()))).boundary_edges == 4);
  const Scene sphere = load_scene(parse_scene_word("sphere:500"));
  CHECK(inspect_scene(sphere).closed);
  CHECK(inspect_scene(sphere).edges == 750);
}

TEST_CASE("inspection tells images that cannot be read, of used materials alone, and instances of what moves") {
  const Folder folder;
  folder.write("a.mtl", "newmtl wall\nKd 1 1 1\nmap_Kd none.png\nmap_d none.png\nnewmtl unused\nmap_Kd other.png\n");
  folder.write("a.obj", "mtllib a.mtl\nusemtl wall\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  folder.write("b.obj", "v 0 0 9\nv 1 0 9\nv 0 1 9\nf 1 2 3\n");
  folder.write("c.obj", "v 0 0 8\nv 1 0 9\nv 0 1 9\nf 1 2 3\n");
  const std::string meshes =
      "instances: [{mesh: a, transforms: [{translate: [2, 0, 0]}, {translate: [4, 0, 0]}]}]\nmeshes: [a.obj, ";
  const SceneInfo still = inspect_scene(load_file(folder.write("still.yaml", meshes + "b.obj]\n")));
  REQUIRE(still.report.warnings.size() == 1);
  CHECK(still.report.warnings[0] == (folder / "a.mtl").string() + ":3: map_Kd " + (folder / "none.png").string() +
                                        ": no such file; its material goes without");
  CHECK((still.instances == 3 && still.named_instances == 2));
  const SceneInfo moving =
      inspect_scene(load_file(folder.write("moving.yaml", meshes + "{keyframes: [b.obj, c.obj]}]\nshutter: [0, 1]\n")));
  CHECK((moving.instances == 0 && moving.named_instances == 2 && moving.key_frames == 2));
}

TEST_CASE("inspection tells why an image cannot be read, and glass that cannot be seen") {
  const Folder folder;
  folder.write("a.webp", "RIFF\x10\0\0\0WEBPVP8 and so on");
  folder.write("cut.png", "\x89PNG\r\n\x1a\n");
  fs::create_directory(folder / "folder.png");
  const fs::path model = folder.write("a.obj", "mtllib a.mtl\nusemtl #1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string mtl = (folder / "a.mtl").string(), place = mtl + ":3: map_d ";
  for (const auto& [image, why] :
       {std::pair{"a.webp",
                  "no image of a kind that is read, which are PNG, JPEG, BMP, TGA, GIF, PSD, PNM, PIC and HDR"},
        {"cut.png", "broken or truncated"},
        {"folder.png", "no regular file"},
        {"none.png", "no such file"}}) {
    INFO(image);
    folder.write("a.mtl", std::string("newmtl #1\nKd 1 1 1\nmap_d ") + image + "\n");
    const std::vector<std::string> warnings = inspect_scene(load_file(model)).report.warnings;
    REQUIRE(warnings.size() == 1);
    CHECK_THAT(warnings[0], Catch::StartsWith(place + (folder / image).string() + ": " + why));
  }
  folder.write("a.mtl", "newmtl #1\nKd 1 1 1\nillum 4\n");
  const std::vector<std::string> warnings = inspect_scene(load_file(model)).report.warnings;
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0],
             Catch::Contains("material '#1' is glass (illum 4) of Ni 1 without colour: 1 triangle cannot"));
  folder.write("a.mtl", "newmtl #1\nKd 1 1 1\nillum 5\nnewmtl unused\nillum 4\n");
  CHECK(inspect_scene(load_file(model)).report.warnings.empty());
}

TEST_CASE("effects: called for exactly where something needs them") {
  Scene plain;
  plain.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  plain.mesh.triangles = {{0, 1, 2}};
  plain.mesh.materials = {0};
  plain.materials = {Material{.name = "grey"}, Material{.name = "unused", .emission = {1, 1, 1}, .opacity = 0.5f}};
  const auto called = [](const Scene& scene) {
    std::vector<std::string> names;
    for (const Effect& e : effects_of(scene)) {
      CHECK_FALSE(e.reason.empty());
      if (e.called_for) names.emplace_back(e.name);
    }
    return names;
  };
  using Names = std::vector<std::string>;
  REQUIRE(effects_of(plain).size() == kEffectNames.size());
  CHECK(called(plain) == Names{});

  Scene scene = plain;
  scene.lights.push_back(Light{});
  CHECK(called(scene) == Names{"shadow_hard", "diffuse_gi"});
  const auto why_gi = [&] {
    return effects_of(scene)[std::size_t(std::ranges::find(kEffectNames, "diffuse_gi") - kEffectNames.begin())].reason;
  };
  const std::string gi = "diffuse surface (Kd > 0) in a lit scene: ";
  CHECK(why_gi() == gi + "1 triangle of 1 material, grey");
  scene.materials[0].name = "";
  CHECK(why_gi() == gi + "1 triangle of 1 material");
  scene.mesh.triangles.resize(3, {0, 1, 2}), scene.mesh.materials = {1, 0, 0};
  CHECK(why_gi() == gi + "3 triangles of 2 materials");
  scene.materials[0].name = "grey";
  CHECK(why_gi() == gi + "3 triangles of 2 materials, first grey");
  scene = plain;
  scene.lights.push_back(Light{});
  scene.lights[0].intensity = {0, 0, 0};
  CHECK(called(scene) == Names{});

  scene = plain;
  scene.materials[0].emission = {0, 3, 0};
  CHECK(called(scene) == Names{"shadow_soft", "diffuse_gi"});
  scene.environment = {1, 1, 1};
  CHECK(called(scene) == Names{"shadow_soft", "env_light", "diffuse_gi", "multi_light"});

  const struct {
    Material material;
    Names names;
  } materials[] = {
      {Material{.name = "mirror", .specular = {1, 1, 1}, .illum = 3}, {"mirror"}},
      {Material{.name = "varnish", .specular = {0.1f, 0.1f, 0.1f}, .illum = 5}, {"mirror"}},
      {Material{.name = "five", .illum = 5}, {}},
      {Material{.name = "five of glass", .specular = {1, 1, 1}, .ior = 1.5f, .illum = 5}, {"dielectric"}},
      {Material{.name = "a filter of five", .transmission = {1, 0.5f, 0.5f}, .illum = 5}, {"dielectric"}},
      {Material{.name = "brushed", .specular = {1, 1, 1}, .roughness = 0.2f, .illum = 3}, {"glossy"}},
      {Material{.name = "plastic", .specular = {0.04f, 0.04f, 0.04f}, .illum = 2}, {"glossy"}},
      {Material{.name = "glass", .specular = {1, 1, 1}, .ior = 1.5f, .opacity = 0, .illum = 7}, {"dielectric"}},
      {Material{.name = "air", .ior = 1.0f, .illum = 7}, {}},
      {Material{.name = "black filter", .transmission = {0, 0, 0}, .ior = 1.5f, .illum = 7}, {}},
      {Material{.name = "leaf", .opacity = 0.5f}, {"alpha_cutout"}},
  };
  for (const auto& m : materials) {
    INFO(m.material.name);
    scene = plain;
    scene.materials[0] = m.material;
    CHECK(called(scene) == m.names);
  }
  scene = plain;
  scene.camera = Camera{.aperture_radius = 1e-30f, .focus_distance = 1};
  CHECK(called(scene) == Names{"dof"});
  scene = plain;
  scene.key_frames = 2;
  CHECK(called(scene) == Names{});
  scene.shutter = {0, 1};
  CHECK(called(scene) == Names{"motion_blur"});
  scene = plain;
  scene.instances = 2;
  CHECK(called(scene) == Names{"instancing"});

  // Maps count only where they hold more than one value. Three-pixel images in the plainest format that there
  // is (PGM, PPM).
  const Folder folder;
  const std::string varied =
      folder.write("varied.ppm", "P6 3 1 255\n" + std::string("\xff\xff\xff\x10\x10\x10\xff\xff\xff", 9)).string();
  const std::string white = folder.write("white.ppm", "P6 3 1 255\n" + std::string(9, '\xff')).string();
  scene = plain;
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = white;
  CHECK(called(scene) == Names{});
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = varied;
  CHECK(called(scene) == Names{"alpha_cutout", "texture"});
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = (folder.path() / "missing.png").string();
  CHECK(called(scene) == Names{});
}
