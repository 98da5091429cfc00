// OFF, as text: a keyword, three counts, then a vertex a line and a face a line. Comments and empty lines may stand
// anywhere. What follows a vertex's position or a face's corners (normals, colours, texture coordinates) is not used.
// Format: Geomview, "Object File Format".
#include <array>
#include <cstdint>

#include <fmt/format.h>

#include "core/error.h"
#include "core/parse_number.h"
#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/polygon.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

class OffReader {
 public:
  OffReader(std::string_view text, const std::filesystem::path& path) : rest_(text), path_(path) {}

  Scene run() {
    read_keyword();
    if (has_dimension_) {
      dimension_ = count("the dimension");
      if (dimension_ < 1 || dimension_ > 3) fail(fmt::format("{} coordinates a vertex; up to 3 are read", dimension_));
    }
    const std::uint64_t vertices = count("the number of vertices"), faces = count("the number of faces");
    skip_edges();
    // Of a vertex each coordinate takes two characters at least, a face two.
    if (vertices > rest_.size() / (2 * dimension_) + 1 || faces > rest_.size() / 2 + 1)
      fail(fmt::format("the header promises {} vertices and {} faces, more than the file can hold", vertices, faces));
    if (vertices >= 0xffffffffu) fail("more than 2^32 - 2 vertices");
    scene_.mesh.vertices.reserve(vertices), scene_.mesh.triangles.reserve(faces);
    for (std::uint64_t i = 0; i < vertices; ++i) add_vertex(i, vertices);
    for (std::uint64_t i = 0; i < faces; ++i) add_face(i, faces);
    if (find_line())
      warn(fmt::format("{}:{}: the header promises {} vertices and {} faces; what is from here on is left out",
                       path_.string(), number_, vertices, faces));
    if (short_faces_ > 0) warn(short_faces_warning(path_, short_faces_));
    if (scene_.mesh.triangles.empty()) throw UserError(path_.string() + ": no triangle in it");
    return std::move(scene_);
  }

 private:
  [[noreturn]] void fail(std::string_view what) const {
    throw UserError(fmt::format("{}:{}: {}", path_.string(), number_, what));
  }
  [[noreturn]] void fail_truncated(std::string_view what) const {
    throw UserError(fmt::format("{}: broken or truncated: {}; copy or export it anew", path_.string(), what));
  }
  void warn(std::string line) { scene_.report.warnings.push_back(std::move(line)); }

  /// Goes to the next line that holds more than blanks and comments.
  bool find_line() {
    while (!rest_.empty()) {
      line_ = next_line(rest_);
      ++number_;
      std::string_view ahead = line_;
      if (!next_word(ahead).empty()) return true;
    }
    return false;
  }

  /// The next word of the header, on whatever line.
  std::string_view header_word() {
    std::string_view word = next_word(line_);
    if (word.empty() && find_line()) word = next_word(line_);
    return word;
  }

  /// [ST][C][N][4][n]OFF, or nothing.
  void read_keyword() {
    if (!find_line()) fail_truncated("nothing in it but blanks and comments");
    line_.remove_prefix(line_.find_first_not_of(" \t"));
    std::string_view word = line_;
    for (const std::string_view prefix : {"ST", "C", "N", "4"}) {
      if (!word.starts_with(prefix)) continue;
      is_homogeneous_ = prefix == "4";
      word.remove_prefix(prefix.size());
    }
    has_dimension_ = word.starts_with('n');
    if (has_dimension_) word.remove_prefix(1);
    if (!word.starts_with("OFF")) {
      is_homogeneous_ = has_dimension_ = false;
      return;
    }
    line_ = word.substr(3);
    std::string_view ahead = line_;
    if (next_word(ahead) == "BINARY") fail("a binary OFF, which is not read; save it as text");
  }

  std::uint64_t count(const char* what) {
    const std::string_view word = header_word();
    if (word.empty()) fail_truncated(fmt::format("{} is missing behind the keyword OFF", what));
    const auto value = parse_number<std::uint64_t>(word);
    if (!value)
      fail(fmt::format("{} is '{}'; write 'OFF', then how many vertices, faces and edges", what, one_line(word)));
    return *value;
  }

  /// Their number, of no use, and often left out: it stands behind that of faces, or alone on the next line.
  void skip_edges() {
    std::string_view word = next_word(line_);
    if (word.empty()) {
      const std::string_view rest = rest_;
      const std::size_t number = number_;
      if (!find_line()) return;
      word = next_word(line_);
      if (!next_word(line_).empty() || dimension_ == 1) {
        rest_ = rest, number_ = number;
        return;
      }
    }
    if (!parse_number<std::uint64_t>(word) || !next_word(line_).empty())
      fail("no three counts; write how many vertices, faces and edges, and the vertices from the next line on");
  }

  void add_vertex(std::uint64_t index, std::uint64_t of) {
    if (!find_line()) fail_truncated(fmt::format("{} vertices of the {} that the header promises", index, of));
    std::array<float, 4> values{0.0f, 0.0f, 0.0f, 1.0f};
    for (std::size_t k = 0; k < dimension_; ++k) values[k] = coordinate(index, "xyz"[k]);
    Vec3f v{values[0], values[1], values[2]};
    if (is_homogeneous_) {
      const double w = coordinate(index, 'w');
      for (std::size_t k = 0; k < 3; ++k) v[k] = float(double(v[k]) / w);
    }
    scene_.mesh.vertices.push_back(v);
  }

  float coordinate(std::uint64_t vertex, char axis) {
    const std::string_view word = next_word(line_);
    float value = 0.0f;
    if (!parse_float(word, value))
      fail(fmt::format("vertex {} has no number for {}{}; write a vertex a line", vertex, axis,
                       word.empty() ? "" : fmt::format(" but '{}'", one_line(word))));
    return value;
  }

  void add_face(std::uint64_t face, std::uint64_t of) {
    if (!find_line()) fail_truncated(fmt::format("{} faces of the {} that the header promises", face, of));
    const auto promised = parse_number<std::uint64_t>(next_word(line_));
    if (!promised) fail(fmt::format("face {} does not begin with its number of corners", face));
    corners_.clear();
    for (std::uint64_t k = 0; k < *promised; ++k) {
      const std::string_view word = next_word(line_);
      const auto vertex = parse_number<std::uint64_t>(word);
      if (word.empty()) fail(fmt::format("face {} has {} corners of the {} that it promises", face, k, *promised));
      if (!vertex)
        fail(fmt::format("face {}: '{}' is no vertex index, which is a number from 0 on", face, one_line(word)));
      if (*vertex >= scene_.mesh.vertices.size())
        fail(fmt::format("face {}: vertex index {} is out of range: there are {} vertices", face, *vertex,
                         scene_.mesh.vertices.size()));
      corners_.push_back(std::uint32_t(*vertex));
    }
    if (corners_.size() < 3) {
      ++short_faces_;
      return;
    }
    scene_.report.polygons_split += corners_.size() > 3;
    triangulate(corners_, scene_.mesh.vertices, scene_.mesh.triangles);
    if (scene_.mesh.triangles.size() >= 0xffffffffu) fail("more than 2^32 - 2 triangles");
  }

  std::string_view rest_, line_;
  std::size_t number_ = 0;  ///< of `line_`
  const std::filesystem::path& path_;
  bool has_dimension_ = false, is_homogeneous_ = false;
  std::uint64_t dimension_ = 3;
  std::vector<std::uint32_t> corners_;
  std::size_t short_faces_ = 0;
  Scene scene_;
};

}  // namespace

Scene read_off(const std::filesystem::path& path) {
  const FileBytes bytes(path);
  return OffReader(without_mark(bytes.text()), path).run();
}

}  // namespace arboretum
