// Readers of every format, and bad files (of OBJ and MTL more in test_obj_files.cpp). Every file is written by the
// test.
#include <sys/stat.h>
#include <unistd.h>

#include <clocale>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

#include "core/random.h"
#include "scenes/number_text.h"
#include "scenes/readers.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

// Assimp itself leaks on some of the damaged files; only a build with the address sanitizer asks.
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp"; }

namespace {

std::string stl_binary() {
  std::string s(80, ' ');
  put(s, std::uint32_t(4), false);
  for (const auto& f : kFaces) {
    for (int k = 0; k < 3; ++k) put(s, 0.0f, false);
    for (const int i : f)
      for (const float x : kCorners[i]) put(s, x, false);
    put(s, std::uint16_t(0), false);
  }
  return s;
}

/// The pyramid's buffer for glTF: positions, then indices of 16 bits.
std::string gltf_buffer() {
  std::string s;
  for (const auto& v : kCorners)
    for (const float x : v) put(s, x, false);
  for (const auto& f : kFaces)
    for (const int i : f) put(s, std::uint16_t(i), false);
  return s;
}

std::string gltf_json(const std::string& buffer_member, const std::string& node_members = "") {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)" + node_members +
         R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[)"
         R"({"bufferView":0,"componentType":5126,"count":5,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},)"
         R"({"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}],"bufferViews":[)"
         R"({"buffer":0,"byteOffset":0,"byteLength":60},{"buffer":0,"byteOffset":60,"byteLength":24}],)"
         R"("buffers":[{"byteLength":84)" +
         buffer_member + "}]}";
}

std::string glb_bytes() {
  std::string json = gltf_json("");
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::string buffer = gltf_buffer();
  std::string s = "glTF";
  put(s, std::uint32_t(2), false);
  put(s, std::uint32_t(12 + 8 + json.size() + 8 + buffer.size()), false);
  put(s, std::uint32_t(json.size()), false);
  s += "JSON" + json;
  put(s, std::uint32_t(buffer.size()), false);
  s += std::string("BIN\0", 4) + buffer;
  return s;
}

}  // namespace

TEST_CASE("every format gives the same triangles in the same order") {
  const Folder folder;
  folder.write("part.bin", gltf_buffer());
  const std::pair<const char*, std::string> files[] = {{"a.obj", obj_text()},
                                                       {"ascii.ply", ply_ascii()},
                                                       {"little.ply", ply_binary(false, false)},
                                                       {"big.ply", ply_binary(true, false)},
                                                       {"ascii.stl", stl_ascii()},
                                                       {"binary.stl", stl_binary()},
                                                       {"a.off", off_text()},
                                                       {"a.gltf", gltf_json(R"(,"uri":"part.bin")")},
                                                       {"a.glb", glb_bytes()}};
  for (const auto& [name, bytes] : files) {
    INFO(name);
    check_pyramid(load_file(folder.write(name, bytes)));
  }
}

TEST_CASE("coordinates written as text are the nearest floats, in every format") {
  const Folder folder;
  // Decimals of one to seventeen digits, some with an exponent; three a corner, three corners a triangle.
  std::vector<std::string> words{"0.1", "+.3", "16777217", "1.00000017881393432617187499",
                                 "1.00000017881393432617187501"};
  while (words.size() % 9 != 0 || words.size() < 9000) {
    std::uint64_t draw = 0;
    const auto random = [&](std::uint64_t below) { return random_bits(11, words.size(), draw++) % below; };
    std::string word = random(2) ? "-" : "";
    word += std::to_string(random(random(2) ? 10 : 1000)) + ".";
    for (std::uint64_t digits = 1 + random(14); digits > 0; --digits) word += char('0' + random(10));
    if (random(4) == 0) word += (random(2) ? "e-" : "E+") + std::to_string(random(4));
    words.push_back(word);
  }
  const std::size_t corners = words.size() / 3, triangles = corners / 3;
  const auto corner = [&](std::size_t i) {
    return words[3 * i] + " " + words[3 * i + 1] + " " + words[3 * i + 2] + "\n";
  };
  std::string obj, off = fmt::format("OFF\n{} {} 0\n", corners, triangles), stl = "solid\n";
  std::string ply = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty double y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      corners, triangles);
  for (std::size_t i = 0; i < corners; ++i) obj += "v " + corner(i), off += corner(i), ply += corner(i);
  for (std::size_t t = 0; t < triangles; ++t) {
    const std::string face = fmt::format("3 {} {} {}\n", 3 * t, 3 * t + 1, 3 * t + 2);
    off += face, ply += face, obj += fmt::format("f {} {} {}\n", 3 * t + 1, 3 * t + 2, 3 * t + 3);
    stl += "facet normal 0 0 0\nouter loop\n";
    for (std::size_t k = 0; k < 3; ++k) stl += "vertex " + corner(3 * t + k);
    stl += "endloop\nendfacet\n";
  }
  const std::pair<const char*, std::string> files[] = {
      {"a.obj", obj}, {"a.ply", ply}, {"a.off", off}, {"a.stl", stl + "endsolid\n"}};
  for (const auto& [name, text] : files) {
    INFO(name);
    const Scene scene = load_file(folder.write(name, text));
    REQUIRE(scene.mesh.size() == triangles);
    std::size_t differ = 0;
    for (std::size_t i = 0; i < words.size(); ++i)
      differ += scene.mesh.corners(i / 9)[i / 3 % 3][i % 3] != std::strtof(words[i].c_str(), nullptr);
    CHECK(differ == 0);
  }

  // Of glTF the corners are binary; where nodes stand is text, read as doubles. The first corner of each node's pyramid
  // is (0, 0, 0).
  folder.write("part.bin", gltf_buffer());
  constexpr std::size_t kNodes = 900;
  const auto of = [&](std::size_t node) { return words.data() + 9 + 3 * node; };
  std::string nodes, names;
  for (std::size_t i = 0; i < kNodes; ++i) {
    const char* comma = i > 0 ? "," : "";
    nodes += fmt::format(R"({}{{"mesh":0,"translation":[{},{},{}]}})", comma, of(i)[0], of(i)[1], of(i)[2]);
    names += fmt::format("{}{}", comma, i);
  }
  std::string gltf = gltf_json(R"(,"uri":"part.bin")");
  const auto replace = [&](const std::string& from, const std::string& to) {
    gltf.replace(gltf.find(from), from.size(), to);
  };
  replace(R"("nodes":[0])", "\"nodes\":[" + names + "]"), replace(R"({"mesh":0})", nodes);
  const Scene scene = load_file(folder.write("a.gltf", gltf));
  REQUIRE(scene.mesh.size() == 4 * kNodes);
  std::size_t differ = 0;
  for (std::size_t i = 0; i < 3 * kNodes; ++i)
    differ += scene.mesh.corners(i / 3 * 4)[0][i % 3] != std::strtof(of(i / 3)[i % 3].c_str(), nullptr);
  CHECK(differ == 0);
}

TEST_CASE("OFF: comments, empty lines, every keyword, polygons of any size, and what stands behind a position") {
  const Folder folder;
  const auto load = [&](const std::string& text) { return load_file(folder.write("a.off", text)); };
  const std::string square = "0 0 0\n2 0 0\n2 2 0\n0 2 0\n4 0 1 2 3\n";
  for (const std::string& text : {
           "OFF\n4 1 0\n" + square,
           "OFF 4 1 4\n" + square,
           "OFF4 1 0\n" + square,
           "4 1 0\n" + square,
           "OFF\n4 1\n" + square,
           "OFF\n4\n1\n4\n" + square,
           "OFF\n4 1\n4\n" + square,
           "# a square\n\nOFF # text\n # of\n4 1 0 # counts\n" + square,
           std::string("\xef\xbb\xbfOFF\r\n4 1 0\r\n0 0 0\r\n2 0 0\r\n\r\n# half of it\r\n2 2 0\r\n0 2 0\r\n4 0 1 2 3"),
           std::string("OFF\r4 1 0\r0 0 0\r2 0 0\r2 2 0\r0 2 0\r4 0 1 2 3\r"),
           std::string("COFF\n4 1 0\n0 0 0 255 0 0 255\n\t2 0 0 9\n2 2 0# red\n0 2 0\n4 0 1 2 3 0.5 0.5 0.5 # grey\n"),
           std::string("STCN4OFF\n4 1 0\n0 0 0 1 7\n1 0 0 .5 7\n4 4 0 2 7\n0 2 0 1 7\n4 0 1 2 3\n"),
           std::string("nOFF\n2\n4 1 0\n0 0\n2 0\n2 2\n0 2\n4 0 1 2 3\n"),
           std::string("nOFF 3 4 1\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n4 0 1 2 3\n"),
       }) {
    INFO(text);
    const Scene scene = load(text);
    CHECK(scene.mesh.vertices == std::vector<Vec3f>{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}});
    CHECK(scene.mesh.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
    CHECK(scene.report.polygons_split == 1);
    CHECK(scene.report.warnings.empty());
  }
  std::string circle = "OFF\n100 1 0\n", face = "100";
  for (int i = 0; i < 100; ++i)
    circle += fmt::format("{:.6f} {:.6f} 0\n", std::cos(i * 0.0628), std::sin(i * 0.0628)),
        face += fmt::format(" {}", i);
  CHECK(load(circle + face + "\n").mesh.size() == 98);
  const std::string line = "OFF\n3 4 0\n0 0 0\n1 0 0\n0 1 0\n0\n1 2\n2 0 1\n3 0 1 2\n";
  CHECK(load(line).report.warnings ==
        std::vector<std::string>{(folder / "a.off").string() + ": 3 faces of fewer than three corners left out"});
  CHECK(load(line + "# the end\n\n").report.warnings.size() == 1);
  REQUIRE(load(line + "\n3 2 1 0\n").report.warnings.size() == 2);
  CHECK_THAT(load(line + "\n3 2 1 0\n").report.warnings[0],
             Catch::Contains("a.off:11: the header promises 3 vertices and 4 faces; what is from here on is left out"));
}

TEST_CASE("binary STL is told by its size, whatever its header says") {
  const Folder folder;
  check_pyramid(load_file(folder.write("a.stl", "solid pyramid" + stl_binary().substr(13))));
  // A vertex is as it stands in the file, to the last bit.
  std::string bytes = stl_binary();
  const float least = std::nextafter(1.0f, 2.0f);
  std::memcpy(bytes.data() + 84 + 12, &least, sizeof least);
  CHECK(load_file(folder.write("b.stl", bytes)).mesh.corners(0)[0].x == least);
}

TEST_CASE("node transforms of glTF are applied") {
  const Folder folder;
  folder.write("part.bin", gltf_buffer());
  check_pyramid(load_file(folder.write("a.gltf", gltf_json(R"(,"uri":"part.bin")", R"(,"translation":[10,20,30])"))),
                {10, 20, 30});
}

TEST_CASE("STL of text: a name may be any word, and the solid may end where it likes") {
  const Folder folder;
  const std::string stl = stl_ascii(), body = stl.substr(stl.find('\n'), stl.rfind("endsolid") - stl.find('\n'));
  for (const std::string end : {"endsolid vertex\n", "endsolid", "end solid"}) {
    INFO(end);
    check_pyramid(load_file(folder.write("a.stl", "solid vertex" + body + end)));
    std::string lines = "solid facet\n" + body + end;
    for (std::size_t at = 0; (at = lines.find('\n', at)) != std::string::npos; at += 2) lines.insert(at, "\r");
    check_pyramid(load_file(folder.write("a.stl", lines)));
    std::ranges::replace(lines, '\n', '\r');
    check_pyramid(load_file(folder.write("a.stl", lines)));
  }
  CHECK(load_file(folder.write("two.stl", stl + stl)).mesh.size() == 8);
}

TEST_CASE("OBJ, PLY: faces of too few corners are counted in words") {
  const Folder folder;
  const auto ply = [](const std::string& faces, std::size_t count) {
    std::string text = ply_ascii();
    return text.replace(text.find("face 4"), 6, "face " + std::to_string(4 + count)) + faces;
  };
  const struct {
    std::string file, text, says;
  } cases[] = {{"a.obj", obj_text() + "f 1 2\n", ": 1 face of fewer than three corners left out"},
               {"a.obj", obj_text() + "f 1 2\nf 3\n", ": 2 faces of fewer than three corners left out"},
               {"a.ply", ply("2 0 1\n", 1), ": 1 face of fewer than three corners left out"},
               {"a.ply", ply("2 0 1\n1 2\n", 2), ": 2 faces of fewer than three corners left out"}};
  for (const auto& c : cases) {
    const fs::path path = folder.write(c.file, c.text);
    const Scene scene = load_file(path);
    check_pyramid(scene);
    REQUIRE(scene.report.warnings.size() == 1);
    CHECK(scene.report.warnings[0] == path.string() + c.says);
  }
}

TEST_CASE("words for one line: UTF-8 stays, all else that does not print becomes a blank or '?'") {
  const std::pair<std::string, std::string> cases[] = {
      {"  a\t\n b \x7f", "a b"},
      {"ä€\xf0\x9f\x98\x80", "ä€\xf0\x9f\x98\x80"},
      {"\xff\xe4x", "??x"},                           // Latin-1
      {"\xc3", "?"},                                  // cut off
      {"\xc0\xaf \xe0\x80\xaf", "?? ???"},            // longer than need be
      {"\xed\xa0\x80 \xf4\x90\x80\x80", "??? ????"},  // a surrogate; beyond the last
      {"a\xc2\x9b"
       "2Jb",
       "a 2Jb"},  // a terminal's command
      {std::string(298, 'a') + "€", std::string(298, 'a') + "..."},
  };
  for (const auto& [text, line] : cases) CHECK(one_line(text) == line);
}

TEST_CASE("PLY: material ids, other properties, other element order of types") {
  const Folder folder;
  const Scene plain = load_file(folder.write("a.ply", ply_binary(false, true)));
  CHECK(plain.mesh.materials == std::vector<std::uint16_t>{0, 1, 0, 1});
  CHECK(plain.materials.size() == 2);
  folder.write("b.mtl", "newmtl first\nKd 1 0 0\nnewmtl second\nKd 0 1 0\n");
  const Scene named = load_file(folder.write("b.ply", ply_binary(true, true)));
  REQUIRE(named.materials.size() == 2);
  CHECK(named.materials[1].name == "second");
  const Scene odd =
      load_file(folder.write("c.ply",
                             "ply\nformat ascii 1.0\nelement thing 1\nproperty list uchar float values\nelement vertex "
                             "3\nproperty uchar red\nproperty double z\nproperty "
                             "double x\nproperty int y\nelement face 1\nproperty float quality\nproperty list uchar "
                             "uint vertex_index\nend_header\n2 0.5 1e3\n255 3 1 2\n0 6 4 5\n9 9 7 9\n0.1 3 0 1 2\n"));
  CHECK(odd.mesh.corners(0)[0] == Vec3f{1, 2, 3});
  CHECK(odd.mesh.corners(0)[2] == Vec3f{7, 9, 9});
}

TEST_CASE("PLY: faces index the first vertices, whatever other elements of that name promise") {
  const Folder folder;
  const std::string
      head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n",
      tail =
          "element face 1\nproperty list uchar int vertex_indices\nelement vertex 9\nproperty float x\nend_header\n0 0 "
          "0\n1 0 0\n0 1 0\n",
      rest = "\n0\n0\n0\n0\n0\n0\n0\n0\n0\n";
  CHECK(load_file(folder.write("right.ply", head + tail + "3 0 1 2" + rest)).mesh.size() == 1);
  CHECK_THROWS_WITH(load_file(folder.write("wrong.ply", head + tail + "3 0 1 8" + rest)),
                    Catch::Contains("vertex index 8 is out of range: there are 3 vertices"));
}

TEST_CASE("numbers beyond float's range are read alike in every locale") {
  const auto parsed = [](std::string_view text) {
    float value = 1.0f;
    CHECK(parse_float(text.data(), text.data() + text.size(), value) == text.data() + text.size());
    return value;
  };
  const char* names[] = {"C", "de_DE.UTF-8", "fr_FR.UTF-8", "C.UTF-8"};  // those that the machine lacks change nothing
  for (const char* name : names) {
    const std::string before = std::setlocale(LC_ALL, nullptr);
    std::setlocale(LC_ALL, name);
    CHECK(std::isinf(parsed("1.5e400")));
    CHECK(parsed("1.5e-400") == 0.0f);
    CHECK(parsed("1.5e-40") == 1.5e-40f);
    std::setlocale(LC_ALL, before.c_str());
  }
}

/// A GLB of this JSON alone.
std::string glb_of(const std::string& json) {
  const auto word = [](std::size_t n) {
    const auto value = std::uint32_t(n);
    return std::string(reinterpret_cast<const char*>(&value), sizeof value);
  };
  return "glTF" + word(2) + word(20 + json.size()) + word(json.size()) + "JSON" + json;
}

std::string gltf_chain(std::size_t nodes) {
  std::string json = R"({"nodes":[{})";
  for (std::size_t i = 0; i + 1 < nodes; ++i) json += R"(,{"children":[)" + std::to_string(i) + "]}";
  return json + "]}";
}

/// Assimp's own dump of two triangles, a mesh each, of the materials with these numbers, and of two materials.
std::string assbin_of(std::uint32_t first, std::uint32_t second) {
  const auto numbers = [](std::string& s, std::initializer_list<std::uint32_t> all) {
    for (const std::uint32_t number : all) put(s, number, false);
  };
  const auto chunk = [&](std::uint32_t kind, const std::string& bytes) {
    std::string s;
    numbers(s, {kind, std::uint32_t(bytes.size())});
    return s + bytes;
  };
  std::string node, scene, s = "ASSIMP.binary-dump.";
  numbers(node, {0});  // no name
  for (int i = 0; i < 16; ++i) put(node, i % 5 == 0 ? 1.0f : 0.0f, false);
  numbers(node, {0, 2, 0, 0, 1});  // children, meshes, metadata; which meshes
  numbers(scene, {0, 2, 2, 0, 0, 0, 0});
  scene += chunk(0x123c, node);
  for (const std::uint32_t material : {first, second}) {
    std::string mesh;
    numbers(mesh, {4, 3, 1, 0, material, 1});  // triangles: 3 vertices, 1 face, no bones; positions alone
    for (const float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) put(mesh, x, false);
    for (const int x : {3, 0, 1, 2}) put(mesh, std::uint16_t(x), false);
    scene += chunk(0x1237, mesh);
  }
  for (int i = 0; i < 2; ++i) scene += chunk(0x123d, std::string(4, '\0'));
  s.resize(44), numbers(s, {1, 0, 0, 0}), s.resize(512);
  return s + chunk(0x1239, scene);
}

TEST_CASE("a mesh of a material that is not there has the first, and later ones keep theirs") {
  const Folder folder;
  using Ids = std::vector<std::uint16_t>;
  CHECK(load_file(folder.write("good.assbin", assbin_of(1, 0))).mesh.materials == Ids{1, 0});
  CHECK(load_file(folder.write("first.assbin", assbin_of(7, 1))).mesh.materials == Ids{0, 1});
  CHECK(load_file(folder.write("last.assbin", assbin_of(1, 7))).mesh.materials == Ids{1, 0});
}

TEST_CASE("bad files: one clear line each, that says what and where") {
  const Folder folder;
  const std::string ply = ply_binary(false, false);
  const struct {
    const char* name;
    std::string bytes;
    const char* says;
  } cases[] = {
      {"empty.obj", "", "the file is empty"},
      {"empty.ply", "", "the file is empty"},
      {"empty.stl", "", "the file is empty"},
      {"empty.yaml", "", "the file is empty"},
      {"range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n", "range.obj:5: face index 4 is out of range"},
      {"negative.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf -1 -2 -4\n",
       "negative.obj:5: face index -4 is out of range"},
      {"zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "zero.obj:4: face index 0 is out of range"},
      {"wrap.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4294967299\n",
       "wrap.obj:4: face index 4294967299 is out of range"},
      {"word.obj", "v 0 0 0\nv 1 zero 0\n", "word.obj:2: vertex 2 has no number for y"},
      {"points.obj", "v 0 0 0\nv 1 0 0\n", "no face in it (2 vertices)"},
      {"text.obj", "this is no model\n", "no face in it"},
      {"magic.ply", "plx\n", "does not begin with 'ply'"},
      {"header.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "no 'end_header'"},
      {"type.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\nend_header\n",
       "type.ply:4: unknown property type 'real'"},
      {"format.ply", "ply\nformat binary 1.0\nend_header\n", "format.ply:2: unknown format 'binary'"},
      {"cut.ply", ply.substr(0, ply.size() - 5), "face 3 of 4: truncated"},
      {"cut2.ply", ply.substr(0, ply.size() - 60), "truncated"},
      {"huge.ply",
       "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float "
       "y\nproperty float z\nend_header\nabc",
       "more than the file can hold"},
      {"cloud.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
       "z\nend_header\n0 0 0\n",
       "point cloud"},
      {"range.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
       "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 "
       "3\n",
       "face 0 of 1: vertex index 3 is out of range"},
      {"word.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
       "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0x 0\n0 1 0\n3 0 1 "
       "2\n",
       "vertex 1 of 3: '0x' is not a number"},
      {"cut.stl", stl_binary().substr(0, 200),
       "as a binary STL its header promises 4 triangles, 284 bytes in all, and it has 200"},
      {"solid.stl", "solid" + stl_binary().substr(5, 195), "284 bytes in all, and it has 200"},
      {"long.stl", stl_binary() + "x", "284 bytes in all, and it has 285"},
      {"neither.stl", "a mesh", "no STL: neither text that begins with 'solid' nor a binary file"},
      {"short.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 0\nvertex 1 0 0\n",
       "short.stl:4: 'vertex' has no number for z; write 'vertex x y z'"},
      {"word.stl", "solid a\r\nfacet normal 0 0 1\r\nouter loop\r\nvertex 1 0,5 0\r\n",
       "word.stl:4: 'vertex' has no number for y but '0,5'; write 'vertex x y z'"},
      {"normal.stl", "solid a\nfacet normal up\n", "normal.stl:2: 'normal' has no number for x but 'up'"},
      {"two.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n",
       "two.stl:7: a facet of 2 corners"},
      {"open.stl", "solid a\nfacet normal 0 0 1\nouter loop\n", "the facet of line 2 has no 'endfacet'"},
      {"cut_text.stl", stl_ascii().substr(0, stl_ascii().rfind("facet normal")), "broken or truncated"},
      {"cut_word.stl", stl_ascii().substr(0, stl_ascii().rfind("endsolid")), "broken or truncated"},
      {"decimal.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1.7 2 3\n", "decimal.obj:4: '1.7' is no corner of a face"},
      {"early.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
       "early.obj:1: face index 1 is out of range: no vertex precedes it"},
      {"later.obj", "v 0 0 0 \\\n\nv 1 0 \\\r\n0\nv 0 1 0\nf 1 2 \\\n4\n", "later.obj:6: face index 4 is out of range"},
      {"nested.stl", "solid a\nfacet\nvertex 0 0 0\nfacet\n",
       "nested.stl:4: a facet begins, and that of line 2 has no"},
      {"outside.stl", "solid a\nvertex 0 0 0\n", "outside.stl:2: a 'vertex' outside of 'facet' and 'endfacet'"},
      {"twice.stl", "solid a\rfacet\r\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendfacet\nendsolid\n",
       "twice.stl:7: an 'endfacet' without its 'facet'"},
      {"none.stl", "solid a\nendsolid\n", "none.stl: no triangle in it"},
      {"nothing.stl", std::string(84, '\0'), "nothing.stl: no triangle in it"},
      {"cut.off", off_text().substr(0, 60),
       "cut.off: broken or truncated: 2 vertices of the 5 that the header promises"},
      {"blank.off", "# nothing\n\n", "nothing in it but blanks and comments"},
      {"word.off", "off\n3 1 0\n", "word.off:1: the number of vertices is 'off'; write 'OFF', then how many"},
      {"counts.off", "OFF\n3\n", "the number of faces is missing behind the keyword OFF"},
      {"four.off", "OFF\n3 1 0 0 0 0\n1 0 0\n", "four.off:2: no three counts"},
      {"negative.off", "OFF\n-3 1 0\n", "negative.off:2: the number of vertices is '-3'"},
      {"dimension.off", "nOFF\n4\n3 1 0\n", "dimension.off:2: 4 coordinates a vertex; up to 3 are read"},
      {"binary.off", "OFF BINARY\n\1\2\3", "binary.off:1: a binary OFF, which is not read; save it as text"},
      {"comma.off", "OFF\n3 1 0\n\n0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n",
       "comma.off:5: vertex 1 has no number for y but '0,5'"},
      {"plane.off", "OFF\r\n3 1 0\r\n0 0 0\r\n1 0\r\n0 1 0\r\n3 0 1 2\r\n",
       "plane.off:4: vertex 1 has no number for z; write a vertex a line"},
      {"minus.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "minus.off:6: face 0: '-1' is no vertex index"},
      {"points.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "points.off: no triangle in it"},
      {"range.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
       "range.off:6: face 0: vertex index 7 is out of range: there are 3 vertices"},
      {"indices.off", "OFF4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 5\n95\n95\n95\n",
       "indices.off:6: face 0 has 0 corners of the 95 that it promises"},
      {"few.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 1\n3 0 1\n4 0 1 3 2\n", "face 0 has 2 corners of the 3"},
      {"none.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\nx\n3 0 1 2\n", "face 0 does not begin with its number of corners"},
      {"missing.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "1 faces of the 2 that the header promises"},
      {"deep.gltf", std::string(200000, '['), "more than 100 brackets in each other"},
      {"deep.glb", glb_of(std::string(200000, '[')), "more than 100 brackets in each other"},
      {"extras.gltf", R"({"nodes":[{"extras":)" + std::string(200000, '['), "more than 100 brackets in each other"},
      {"chain.gltf", gltf_chain(20000), "nodes more than 1000 levels deep"},
      {"parents.gltf", R"({"nodes":[{"children":[1,1]},{"children":[2]},{}]})",
       "node 1 is a child of node 0 and again of node 0"},
      {"cycle.gltf", R"({"nodes":[{},{"children":[2]},{"children":[1]}]})", "node 1 is below itself"},
      {"child.gltf", R"({"nodes":[{"children":[7]}]})", "node 0 names child 7, and there is 1 node"},
      {"ids.gltf", R"({"nodes":{"a":{"children":["b"]},"b":{"children":["a"]}}})", "is below itself"},
      {"latin1.gltf", "{\"asset\": \"\xe9\", \"nodes\": [{\"children\": [0]}]}", "node 0 is below itself"},
      {"cut.gltf", "{\n\"nodes\":[{\"children\":[",
       "broken or truncated: line 2 of its JSON: unexpected end of input; expected"},
      {"cut.glb", glb_bytes().substr(0, 100), "broken or truncated"},
      {"huge.off", "OFF\n999999999 4 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
       "999999999 vertices and 4 faces, more than the file can hold"},
      {"chunk.glb", std::string("glTF\2\0\0\0\30\0\0\0\xff\xff\xff\x7fJSON{}  ", 24),
       "a chunk of the GLB is longer than the file"},
      {"nobin.gltf", gltf_json(R"(,"uri":"not-there.bin")"),
       "it refers to 'not-there.bin', and there is no such file beside it"},
      {"model.xyz123", "0 0 0\n", "unknown kind of file '.xyz123'"},
      {"noextension", "0 0 0\n", "unknown kind of file ''"},
      {"flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n",
       "no triangle left: of 2 read, 1 are not finite, 0 out of range, 1 of zero area"},
  };
  for (const auto& c : cases) {
    INFO(c.name);
    const fs::path path = folder.write(c.name, c.bytes);
    const std::string line = error_of([&] { (void)load_file(path); });
    CHECK_THAT(line, Catch::Contains(c.says) && Catch::Contains(c.name) && !Catch::Contains("exception"));
  }
  for (const char* extension : {".obj", ".ply", ".stl", ".gltf", ".yaml"}) {
    CHECK_THAT(error_of([&] { (void)load_file(folder.path() / (std::string("missing") + extension)); }),
               Catch::Contains("no such file"));
    fs::create_directory(folder.path() / (std::string("folder") + extension));
    CHECK_THAT(error_of([&] { (void)load_file(folder.path() / (std::string("folder") + extension)); }),
               Catch::Contains("is a directory"));
  }
  for (const char* name : {"pipe.obj", "pipe.ply", "pipe.stl", "pipe.yaml"}) {
    REQUIRE(::mkfifo((folder.path() / name).c_str(), 0600) == 0);
    CHECK_THAT(error_of([&] { (void)load_file(folder.path() / name); }), Catch::Contains("is a pipe or a device"));
  }
  if (::geteuid() != 0) {  // root reads everything
    const fs::path locked = folder.write("locked.obj", obj_text());
    fs::permissions(locked, fs::perms::none);
    CHECK_THAT(error_of([&] { (void)load_file(locked); }), Catch::Contains("cannot be read"));
  }
}

TEST_CASE("damaged bytes in any format end in an error or a usable scene, never in a crash") {
  const Folder folder;
  folder.write("part.bin", gltf_buffer());
  const std::pair<const char*, std::string> files[] = {
      {"f.obj", obj_text()},
      {"f.ply", ply_ascii()},
      {"g.ply", ply_binary(false, true)},
      {"f.stl", stl_ascii()},
      {"g.stl", stl_binary()},
      {"f.off", off_text()},
      {"f.gltf", gltf_json(R"(,"uri":"part.bin")")},
      {"f.glb", glb_bytes()},
      {"f.yaml", "meshes: [f.obj]\ncamera: {position: [1, 2, 3], look_at: [0, 0, 0]}\nshutter: [0, 1]\n"}};
  for (const auto& [name, bytes] : files) {
    int errors = 0;
    for (std::uint64_t n = 0; n < 60; ++n) {
      std::string damaged = bytes;
      std::uint64_t draw = 0;
      const auto random = [&](std::size_t below) { return std::size_t(random_bits(3, n, draw++) % below); };
      if (n % 3 == 0) damaged.resize(random(damaged.size()));
      if (n % 3 == 1)
        for (char& c : damaged) c = char(random(256));
      if (n % 3 == 2)
        for (int i = 0; i < 6; ++i) damaged[random(damaged.size())] = char(random(256));
      INFO(name << " case " << n);
      errors += !error_of([&, &name = name] {
                   const Scene scene = load_file(folder.write(name, damaged));
                   REQUIRE(scene.mesh.size() > 0);
                   for (const Triangle& t : scene.mesh.triangles)
                     REQUIRE(std::max({t.a, t.b, t.c}) < scene.mesh.vertices.size());
                 }).empty();
    }
    CHECK(errors > 10);
  }
}
