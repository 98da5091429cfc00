// PLY, ASCII and binary of either byte order, read straight from the mapped file: millions of triangles a
// second, where assimp takes minutes and gigabytes. Elements and properties may come in any order; what is
// not a position, a list of vertex indices or a `material_id` is skipped. Format: Turk, "The PLY Polygon File
// Format", 1994.
#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/ply_header.h"
#include "scenes/polygon.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

using ply::Element;
using ply::Failure;
using ply::Format;
using ply::Property;
using ply::Type;

/// Reads one number after the other, binary or ASCII, and never beyond the end.
class Cursor {
 public:
  Cursor(std::string_view text, Format format, const Failure& fail)
      : p_(text.data()), end_(p_ + text.size()), format_(format), fail_(fail) {}

  [[nodiscard]] std::size_t left() const noexcept { return std::size_t(end_ - p_); }
  [[nodiscard]] bool is_ascii() const noexcept { return format_ == Format::ascii; }
  void set_place(const Element& element, std::uint64_t index) noexcept { element_ = &element, index_ = index; }

  [[noreturn]] void fail(std::string_view what) const {
    fail_(fmt::format("{} {} of {}: {}", element_->name, index_, element_->count, what));
  }

  float read_float(Type type) {
    if (is_ascii()) {
      float value = 0.0f;
      take_word(parse_float(skip_space(), end_, value), "a number");
      return value;
    }
    switch (type) {
      case Type::float32: return take<float>();
      case Type::float64: return float(take<double>());
      default: return float(read_integer(type));
    }
  }

  std::int64_t read_integer(Type type) {
    if (is_ascii()) {
      const char* begin = skip_space();
      std::int64_t value = 0;
      const auto [next, error] = std::from_chars(begin, end_, value);
      take_word(error == std::errc{} ? next : nullptr, "a whole number");
      return value;
    }
    switch (type) {
      case Type::int8: return take<std::int8_t>();
      case Type::uint8: return take<std::uint8_t>();
      case Type::int16: return take<std::int16_t>();
      case Type::uint16: return take<std::uint16_t>();
      case Type::int32: return take<std::int32_t>();
      case Type::uint32: return take<std::uint32_t>();
      default: fail("an index or a count is stored as a floating-point number");
    }
  }

  std::uint64_t read_count(const Property& list) {
    const std::int64_t count = read_integer(list.count_type);
    if (count < 0) fail("a list has a negative length");
    if (std::uint64_t(count) > left() / (is_ascii() ? 1 : size_of(list.type)) + 1)
      fail("truncated: the file ends inside a list");
    return std::uint64_t(count);
  }

  void skip(const Property& property) {
    for (std::uint64_t n = property.is_list ? read_count(property) : 1; n > 0; --n) {
      if (is_ascii()) {
        const char* p = skip_space();
        while (p != end_ && static_cast<unsigned char>(*p) > ' ') ++p;
        take_word(p, "a number");
      } else {
        take_bytes(size_of(property.type));
      }
    }
  }

 private:
  const char* skip_space() {
    while (p_ != end_ && static_cast<unsigned char>(*p_) <= ' ') ++p_;
    if (p_ == end_) fail("truncated: the file ends here");
    return p_;
  }
  void take_word(const char* next, std::string_view what) {
    if (!next || (next != end_ && static_cast<unsigned char>(*next) > ' ')) {
      const std::size_t length = std::min<std::size_t>(left(), 20);
      std::string_view word(p_, length);
      word = word.substr(0, word.find_first_of(" \t\r\n"));
      fail(fmt::format("'{}' is not {}", one_line(word), what));
    }
    p_ = next;
  }
  const char* take_bytes(std::size_t n) {
    if (left() < n) fail("truncated: the file ends here");
    return std::exchange(p_, p_ + n);
  }
  template <class T>
  T take() {
    char raw[sizeof(T)];
    std::memcpy(raw, take_bytes(sizeof(T)), sizeof(T));
    if ((format_ == Format::big_endian) != (std::endian::native == std::endian::big))
      std::reverse(raw, raw + sizeof(T));
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

  const char *p_, *end_;
  Format format_;
  const Failure& fail_;
  const Element* element_ = nullptr;
  std::uint64_t index_ = 0;
};

/// `texture`: becomes one pair a vertex where the file has any.
void read_vertices(const Element& element, Cursor& cursor, TriangleMesh& mesh,
                   std::vector<std::array<float, 2>>& texture, const Failure& fail) {
  const int axes[] = {element.find({"x"}), element.find({"y"}), element.find({"z"})};
  for (const int axis : axes)
    if (axis < 0 || element.properties[std::size_t(axis)].is_list) fail("the vertices have no properties x, y and z");
  const int u = element.find({"u", "s", "texture_u", "texture_s"}),
            v_axis = element.find({"v", "t", "texture_v", "texture_t"});
  const bool textured = u >= 0 && v_axis >= 0 && !element.properties[std::size_t(u)].is_list &&
                        !element.properties[std::size_t(v_axis)].is_list;
  mesh.vertices.reserve(element.count);
  for (std::uint64_t i = 0; i < element.count; ++i) {
    cursor.set_place(element, i);
    Vec3f v;
    std::array<float, 2> at{};
    for (int k = 0; k < int(element.properties.size()); ++k) {
      const Property& property = element.properties[std::size_t(k)];
      if (k == axes[0])
        v.x = cursor.read_float(property.type);
      else if (k == axes[1])
        v.y = cursor.read_float(property.type);
      else if (k == axes[2])
        v.z = cursor.read_float(property.type);
      else if (textured && k == u)
        at[0] = cursor.read_float(property.type);
      else if (textured && k == v_axis)
        at[1] = cursor.read_float(property.type);
      else
        cursor.skip(property);
    }
    mesh.vertices.push_back(v);
    if (textured) texture.push_back(at);
  }
}

/// Returns how many have fewer than three corners; they are left out.
std::size_t read_faces(const Element& element, Cursor& cursor, Scene& scene, const Failure& fail) {
  const std::size_t vertices = scene.mesh.vertices.size();
  const int list = element.find({"vertex_indices", "vertex_index"});
  if (list < 0 || !element.properties[std::size_t(list)].is_list) fail("the faces have no list 'vertex_indices'");
  const int material = element.find({"material_id"});
  TriangleMesh& mesh = scene.mesh;
  mesh.triangles.reserve(element.count);
  if (material >= 0) mesh.materials.reserve(element.count);
  std::vector<std::uint32_t> corners;
  std::size_t short_faces = 0;
  for (std::uint64_t i = 0; i < element.count; ++i) {
    cursor.set_place(element, i);
    std::int64_t id = 0;
    corners.clear();
    for (int k = 0; k < int(element.properties.size()); ++k) {
      const Property& property = element.properties[std::size_t(k)];
      if (k == list) {
        for (std::uint64_t n = cursor.read_count(property); n > 0; --n) {
          const std::int64_t vertex = cursor.read_integer(property.type);
          if (vertex < 0 || std::uint64_t(vertex) >= vertices)
            cursor.fail(fmt::format("vertex index {} is out of range: there are {} vertices", vertex, vertices));
          corners.push_back(std::uint32_t(vertex));
        }
      } else if (k == material) {
        id = cursor.read_integer(property.type);
        if (id < 0 || id > 65534) cursor.fail(fmt::format("material_id {} is out of range (0 to 65534)", id));
      } else {
        cursor.skip(property);
      }
    }
    if (corners.size() < 3) {
      ++short_faces;
      continue;
    }
    scene.report.polygons_split += corners.size() > 3;
    triangulate(corners, mesh.vertices, mesh.triangles);
    if (material >= 0) mesh.materials.resize(mesh.triangles.size(), std::uint16_t(id));
  }
  return short_faces;
}

void read_materials(const std::filesystem::path& path, Scene& scene, const Failure& fail) {
  if (scene.mesh.materials.empty()) return;
  const std::size_t used = std::size_t(*std::max_element(scene.mesh.materials.begin(), scene.mesh.materials.end())) + 1;
  std::filesystem::path library = path;
  library.replace_extension(".mtl");
  if (std::error_code error; std::filesystem::exists(library, error)) {
    scene.materials = read_mtl(library, scene.report.warnings);
    if (scene.materials.size() < used)
      fail(fmt::format("a face has material_id {}, but {} holds {} materials", used - 1, library.string(),
                       scene.materials.size()));
    return;
  }
  for (std::size_t i = 0; i < used; ++i) scene.materials.push_back(Material{.name = fmt::format("material{}", i)});
}

}  // namespace

Scene read_ply(const std::filesystem::path& path) {
  const Failure fail(path);
  const FileBytes bytes(path);
  const ply::Header header = ply::parse_header(bytes.text(), fail);
  Cursor cursor(bytes.text().substr(header.bytes), header.format, fail);
  Scene scene;
  std::vector<std::array<float, 2>> texture;
  bool has_vertices = false, has_faces = false;
  for (const Element& element : header.elements) {
    // Every property takes a byte at least, so a count that the file cannot hold is known before memory is
    // asked for.
    cursor.set_place(element, 0);
    if (!element.properties.empty() && element.count > cursor.left() / element.properties.size()) {
      fail(fmt::format("truncated: the header promises {} of element '{}', more than the file can hold", element.count,
                       one_line(element.name)));
    }
    if (element.name == "vertex" && !has_vertices) {
      if (element.count >= 0xffffffffu) fail("more than 2^32 - 2 vertices");
      read_vertices(element, cursor, scene.mesh, texture, fail);
      has_vertices = true;
    } else if (element.name == "face" && !has_faces) {
      if (!has_vertices) fail("the faces come before the vertices; that order is not read");
      if (const std::size_t short_faces = read_faces(element, cursor, scene, fail); short_faces > 0)
        scene.report.warnings.push_back(short_faces_warning(path, short_faces));
      has_faces = true;
    } else if (element.name == "tristrips") {
      fail("holds triangle strips, which are not read; convert it to faces");
    } else {
      for (std::uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) {
        cursor.set_place(element, i);
        for (const Property& property : element.properties) cursor.skip(property);
      }
    }
  }
  if (scene.mesh.triangles.empty())
    fail(has_faces ? "no face in it" : "no element 'face' in it; a point cloud cannot be traced");
  if (scene.mesh.triangles.size() >= 0xffffffffu) fail("more than 2^32 - 2 triangles");
  if (!texture.empty())
    for (const Triangle& t : scene.mesh.triangles)
      scene.texture_coordinates.push_back({texture[t.a], texture[t.b], texture[t.c]});
  read_materials(path, scene, fail);
  return scene;
}

}  // namespace arboretum
