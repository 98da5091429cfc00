// Readers, scene files, sanitising, catalogue, effects, inspection. Every file is written by the test.
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "core/error.h"
#include "core/random.h"
#include "scenes/catalogue.h"
#include "scenes/effects.h"
#include "scenes/inspect.h"
#include "scenes/polygon.h"
#include "scenes/sanitise.h"
#include "scenes/scene.h"
#include "tests/catch.h"

using namespace arboretum;
namespace fs = std::filesystem;

namespace {

/// A folder for one test case's files, removed at its end.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "arboretum-scenes-XXXXXX").string();
    REQUIRE(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Scene load_file(const fs::path& path) {
  SceneSpec spec;
  (path.extension() == ".yaml" ? spec.scene : spec.file) = path;
  return load_scene(spec);
}

/// The error's line; fails the test where there is none, or it is more than one line.
std::string error_of(const auto& action) {
  try {
    action();
  } catch (const UserError& error) {
    const std::string line = error.what();
    CHECK(line.find('\n') == std::string::npos);
    return line;
  }
  FAIL("no UserError");
  return {};
}

template <class T>
void put(std::string& out, T value, bool big_endian) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (big_endian) std::reverse(raw, raw + sizeof(T));
  out.append(raw, sizeof(T));
}

// A pyramid without its base: five corners, four triangles.
constexpr float kCorners[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}};
constexpr int kFaces[4][3] = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};

std::string obj_text() {
  std::string s = "# a pyramid\n";
  for (const auto& v : kCorners) s += "v " + std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces) s += "f " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) + "\n";
  return s;
}

std::string ply_header(const std::string& format, const std::string& face_extra = "") {
  return "ply\nformat " + format + " 1.0\ncomment written by a test\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 4\nproperty list uchar int vertex_indices\n" + face_extra + "end_header\n";
}

std::string ply_binary(bool big_endian, bool with_materials) {
  std::string s = ply_header(big_endian ? "binary_big_endian" : "binary_little_endian", with_materials ? "property ushort material_id\n" : "");
  for (const auto& v : kCorners)
    for (const float x : v) put(s, x, big_endian);
  for (int i = 0; i < 4; ++i) {
    put(s, std::uint8_t(3), big_endian);
    for (const int x : kFaces[i]) put(s, std::int32_t(x), big_endian);
    if (with_materials) put(s, std::uint16_t(i % 2), big_endian);
  }
  return s;
}

std::string ply_ascii() {
  std::string s = ply_header("ascii");
  for (const auto& v : kCorners) s += std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces) s += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  return s;
}

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

std::string stl_ascii() {
  std::string s = "solid pyramid\n";
  for (const auto& f : kFaces) {
    s += "facet normal 0 0 0\nouter loop\n";
    for (const int i : f) s += "vertex " + std::to_string(kCorners[i][0]) + " " + std::to_string(kCorners[i][1]) + " " + std::to_string(kCorners[i][2]) + "\n";
    s += "endloop\nendfacet\n";
  }
  return s + "endsolid pyramid\n";
}

std::string off_text() {
  std::string s = "OFF\n5 4 0\n";
  for (const auto& v : kCorners) s += std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces) s += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
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
         R"("buffers":[{"byteLength":84)" + buffer_member + "}]}";
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

void check_pyramid(const Scene& scene, Vec3f moved = {0, 0, 0}) {
  REQUIRE(scene.mesh.size() == 4);
  CHECK(scene.report.triangles_read == 4);
  CHECK(scene.materials.size() >= 1);
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const float* p = kCorners[kFaces[i][k]];
      CHECK(scene.mesh.corners(i)[k] == Vec3f{p[0], p[1], p[2]} + moved);
    }
}

}  // namespace

TEST_CASE("every format gives the same triangles in the same order") {
  const Folder folder;
  folder.write("part.bin", gltf_buffer());
  const std::pair<const char*, std::string> files[] = {
      {"a.obj", obj_text()},         {"ascii.ply", ply_ascii()},       {"little.ply", ply_binary(false, false)},
      {"big.ply", ply_binary(true, false)}, {"ascii.stl", stl_ascii()}, {"binary.stl", stl_binary()},
      {"a.off", off_text()},         {"a.gltf", gltf_json(R"(,"uri":"part.bin")")}, {"a.glb", glb_bytes()}};
  for (const auto& [name, bytes] : files) {
    INFO(name);
    check_pyramid(load_file(folder.write(name, bytes)));
  }
}

TEST_CASE("node transforms of glTF are applied") {
  const Folder folder;
  folder.write("part.bin", gltf_buffer());
  check_pyramid(load_file(folder.write("a.gltf", gltf_json(R"(,"uri":"part.bin")", R"(,"translation":[10,20,30])"))), {10, 20, 30});
}

TEST_CASE("OBJ: polygons, negative indices, materials, line ends, exact decimals") {
  const Folder folder;
  folder.write("m.mtl", "newmtl glass\nKs 1 1 1\nNi 1.5\nTf 0.9 0.8 0.7\nillum 7\nNs 12\n\nnewmtl lamp\nKd 0.1 0.2 0.3\nKe 5 6 7\nPr 0.25\nd 0.5\nmap_Kd wood.png\nmap_d leaf.png\n");
  const Scene scene = load_file(folder.write("a.obj",
      "mtllib m.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3\r\nusemtl lamp\r\nf 1/1/1 2/2/2 3//3 4\r\nusemtl glass\r\n"
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

TEST_CASE("PLY: material ids, other properties, other element order of types") {
  const Folder folder;
  const Scene plain = load_file(folder.write("a.ply", ply_binary(false, true)));
  CHECK(plain.mesh.materials == std::vector<std::uint16_t>{0, 1, 0, 1});
  CHECK(plain.materials.size() == 2);
  folder.write("b.mtl", "newmtl first\nKd 1 0 0\nnewmtl second\nKd 0 1 0\n");
  const Scene named = load_file(folder.write("b.ply", ply_binary(true, true)));
  REQUIRE(named.materials.size() == 2);
  CHECK(named.materials[1].name == "second");
  const Scene odd = load_file(folder.write("c.ply",
      "ply\nformat ascii 1.0\nelement thing 1\nproperty list uchar float values\nelement vertex 3\nproperty uchar red\nproperty double z\nproperty "
      "double x\nproperty int y\nelement face 1\nproperty float quality\nproperty list uchar uint vertex_index\nend_header\n2 0.5 1e3\n255 3 1 2\n0 6 4 5\n9 9 7 9\n0.1 3 0 1 2\n"));
  CHECK(odd.mesh.corners(0)[0] == Vec3f{1, 2, 3});
  CHECK(odd.mesh.corners(0)[2] == Vec3f{7, 9, 9});
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
      {"negative.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf -1 -2 -4\n", "negative.obj:5: face index -4 is out of range"},
      {"zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "zero.obj:4: face index 0 is out of range"},
      {"wrap.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4294967299\n", "wrap.obj:4: a face index is out of range"},
      {"word.obj", "v 0 0 0\nv 1 zero 0\n", "word.obj:2: vertex 2 has no number for y"},
      {"points.obj", "v 0 0 0\nv 1 0 0\n", "no face in it (2 vertices)"},
      {"text.obj", "this is no model\n", "no face in it"},
      {"magic.ply", "plx\n", "does not begin with 'ply'"},
      {"header.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "no 'end_header'"},
      {"type.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\nend_header\n", "type.ply:4: unknown property type 'real'"},
      {"format.ply", "ply\nformat binary 1.0\nend_header\n", "format.ply:2: unknown format 'binary'"},
      {"cut.ply", ply.substr(0, ply.size() - 5), "face 3 of 4: truncated"},
      {"cut2.ply", ply.substr(0, ply.size() - 60), "truncated"},
      {"huge.ply", "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\nabc", "more than the file can hold"},
      {"cloud.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n", "point cloud"},
      {"range.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "face 0 of 1: vertex index 3 is out of range"},
      {"word.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0x 0\n0 1 0\n3 0 1 2\n", "vertex 1 of 3: '0x' is not a number"},
      {"cut.stl", stl_binary().substr(0, 200), "broken or truncated"},
      {"cut.off", off_text().substr(0, 60), "cut.off"},
      {"range.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "range"},
      {"cut.glb", glb_bytes().substr(0, 100), "broken or truncated"},
      {"huge.off", "OFF\n999999999 4 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "999999999 vertices and 4 faces, more than the file can hold"},
      {"chunk.glb", std::string("glTF\2\0\0\0\30\0\0\0\xff\xff\xff\x7fJSON{}  ", 24), "a chunk of the GLB is longer than the file"},
      {"nobin.gltf", gltf_json(R"(,"uri":"not-there.bin")"), "broken or truncated"},
      {"model.xyz123", "0 0 0\n", "unknown kind of file '.xyz123'"},
      {"noextension", "0 0 0\n", "unknown kind of file ''"},
      {"flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n", "no triangle left: of 2 read, 1 are not finite, 0 out of range, 1 of zero area"},
  };
  for (const auto& c : cases) {
    INFO(c.name);
    const fs::path path = folder.write(c.name, c.bytes);
    const std::string line = error_of([&] { (void)load_file(path); });
    CHECK_THAT(line, Catch::Contains(c.says) && Catch::Contains(c.name));
  }
  for (const char* extension : {".obj", ".ply", ".stl", ".gltf", ".yaml"}) {
    CHECK_THAT(error_of([&] { (void)load_file(folder.path() / (std::string("missing") + extension)); }), Catch::Contains("no such file"));
    fs::create_directory(folder.path() / (std::string("folder") + extension));
    CHECK_THAT(error_of([&] { (void)load_file(folder.path() / (std::string("folder") + extension)); }), Catch::Contains("is a directory"));
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
      {"f.obj", obj_text()}, {"f.ply", ply_ascii()}, {"g.ply", ply_binary(false, true)}, {"f.stl", stl_ascii()}, {"g.stl", stl_binary()},
      {"f.off", off_text()}, {"f.gltf", gltf_json(R"(,"uri":"part.bin")")}, {"f.glb", glb_bytes()},
      {"f.yaml", "meshes: [f.obj]\ncamera: {position: [1, 2, 3], look_at: [0, 0, 0]}\nshutter: [0, 1]\n"}};
  for (const auto& [name, bytes] : files) {
    int errors = 0;
    for (std::uint64_t n = 0; n < 60; ++n) {
      std::string damaged = bytes;
      std::uint64_t draw = 0;
      const auto random = [&](std::size_t below) { return std::size_t(random_bits(3, n, draw++) % below); };
      if (n % 3 == 0) damaged.resize(random(damaged.size()));
      if (n % 3 == 1) for (char& c : damaged) c = char(random(256));
      if (n % 3 == 2) for (int i = 0; i < 6; ++i) damaged[random(damaged.size())] = char(random(256));
      INFO(name << " case " << n);
      try {
        const Scene scene = load_file(folder.write(name, damaged));
        REQUIRE(scene.mesh.size() > 0);
        for (const Triangle& t : scene.mesh.triangles) REQUIRE(std::max({t.a, t.b, t.c}) < scene.mesh.vertices.size());
      } catch (const UserError& error) {
        ++errors;
        CHECK(std::string(error.what()).find('\n') == std::string::npos);
      }
    }
    CHECK(errors > 10);
  }
}

TEST_CASE("sanitising drops and counts, and keeps the order of the rest") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  Scene scene;
  scene.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {nan, 0, 0}, {0, inf, 0}, {2e12f, 0, 0}, {2, 0, 0}, {kMaxCoordinate, 0, 1}};
  scene.mesh.triangles = {{0, 1, 3}, {0, 1, 2}, {0, 4, 2}, {0, 5, 2}, {0, 1, 6}, {0, 0, 2}, {2, 1, 7}};
  scene.mesh.materials = {0, 1, 0, 0, 0, 0, 1};
  scene.materials.resize(2);
  sanitise(scene, "test");
  CHECK(scene.mesh.triangles == std::vector<Triangle>{{0, 1, 2}, {2, 1, 7}});
  CHECK(scene.mesh.materials == std::vector<std::uint16_t>{1, 1});
  CHECK(scene.report.triangles_read == 7);
  CHECK(scene.report.non_finite == 2);
  CHECK(scene.report.out_of_range == 1);
  CHECK(scene.report.degenerate == 2);
  for (const Vec3f& v : scene.mesh.vertices) CHECK(is_finite(v));
}

TEST_CASE("zero area is decided exactly") {
  const float one_up = std::nextafter(1.0f, 2.0f), tiny = 1e-45f;
  const struct {
    Vec3f a, b, c;
    bool zero;
  } cases[] = {
      {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, false},
      {{0, 0, 0}, {1, 1, 1}, {3, 3, 3}, true},
      {{0, 0, 0}, {1, 1, 1}, {3, 3, std::nextafter(3.0f, 4.0f)}, false},
      {{0.1f, 0.1f, 0.1f}, {0.2f, 0.2f, 0.2f}, {0.3f, 0.3f, 0.3f}, true},    // on x = y = z, whatever rounding did to them
      {{0.1f, 0.2f, 0.3f}, {0.2f, 0.4f, 0.6f}, {0.4f, 0.8f, 1.2f}, true},    // multiples by powers of two
      {{1, 1, 0}, {one_up, one_up, 0}, {1, one_up, 0}, false},
      {{0, 0, 0}, {tiny, 0, 0}, {0, tiny, 0}, false},                        // area 1e-90
      {{kMaxCoordinate, 0, 0}, {kMaxCoordinate, tiny, 0}, {0, 0, 0}, false},  // the difference is not a double
      {{kMaxCoordinate, tiny, 0}, {0, tiny, 0}, {-1, tiny, 0}, true},
      {{1, 2, 3}, {1, 2, 3}, {4, 5, 6}, true},
      {{0, 0, 0}, {-0.0f, 0, 0}, {1, 1, 1}, true},
  };
  for (const auto& t : cases) {
    CAPTURE(t.b.x, t.c.z);
    CHECK(has_zero_area(t.a, t.b, t.c) == t.zero);
    CHECK(has_zero_area(t.c, t.a, t.b) == t.zero);
    CHECK(has_zero_area(t.b, t.a, t.c) == t.zero);
  }
}

TEST_CASE("polygons: any simple one is covered exactly once") {
  const std::vector<std::vector<std::array<float, 2>>> polygons{
      {{0, 0}, {1, 0}, {1, 1}, {0, 1}},
      {{0, 0}, {4, 0}, {4, 4}, {3, 1}},                                       // concave quad, either diagonal but one fails
      {{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}},                               // collinear corners
      {{0, 0}, {5, 0}, {5, 5}, {4, 5}, {4, 1}, {3, 1}, {3, 5}, {2, 5}, {2, 1}, {1, 1}, {1, 5}, {0, 5}},  // a comb
  };
  for (const auto& polygon : polygons) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool reversed : {false, true}) {
        std::vector<Vec3f> vertices;
        std::vector<std::uint32_t> corners;
        double area = 0.0;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
          const auto& p = polygon[reversed ? polygon.size() - 1 - i : i];
          const auto& q = polygon[(i + 1) % polygon.size()];
          area += 0.5 * (double(polygon[i][0]) * q[1] - double(q[0]) * polygon[i][1]);
          Vec3f v;
          v[std::size_t(axis)] = p[0], v[std::size_t((axis + 1) % 3)] = p[1], v[std::size_t((axis + 2) % 3)] = 7;
          vertices.push_back(v);
          corners.push_back(std::uint32_t(i));
        }
        std::vector<Triangle> triangles;
        triangulate(corners, vertices, triangles);
        CHECK(triangles.size() == polygon.size() - 2);
        double covered = 0.0;
        for (const Triangle& t : triangles) covered += 0.5 * length(cross(vertices[t.b] - vertices[t.a], vertices[t.c] - vertices[t.a]));
        CHECK(covered == Approx(area));
      }
    }
  }
}

TEST_CASE("scene files: everything that they may hold") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  folder.write("b.ply", ply_binary(false, true));
  const Scene scene = load_file(folder.write("s.yaml",
      "name: two things\nsource: a test\nmeshes: [a.obj, {file: b.ply, name: other}]\n"
      "camera: {position: [0, 1, 5], look_at: [0, 0, 0], up: [0, 1, 0], vertical_fov: 50, mirror_x: true, resolution: [320, 200], aperture_radius: 0.5, focus_distance: 4}\n"
      "shutter: [0.25, 1]\nenvironment: {radiance: [0.5, 1, 2]}\n"
      "lights:\n  - {type: point, position: [1, 2, 3], intensity: 7}\n  - {type: directional, direction: [0, -1, 0]}\n"
      "  - {type: spot, position: [0, 3, 0], direction: [0, -1, 0], cone_degrees: 30, intensity: [1, 2, 3]}\n"
      "instances:\n  - mesh: other\n    transforms:\n      - [1, 0, 0, 10,  0, 1, 0, 20,  0, 0, 1, 30,  0, 0, 0, 1]\n"
      "      - {translate: [0, 0, 5], rotate: {axis: [0, 0, 1], degrees: 90}, scale: 2}\n"));
  REQUIRE(scene.mesh.size() == 12);
  CHECK(scene.name == "s");
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

TEST_CASE("scene files: key frames take the first, and must fit together") {
  const Folder folder;
  folder.write("a.obj", obj_text());
  folder.write("b.obj", obj_text());
  folder.write("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Scene scene = load_file(folder.write("s.yaml", "meshes: [{keyframes: [a.obj, b.obj]}]\nshutter: [0, 1]\n"));
  CHECK(scene.mesh.size() == 4);
  CHECK(scene.key_frames == 2);
  CHECK(scene.report.warnings.size() == 1);
  CHECK_THAT(error_of([&] { (void)load_file(folder.write("t.yaml", "meshes: [{keyframes: [a.obj, c.obj]}]\n")); }), Catch::Contains("t.yaml:1: key frame 'c.obj' has other triangles"));
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
      {"meshes: [a.obj\n", ":2:"},
      {"meshes:\n\t- a.obj\n", ":2:"},
      {"meshes: [a.obj]\nmeshes: [a.obj]\n", ":2: the scene names 'meshes' twice"},
      {"meshes: [b.obj]\n", "b.obj: no such file"},
      {"meshes: [{path: a.obj}]\n", ":1: unknown key of a mesh 'path'"},
      {"meshes: [a.obj]\ncamera:\n  position: [0, 0, 1]\n  lookat: [0, 0, 0]\n", ":4: unknown key of camera 'lookat'; did you mean 'look_at'?"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1]}\n", ":2: camera needs 'look_at'"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 1]}\n", ":2: camera position and look_at are the same point"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0]}\n", ":2: camera look_at must be a list of three numbers"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, x, 0]}\n", ":2: camera look_at must be a finite number, not 'x'"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, .nan], look_at: [0, 1, 0]}\n", ":2: camera position must be a finite number"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], up: [0, 0, 1]}\n", ":2: camera up is zero or parallel"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], vertical_fov: 180}\n", ":2: camera vertical_fov must lie between"},
      {"meshes: [a.obj]\ncamera: {position: [0, 0, 1], look_at: [0, 0, 0], resolution: [0, 10]}\n", ":2: camera width must be a whole number"},
      {"meshes: [a.obj]\nlights: [{type: pint, position: [0, 0, 0]}]\n", ":2: unknown light type 'pint'; did you mean 'point'?"},
      {"meshes: [a.obj]\nlights: [{type: point, direction: [0, 0, 1]}]\n", ":2: unknown key of a point light 'direction'"},
      {"meshes: [a.obj]\nlights: [{position: [0, 0, 1]}]\n", ":2: a light needs 'type'"},
      {"meshes: [a.obj]\nlights: [{type: point, position: [0, 0, 0], intensity: -1}]\n", ":2: a light's intensity must not be negative"},
      {"meshes: [a.obj]\nenvironment: {radiance: 1, image: x.hdr}\n", ":2: environment needs either"},
      {"meshes: [a.obj]\nenvironment: {image: x.hdr}\n", "x.hdr: no such file"},
      {"meshes: [a.obj]\nenvironment: {image: a.obj}\n", "a.obj: no image that can be read"},
      {"meshes: [a.obj]\nshutter: [1, 0]\n", ":2: the shutter closes before it opens"},
      {"meshes: [a.obj]\ninstances: [{mesh: b, transforms: [{scale: 1}]}]\n", ":2: unknown mesh 'b'; did you mean 'a'?"},
      {"meshes: [a.obj]\ninstances: [{mesh: 1, transforms: [{scale: 1}]}]\n", ":2: mesh 1 does not exist"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [{scale: 0}]}]\n", ":2: a transform flattens its mesh"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [[1, 2, 3]]}]\n", ":2: a transform has 16 numbers"},
      {"meshes: [a.obj]\ninstances: [{mesh: a, transforms: [{rotation: 1}]}]\n", ":2: unknown key of a transform 'rotation'; did you mean 'rotate'?"},
  };
  for (const auto& [text, says] : cases) {
    INFO(text);
    CHECK_THAT(error_of([&] { (void)load_file(folder.write("s.yaml", text)); }), Catch::Contains(says));
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
  CHECK(generated == 8);
  CHECK(find_catalogue_entry("bunny").triangles == 69666);
  CHECK(find_catalogue_entry("dragon").triangles == 871414);

  const Folder folder;
  const fs::path list = folder.write("list.yaml",
      "scenes: [{name: thing, description: d, package: {debian: thing-data}, file: " + (folder.path() / "thing.obj").string() + ", licence: free, triangles: 4}]\n");
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
  const Scene scene = load_file(folder.write("a.obj",
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 4 2 1\nv 5 0 0\nv 9 0 0\nv 7 0.001 0\nf 5 6 7\nf 5 6 6\n"));
  const SceneInfo info = inspect_scene(scene);
  CHECK(info.triangles == 6);
  CHECK(info.report.degenerate == 1);
  CHECK(info.duplicates == 1);
  CHECK(info.slivers == 1);
  CHECK(info.boundary_edges == 3);
  CHECK(info.non_manifold_edges == 3);
  CHECK_FALSE(info.closed);
  CHECK(inspect_scene(load_file(folder.write("b.stl", stl_ascii()))).boundary_edges == 4);  // vertices joined by position
  const Scene sphere = load_scene(parse_scene_word("sphere:500"));
  CHECK(inspect_scene(sphere).closed);
  CHECK(inspect_scene(sphere).edges == 750);
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

  // Maps count only where they hold more than one value. Three-pixel images in the plainest format that there is (PGM, PPM).
  const Folder folder;
  const std::string varied = folder.write("varied.ppm", "P6 3 1 255\n" + std::string("\xff\xff\xff\x10\x10\x10\xff\xff\xff", 9)).string();
  const std::string white = folder.write("white.ppm", "P6 3 1 255\n" + std::string(9, '\xff')).string();
  scene = plain;
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = white;
  CHECK(called(scene) == Names{});
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = varied;
  CHECK(called(scene) == Names{"alpha_cutout", "texture"});
  scene.materials[0].diffuse_map = scene.materials[0].opacity_map = (folder.path() / "missing.png").string();
  CHECK(called(scene) == Names{});
}
