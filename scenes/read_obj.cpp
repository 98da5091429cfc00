// OBJ through tinyobjloader's callback interface: no intermediate copy, and the text of the line at hand
// stays in reach. tinyobjloader reads `nan` and `inf` as 0, rounds some decimals wrongly, wraps indices beyond
// 32 bits, cuts them at a decimal point and takes a comment behind a face for corners; so coordinates and
// faces are read again here from the line itself. Lines that a backslash continues are put together before.
#include <tiny_obj_loader.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <istream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <streambuf>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/polygon.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

/// A stream buffer over mapped bytes. At a callback the get pointer stands just behind the line that caused
/// it.
class MappedBuffer : public std::streambuf {
 public:
  explicit MappedBuffer(std::string_view text) : whole_(joined(text)), original_(text.data()) {
    if (!whole_.empty()) text = whole_;
    char* p = const_cast<char*>(text.data());
    setg(p, p, p + text.size());
  }
  /// The line just read, without its end.
  [[nodiscard]] std::string_view line() const {
    const char* end = gptr();
    if (end > eback() && end[-1] == '\n') --end;
    if (end > eback() && end[-1] == '\r') --end;
    const char* begin = end;
    while (begin > eback() && begin[-1] != '\n' && begin[-1] != '\r') --begin;
    return {begin, std::size_t(end - begin)};
  }
  [[nodiscard]] std::size_t line_number() const {
    return 1 + std::size_t(std::count(original_, original_ + (line().data() - eback()), '\n'));
  }

 private:
  /// As long as the text, with blanks in place of each backslash and the end of line behind it; empty where there is
  /// none.
  static std::string joined(std::string_view text) {
    std::string whole;
    for (std::size_t at = text.find('\\'); at != std::string_view::npos; at = text.find('\\', at + 1)) {
      const std::size_t end = text.substr(at + 1).starts_with("\r\n") ? 3 : 2;
      if (at + end > text.size() || text[at + end - 1] != '\n') continue;
      if (whole.empty()) whole = text;
      std::fill_n(whole.begin() + std::ptrdiff_t(at), end, ' ');
    }
    return whole;
  }

  std::string whole_;
  const char* original_;
};

/// A corner of a face as it is written: from 1 on, or from -1 down; 0 where there is none.
struct ObjCorner {
  std::int64_t vertex = 0, texture = 0;
};

struct ObjReader {
  const std::filesystem::path& path;
  MappedBuffer buffer;
  Scene scene;
  std::map<std::string, int> material_ids;
  std::set<std::string> libraries, unknown_materials;  // those told of
  bool library_missing = false;
  std::optional<std::uint16_t> material, default_material;
  std::vector<ObjCorner> written;  // of the face at hand
  std::vector<std::uint32_t> corners;
  std::vector<std::array<float, 2>> texture_vertices, texture_corners;
  std::size_t short_faces = 0;

  ObjReader(const std::filesystem::path& p, std::string_view text) : path(p), buffer(text) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw UserError(fmt::format("{}:{}: {}", path.string(), buffer.line_number(), what));
  }

  void warn(const std::string& what) {
    scene.report.warnings.push_back(fmt::format("{}:{}: {}", path.string(), buffer.line_number(), what));
  }

  void add_vertex() {
    const std::string_view line = buffer.line();
    const char *p = line.data(), *end = p + line.size();
    p = skip_blanks(p, end) + 1;  // behind the `v`
    Vec3f v;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      p = skip_blanks(p, end);
      const char* next = parse_float(p, end, v[axis]);
      if (!next)
        fail(fmt::format("vertex {} has no number for {}; write 'v x y z'", scene.mesh.vertices.size() + 1,
                         "xyz"[axis]));
      p = next;
    }
    if (scene.mesh.vertices.size() >= 0xfffffffeu) fail("more than 2^32 - 2 vertices");
    scene.mesh.vertices.push_back(v);
  }

  /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
  [[nodiscard]] ObjCorner corner(std::string_view word) const {
    std::int64_t index[3] = {};
    const char *p = word.data(), *const end = p + word.size();
    for (unsigned i = 0; i < 3; ++i) {
      if (i > 0 && p != end && *p == '/') ++p;
      if (p != end && *p == '+') ++p;
      const auto [next, error] = std::from_chars(p, end, index[i]);
      if (error == std::errc::result_out_of_range) fail("a face index is out of range");
      if ((error != std::errc{} && i == 0) || (next != end && *next != '/')) break;
      if ((p = next) == end) return {index[0], index[1]};
    }
    fail(fmt::format("'{}' is no corner of a face; write 'v', 'v/vt', 'v//vn' or 'v/vt/vn'", one_line(word)));
  }

  [[nodiscard]] std::uint32_t vertex_of(std::int64_t index) const {
    const auto vertices = std::int64_t(scene.mesh.vertices.size());
    const std::int64_t vertex = index > 0 ? index - 1 : vertices + index;
    if (index != 0 && vertex >= 0 && vertex < vertices) return std::uint32_t(vertex);
    if (vertices == 0) fail(fmt::format("face index {} is out of range: no vertex precedes it", index));
    fail(fmt::format("face index {} is out of range: {} vertices precede it, so valid are 1 to {} and -1 to -{}", index,
                     vertices, vertices, vertices));
  }

  void add_face() {
    std::string_view line = buffer.line();
    (void)next_word(line);  // the `f`
    written.clear(), corners.clear();
    for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
      written.push_back(corner(word));
      corners.push_back(vertex_of(written.back().vertex));
    }
    if (corners.size() < 3) {
      ++short_faces;
      return;
    }
    scene.report.polygons_split += corners.size() > 3;
    triangulate(corners, scene.mesh.vertices, scene.mesh.triangles);
    if (!texture_vertices.empty()) add_texture_coordinates();
    if (scene.mesh.triangles.size() >= kNoTriangle) fail("more than 2^32 - 2 triangles");
    if (!material) use_default_material();
    scene.mesh.materials.resize(scene.mesh.triangles.size(), *material);
  }

  /// Of the triangles that the face has just become; a corner without any has (0, 0).
  void add_texture_coordinates() {
    texture_corners.assign(corners.size(), {0.0f, 0.0f});
    const auto known = std::int64_t(texture_vertices.size());
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::int64_t index = written[i].texture;
      const std::int64_t vertex = index > 0 ? index - 1 : known + index;
      if (index == 0) continue;
      if (vertex < 0 || vertex >= known)
        fail(fmt::format("texture index {} is out of range: {} 'vt' lines precede it", index, known));
      texture_corners[i] = texture_vertices[std::size_t(vertex)];
    }
    std::vector<TextureTriangle>& all = scene.texture_coordinates;
    for (std::size_t i = all.size(); i < scene.mesh.triangles.size(); ++i) {
      TextureTriangle coordinates{};
      const Triangle& t = scene.mesh.triangles[i];
      const bool of_this_face = i + corners.size() - 2 >= scene.mesh.triangles.size();
      for (std::size_t k = 0; of_this_face && k < 3; ++k) {
        const std::uint32_t vertex = k == 0 ? t.a : k == 1 ? t.b : t.c;
        coordinates[k] = texture_corners[std::size_t(std::ranges::find(corners, vertex) - corners.begin())];
      }
      all.push_back(coordinates);
    }
  }

  void use_default_material() {
    if (!default_material) {
      default_material = std::uint16_t(scene.materials.size());
      scene.materials.push_back(Material{.name = "default"});
    }
    material = *default_material;
  }

  void use_material(const std::string& name) {
    if (const auto found = material_ids.find(name); found != material_ids.end()) {
      material = std::uint16_t(found->second);
      return;
    }
    // Where a library is missing, its own warning stands for all of its materials.
    if (!library_missing && unknown_materials.insert(name).second) {
      warn(fmt::format("no material '{}' in {}; grey stands in", one_line(name),
                       libraries.empty() ? "any 'mtllib' before it" : "the material library"));
    }
    use_default_material();
  }

  /// One line may name several, or one whose name holds blanks.
  void add_libraries(const std::string& names) {
    std::error_code error;
    if (std::filesystem::exists(beside(path, names), error)) return add_library(names);
    std::istringstream words(names);
    for (std::string name; words >> name;) add_library(name);
  }

  void add_library(const std::string& name) {
    if (!libraries.insert(name).second) return;
    const std::filesystem::path file = beside(path, name);
    if (std::error_code error; !std::filesystem::exists(file, error)) {
      warn(fmt::format("no material library '{}'; grey stands in for its materials", one_line(file.string())));
      library_missing = true;
      return;
    }
    std::vector<Material> read = read_mtl(file, scene.report.warnings);
    for (Material& m : read) {
      material_ids.emplace(m.name, int(scene.materials.size()));
      scene.materials.push_back(std::move(m));
    }
    if (scene.materials.size() > kMaxMaterials) fail(fmt::format("more than {} materials", kMaxMaterials));
  }

  static constexpr std::size_t kNoTriangle = 0xffffffffu;
  static constexpr std::size_t kMaxMaterials = 65534;  // one is left for the default
};

/// The word behind the keyword, trailing blanks left out: tinyobjloader's own callback for it needs its
/// material table.
std::string argument(std::string_view line, std::size_t keyword) {
  line.remove_prefix(std::min(line.size(), line.find_first_not_of(" \t") + keyword));
  const std::size_t first = line.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return std::string(line.substr(first, line.find_last_not_of(" \t") - first + 1));
}

/// Stands in for tinyobjloader's own lookup of `mtllib`, whose failures are no more than a line in a warning
/// string, and which cuts names at blanks and reads the first alone.
class LibraryReader : public tinyobj::MaterialReader {
 public:
  explicit LibraryReader(ObjReader& reader) : reader_(reader) {}
  /// Called for each word of the line; the line is read at the first. True would end the line and let tinyobjloader
  /// pass over later ones that begin with the same word.
  bool operator()(const std::string&, std::vector<tinyobj::material_t>*, std::map<std::string, int>*, std::string*,
                  std::string*) override {
    const std::string_view line = reader_.buffer.line();
    if (line.data() != line_) reader_.add_libraries(argument(line, 6));
    line_ = line.data();
    return false;
  }

 private:
  ObjReader& reader_;
  const char* line_ = nullptr;
};

}  // namespace

Scene read_obj(const std::filesystem::path& path) {
  const FileBytes bytes(path);
  ObjReader reader(path, without_mark(bytes.text()));
  tinyobj::callback_t callback;
  callback.vertex_cb = [](void* self, auto...) { static_cast<ObjReader*>(self)->add_vertex(); };
  callback.texcoord_cb = [](void* self, tinyobj::real_t u, tinyobj::real_t v, tinyobj::real_t) {
    static_cast<ObjReader*>(self)->texture_vertices.push_back({float(u), float(v)});
  };
  callback.index_cb = [](void* self, auto...) { static_cast<ObjReader*>(self)->add_face(); };
  callback.usemtl_cb = [](void* self, const char*, int) {
    auto& r = *static_cast<ObjReader*>(self);
    r.use_material(argument(r.buffer.line(), 6));
  };
  LibraryReader library(reader);
  std::istream stream(&reader.buffer);
  std::string warnings, error;
  if (!tinyobj::LoadObjWithCallback(stream, callback, &reader, &library, &warnings, &error)) {
    throw UserError(path.string() + ": " + one_line(error));
  }
  Scene& scene = reader.scene;
  if (!scene.texture_coordinates.empty()) scene.texture_coordinates.resize(scene.mesh.size());
  if (reader.short_faces > 0) {
    scene.report.warnings.push_back(short_faces_warning(path, reader.short_faces));
  }
  if (scene.mesh.triangles.empty()) {
    throw UserError(
        fmt::format("{}: no face in it ({} vertices); is it an OBJ file?", path.string(), scene.mesh.vertices.size()));
  }
  return std::move(reader.scene);
}

}  // namespace arboretum
