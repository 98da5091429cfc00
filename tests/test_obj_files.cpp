// The readers of OBJ and MTL files: all that they may hold, and what is refused. Every file is written by the test.
#include "scenes/readers.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("OBJ: polygons, negative indices, materials, line ends, exact decimals") {
  const Folder folder;
  folder.write("m.mtl",
               "newmtl glass\nKs 1 1 1\nNi 1.5\nTf 0.9 0.8 0.7\nillum 7\nNs 12\n\nnewmtl lamp\nKd 0.1 0.2 "
               "0.3\nKe 5 6 7\nPr 0.25\nd 0.5\nmap_Kd wood.png\nmap_d leaf.png\n");
  const Scene scene =
      load_file(folder.write("a.obj",
                             "mtllib m.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3\r\nusemtl lamp\r\nf "
                             "1/1/1 2/2/2 3//3 4\r\nusemtl glass\r\n"
                             "v 0.100000001490116119384765625 +.5 1e-1\r\nf -1 -2 -3\r\nusemtl missing\r\nf 1 2 -1"));
  REQUIRE(scene.mesh.size() == 5);
  CHECK(scene.report.polygons_split == 1);
  REQUIRE(scene.materials.size() == 3);  // the two of the file and a default one
  CHECK(scene.mesh.materials == std::vector<std::uint16_t>{2, 1, 1, 0, 2});
  CHECK(scene.mesh.vertices[4] == Vec3f{0.1f, 0.5f, 0.1f});
  CHECK(scene.mesh.triangles[3] == Triangle{4, 3, 2});
  const Material &glass = scene.materials[0], &lamp = scene.materials[1];
  CHECK(glass.ior == 1.5f);
  CHECK(glass.illum == 7);
  CHECK(glass.shininess == 12.0f);
  CHECK(glass.transmission == Vec3f{0.9f, 0.8f, 0.7f});
  CHECK(lamp.emission == Vec3f{5, 6, 7});
  CHECK(lamp.roughness == 0.25f);
  CHECK(lamp.opacity == 0.5f);
  CHECK(lamp.diffuse_map == (folder.path() / "wood.png").string());
  CHECK(lamp.opacity_map == (folder.path() / "leaf.png").string());
  REQUIRE(scene.report.warnings.size() == 1);
  CHECK_THAT(scene.report.warnings[0], Catch::Contains("a.obj:12: no material 'missing'"));
}

TEST_CASE("MTL: what is no number, or none that can be, is one clear line") {
  const Folder folder;
  const fs::path model = folder.write("a.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
  const auto refusal = [&](const std::string& line) {
    folder.write("m.mtl", "newmtl m\n" + line + "\n");
    return error_of([&] { (void)load_file(model); });
  };
  const std::pair<const char*, const char*> wrong[] = {
      {"Ns abc", "m.mtl:2: Ns: 'abc' is no number"},
      {"Kd a b c", "m.mtl:2: Kd: 'a' is no number"},
      {"Kd 0.5 0.5", "m.mtl:2: Kd needs three numbers, or one for all"},
      {"Ke -1 0 0", "m.mtl:2: Ke is -1, not a finite number from 0 on"},
      {"Ks 1 1 nan", "m.mtl:2: Ks is nan, not a finite number"},
      {"Ke 1e39 0 0", "m.mtl:2: Ke is 1e39, not a finite number"},
      {"Tf", "m.mtl:2: Tf needs three numbers"},
      {"Ni -1", "m.mtl:2: Ni is -1"},
      {"d 7", "m.mtl:2: d is 7, not within 0 to 1"},
      {"illum x", "m.mtl:2: illum: 'x' is no whole number"},
      {"illum 1.5", "m.mtl:2: illum: '1.5' is no whole number"},
      {"illum 99", "m.mtl:2: illum is 99, not within 0 to 10"},
      {"  map_Kd", "m.mtl:2: map_Kd names no file"},
      {"illum nan", "m.mtl:2: illum: 'nan' is no whole number"},
      {"illum 1e30", "m.mtl:2: illum is 1e30, not within 0 to 10"},
      {"d -halo 0.5", "m.mtl:2: d: '-halo' is no number"},
      {"\rKe 1e39 0 0\r", "m.mtl:3: Ke is 1e39"},
  };
  for (const auto& [line, says] : wrong) {
    INFO(line);
    CHECK_THAT(refusal(line), Catch::Contains(says));
  }
  for (const char* line :
       {"", "Kd 0.5", "Kd 2 +1 .5  # bright", "map_Kd #1.png", "Ns 1e3", "a_word_of_others abc", "# Ns abc"}) {
    INFO(line);
    CHECK(refusal(line) == "");
  }
}

TEST_CASE("MTL: one number of a colour stands for all three") {
  const Folder folder;
  std::vector<std::string> warnings;
  const std::vector<Material> read = read_mtl(
      folder.write("m.mtl", "newmtl #1\nKd 0.5\r\n  Ks\t.25  # and so on\nnewmtl b\nTf 0.75\nKe 1 2 3\n"), warnings);
  REQUIRE(read.size() == 2);
  CHECK(read[0].diffuse == Vec3f{0.5f, 0.5f, 0.5f});
  CHECK(read[0].specular == Vec3f{0.25f, 0.25f, 0.25f});
  CHECK(read[1].transmission == Vec3f{0.75f, 0.75f, 0.75f});
  CHECK(read[1].emission == Vec3f{1, 2, 3});
}

TEST_CASE("OBJ and MTL: a byte-order mark costs no line") {
  const Folder folder;
  const std::string mark = "\xef\xbb\xbf";
  folder.write("m.mtl", mark + "newmtl red\nKd 1 0 0\n");
  const Scene scene =
      load_file(folder.write("a.obj", mark + "v 5 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl red\nf 1 2 -1\n"));
  REQUIRE(scene.mesh.size() == 1);
  CHECK(scene.mesh.corners(0)[0] == Vec3f{5, 0, 0});
  CHECK(scene.materials.at(scene.mesh.materials.at(0)).diffuse == Vec3f{1, 0, 0});
  CHECK(scene.report.warnings.empty());
  CHECK_THAT(error_of([&] { (void)load_file(folder.write("b.obj", mark + "v 0 0 zero\n")); }),
             Catch::Contains("b.obj:1: vertex 1 has no number for z"));
}

TEST_CASE("OBJ: names of material libraries and images as other systems write them") {
  const Folder folder;
  fs::create_directory(folder.path() / "tex");
  folder.write("ma t.mtl", "newmtl one\nmap_Kd tex\\a.png\nmap_d .\\tex\\my b.png\n");
  folder.write("tex/two.mtl", "newmtl two\n");
  folder.write("three.mtl", "newmtl three\n");
  folder.write("ma u.mtl", "newmtl four\n");
  const std::string faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl one\nf 1 2 3\nusemtl four\nf 1 3 2\n";
  const Scene scene =
      load_file(folder.write("a.obj", "mtllib ma t.mtl \nmtllib tex\\two.mtl three.mtl\nmtllib ma u.mtl\n" + faces));
  CHECK(scene.report.warnings.empty());
  REQUIRE(scene.materials.size() == 4);
  CHECK(scene.materials[0].diffuse_map == (folder.path() / "tex/a.png").string());
  CHECK(scene.materials[0].opacity_map == (folder.path() / "./tex/my b.png").string());
  CHECK(scene.materials[1].name == "two");
  CHECK(scene.materials[2].name == "three");
  CHECK(scene.mesh.materials == std::vector<std::uint16_t>{0, 3});
}

TEST_CASE("OBJ: what is missing of materials is told once a name, the name as it is written") {
  const Folder folder;
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
                    uses = "usemtl nosuch\nf 1 2 3\nusemtl nöch\nf 1 2 3\nusemtl nosuch\nf 1 2 3\n";
  const auto warnings = [&](const std::string& first) {
    return load_file(folder.write("a.obj", first + vertices + uses)).report.warnings;
  };
  folder.write("m.mtl", "newmtl red\n");
  const std::vector<std::string> none = warnings(""), known = warnings("mtllib m.mtl\n"),
                                 missing = warnings("mtllib matü.mtl\n");
  REQUIRE(none.size() == 2);
  CHECK_THAT(none[0], Catch::EndsWith("a.obj:4: no material 'nosuch' in any 'mtllib' before it; grey stands in"));
  CHECK_THAT(none[1], Catch::Contains("a.obj:6: no material 'nöch'"));
  REQUIRE(known.size() == 2);
  CHECK_THAT(known[0], Catch::EndsWith("a.obj:5: no material 'nosuch' in the material library; grey stands in"));
  REQUIRE(missing.size() == 1);
  CHECK_THAT(missing[0], Catch::Contains("a.obj:1: no material library") && Catch::Contains("/matü.mtl'"));
}

TEST_CASE("OBJ: lines that a backslash continues, comments behind faces, and every way to write a corner") {
  const Folder folder;
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n";
  const Scene plain = load_file(folder.write("plain.obj", points + "f 1 2 3 4\n"));
  const char* const faces[] = {"f 1 2 \\\n 3 4\n",  "f 1 2 3 4 # and so on\n",      "f 1 2 3 4#\n",  "f \\\r\n1 2 3 4",
                               "f +1 -3 3/1 4/1/1", "  f\t1// 2//1\t3/ 4\t# 5 6\n", "f 1 2\\\n3 4\n"};
  for (const char* face : faces) {
    INFO(face);
    const Scene scene = load_file(folder.write("face.obj", points + face));
    CHECK(scene.mesh.triangles == plain.mesh.triangles);
    CHECK(scene.report.warnings.empty());
  }
}
