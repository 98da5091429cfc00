// What the tests of scenes share: a pyramid in several formats.
#pragma once

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "scenes/scene.h"
#include "tests/error_of.h"
#include "tests/folder.h"

namespace arboretum::test {

inline Scene load_file(const fs::path& path) {
  SceneSpec spec;
  (path.extension() == ".yaml" ? spec.scene : spec.file) = path;
  return load_scene(spec);
}

template <class T>
void put(std::string& out, T value, bool big_endian) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (big_endian) std::reverse(raw, raw + sizeof(T));
  out.append(raw, sizeof(T));
}

// A pyramid without its base: five corners, four triangles.
inline constexpr float kCorners[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}};
inline constexpr int kFaces[4][3] = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};

inline std::string obj_text() {
  std::string s = "# a pyramid\n";
  for (const auto& v : kCorners)
    s += "v " + std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces)
    s += "f " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) + "\n";
  return s;
}

inline std::string ply_header(const std::string& format, const std::string& face_extra = "") {
  return "ply\nformat " + format +
         " 1.0\ncomment written by a test\nelement vertex 5\nproperty float x\nproperty float y\nproperty "
         "float z\n"
         "element face 4\nproperty list uchar int vertex_indices\n" +
         face_extra + "end_header\n";
}

inline std::string ply_binary(bool big_endian, bool with_materials) {
  std::string s = ply_header(big_endian ? "binary_big_endian" : "binary_little_endian",
                             with_materials ? "property ushort material_id\n" : "");
  for (const auto& v : kCorners)
    for (const float x : v) put(s, x, big_endian);
  for (int i = 0; i < 4; ++i) {
    put(s, std::uint8_t(3), big_endian);
    for (const int x : kFaces[i]) put(s, std::int32_t(x), big_endian);
    if (with_materials) put(s, std::uint16_t(i % 2), big_endian);
  }
  return s;
}

inline std::string stl_ascii() {
  std::string s = "solid pyramid\n";
  for (const auto& f : kFaces) {
    s += "facet normal 0 0 0\nouter loop\n";
    for (const int i : f)
      s += "vertex " + std::to_string(kCorners[i][0]) + " " + std::to_string(kCorners[i][1]) + " " +
           std::to_string(kCorners[i][2]) + "\n";
    s += "endloop\nendfacet\n";
  }
  return s + "endsolid pyramid\n";
}

inline std::string ply_ascii() {
  std::string s = ply_header("ascii");
  for (const auto& v : kCorners)
    s += std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces)
    s += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  return s;
}

inline std::string off_text() {
  std::string s = "OFF\n5 4 0\n";
  for (const auto& v : kCorners)
    s += std::to_string(v[0]) + " " + std::to_string(v[1]) + " " + std::to_string(v[2]) + "\n";
  for (const auto& f : kFaces)
    s += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  return s;
}

inline void check_pyramid(const Scene& scene, Vec3f moved = {0, 0, 0}) {
  REQUIRE(scene.mesh.size() == 4);
  CHECK(scene.report.triangles_read == 4);
  CHECK(scene.materials.size() >= 1);
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const float* p = kCorners[kFaces[i][k]];
      CHECK(scene.mesh.corners(i)[k] == Vec3f{p[0], p[1], p[2]} + moved);
    }
}

}  // namespace arboretum::test
