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

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/polygon.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

enum class Type : unsigned char { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

constexpr std::size_t size_of(Type type) noexcept {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[int(type)];
}

struct Property {
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  [[nodiscard]] int find(std::initializer_list<std::string_view> names) const {
    for (std::size_t i = 0; i < properties.size(); ++i)
      if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) return int(i);
    return -1;
  }
};

enum class Format { ascii, little_endian, big_endian };

struct Header {
  Format format = Format::ascii;
  std::vector<Element> elements;
  std::size_t bytes = 0;  ///< where the data begins
};

class Failure {
 public:
  explicit Failure(const std::filesystem::path& path) : name_(path.string()) {}
  [[noreturn]] void operator()(const std::string& what) const { throw UserError(name_ + ": " + what); }
  [[noreturn]] void line(std::size_t number, const std::string& what) const {
    throw UserError(fmt::format("{}:{}: {}", name_, number, what));
  }

 private:
  std::string name_;
};

std::vector<std::string_view> words(std::string_view line) {
  std::vector<std::string_view> result;
  while (true) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) return result;
    line.remove_prefix(first);
    const std::size_t length = std::min(line.find_first_of(" \t\r"), line.size());
    result.push_back(line.substr(0, length));
    line.remove_prefix(length);
  }
}

Type parse_type(std::string_view word, std::size_t line, const Failure& fail) {
  constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::int8},      {"int8", Type::int8},       {"uchar", Type::uint8},
      {"uint8", Type::uint8},    {"short", Type::int16},     {"int16", Type::int16},
      {"ushort", Type::uint16},  {"uint16", Type::uint16},   {"int", Type::int32},
      {"int32", Type::int32},    {"uint", Type::uint32},     {"uint32", Type::uint32},
      {"float", Type::float32},  {"float32", Type::float32}, {"double", Type::float64},
      {"float64", Type::float64}};
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  fail.line(line,
            fmt::format("unknown property type '{}'; PLY has char uchar short ushort int uint float double",
                        one_line(word)));
}

Header parse_header(std::string_view text, const Failure& fail) {
  Header header;
  bool has_format = false;
  std::size_t position = 0;
  for (std::size_t number = 1;; ++number) {
    const std::size_t end = text.find('\n', position);
    if (number == 1 && text.substr(0, 3) != "ply") fail("not a PLY file: it does not begin with 'ply'");
    if (end == std::string_view::npos)
      fail("the PLY header has no 'end_header' line; the file is truncated or broken");
    const auto word = words(text.substr(position, end - position));
    position = end + 1;
    if (word.empty() || word[0] == "ply" || word[0] == "comment" || word[0] == "obj_info") continue;
    if (word[0] == "end_header") break;
    if (word[0] == "format" && word.size() >= 2) {
      has_format = true;
      if (word[1] == "ascii")
        header.format = Format::ascii;
      else if (word[1] == "binary_little_endian")
        header.format = Format::little_endian;
      else if (word[1] == "binary_big_endian")
        header.format = Format::big_endian;
      else
        fail.line(number,
                  fmt::format("unknown format '{}'; PLY has ascii, binary_little_endian, binary_big_endian",
                              one_line(word[1])));
    } else if (word[0] == "element" && word.size() == 3) {
      Element element{.name = std::string(word[1]), .count = 0, .properties = {}};
      const auto [p, error] = std::from_chars(word[2].data(), word[2].data() + word[2].size(), element.count);
      if (error != std::errc{} || p != word[2].data() + word[2].size())
        fail.line(number, fmt::format("the number of elements '{}' is no whole number", one_line(word[2])));
      header.elements.push_back(std::move(element));
    } else if (word[0] == "property" && !header.elements.empty() && word.size() >= 3) {
      Property property;
      if (word[1] == "list") {
        if (word.size() != 5) fail.line(number, "a list property is 'property list COUNT_TYPE TYPE NAME'");
        property.is_list = true;
        property.count_type = parse_type(word[2], number, fail);
        if (property.count_type >= Type::float32)
          fail.line(number, "a list's count cannot be a floating-point number");
        property.type = parse_type(word[3], number, fail);
      } else {
        property.type = parse_type(word[1], number, fail);
      }
      property.name = std::string(word.back());
      header.elements.back().properties.push_back(std::move(property));
    } else {
      fail.line(number, fmt::format("unknown PLY header line '{}'", one_line(word[0])));
    }
  }
  if (!has_format) fail("the PLY header has no 'format' line");
  header.bytes = position;
  return header;
}

/// Reads one number after the other, binary or ASCII, and never beyond the end.
class Cursor {
 public:
  Cursor(std::string_view text, Format format, const Failure& fail)
      : p_(text.data()), end_(p_ + text.size()), format_(format), fail_(fail) {}

  [[nodiscard]] std::size_t left() const noexcept { return std::size_t(end_ - p_); }
  [[nodiscard]] bool is_ascii() const noexcept { return format_ == Format::ascii; }
  void set_place(const Element& element, std::uint64_t index) noexcept {
    element_ = &element, index_ = index;
  }

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
      case Type::float32:
        return take<float>();
      case Type::float64:
        return float(take<double>());
      default:
        return float(read_integer(type));
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
      case Type::int8:
        return take<std::int8_t>();
      case Type::uint8:
        return take<std::uint8_t>();
      case Type::int16:
        return take<std::int16_t>();
      case Type::uint16:
        return take<std::uint16_t>();
      case Type::int32:
        return take<std::int32_t>();
      case Type::uint32:
        return take<std::uint32_t>();
      default:
        fail("an index or a count is stored as a floating-point number");
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
void read_vertices(const Element& element, Cursor& cursor, TriangleMesh& mesh, std::vector<std::array<float, 2>>& texture, const Failure& fail) {
  const int axes[] = {element.find({"x"}), element.find({"y"}), element.find({"z"})};
  for (const int axis : axes)
    if (axis < 0 || element.properties[std::size_t(axis)].is_list)
      fail("the vertices have no properties x, y and z");
  const int u = element.find({"u", "s", "texture_u", "texture_s"}), v_axis = element.find({"v", "t", "texture_v", "texture_t"});
  const bool textured = u >= 0 && v_axis >= 0 && !element.properties[std::size_t(u)].is_list && !element.properties[std::size_t(v_axis)].is_list;
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

void read_faces(const Element& element, Cursor& cursor, Scene& scene, const Failure& fail) {
  const std::size_t vertices = scene.mesh.vertices.size();
  const int list = element.find({"vertex_indices", "vertex_index"});
  if (list < 0 || !element.properties[std::size_t(list)].is_list)
    fail("the faces have no list 'vertex_indices'");
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
            cursor.fail(
                fmt::format("vertex index {} is out of range: there are {} vertices", vertex, vertices));
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
  if (short_faces > 0)
    scene.report.warnings.push_back(
        fmt::format("{} faces of fewer than three corners left out", short_faces));
}

void read_materials(const std::filesystem::path& path, Scene& scene, const Failure& fail) {
  if (scene.mesh.materials.empty()) return;
  const std::size_t used =
      std::size_t(*std::max_element(scene.mesh.materials.begin(), scene.mesh.materials.end())) + 1;
  std::filesystem::path library = path;
  library.replace_extension(".mtl");
  if (std::error_code error; std::filesystem::exists(library, error)) {
    scene.materials = read_mtl(library, scene.report.warnings);
    if (scene.materials.size() < used)
      fail(fmt::format("a face has material_id {}, but {} holds {} materials", used - 1, library.string(),
                       scene.materials.size()));
    return;
  }
  for (std::size_t i = 0; i < used; ++i)
    scene.materials.push_back(Material{.name = fmt::format("material{}", i)});
}

}  // namespace

Scene read_ply(const std::filesystem::path& path) {
  const Failure fail(path);
  const FileBytes bytes(path);
  const Header header = parse_header(bytes.text(), fail);
  Cursor cursor(bytes.text().substr(header.bytes), header.format, fail);
  Scene scene;
  std::vector<std::array<float, 2>> texture;
  bool has_vertices = false, has_faces = false;
  for (const Element& element : header.elements) {
    // Every property takes a byte at least, so a count that the file cannot hold is known before memory is
    // asked for.
    cursor.set_place(element, 0);
    if (!element.properties.empty() && element.count > cursor.left() / element.properties.size()) {
      fail(fmt::format("truncated: the header promises {} of element '{}', more than the file can hold",
                       element.count, one_line(element.name)));
    }
    if (element.name == "vertex" && !has_vertices) {
      if (element.count >= 0xffffffffu) fail("more than 2^32 - 2 vertices");
      read_vertices(element, cursor, scene.mesh, texture, fail);
      has_vertices = true;
    } else if (element.name == "face" && !has_faces) {
      if (!has_vertices) fail("the faces come before the vertices; that order is not read");
      read_faces(element, cursor, scene, fail);
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
    for (const Triangle& t : scene.mesh.triangles) scene.texture_coordinates.push_back({texture[t.a], texture[t.b], texture[t.c]});
  read_materials(path, scene, fail);
  return scene;
}

}  // namespace arboretum
