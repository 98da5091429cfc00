// STL, binary and text: three corners of its own for each triangle, in the file's order; normals and attributes are
// not used. Text is read as words, whatever its lines; keywords are told by case. Format: 3D Systems,
// "StereoLithography Interface Specification", 1988.
#include <cstdint>
#include <cstring>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

constexpr std::size_t kHead = 80 + sizeof(std::uint32_t), kTriangle = 50;
constexpr std::uint64_t kMostTriangles = 0xfffffffeu / 3;  // each brings three vertices

/// A triangle of the last three vertices.
void add_triangle(TriangleMesh& mesh, const std::string& path) {
  if (mesh.triangles.size() >= kMostTriangles) throw UserError(path + ": more than 2^32 - 2 vertices");
  const auto end = std::uint32_t(mesh.vertices.size());
  mesh.triangles.push_back({end - 3, end - 2, end - 1});
}

/// Words of a text file one by one; a line's end parts them as blanks do.
class TextReader {
 public:
  TextReader(std::string_view text, const std::string& path, TriangleMesh& mesh)
      : rest_(text), path_(path), mesh_(mesh) {}

  void run() {
    unsigned corners = 0;
    std::size_t facet = 0;  // line of the one that is open, else 0
    bool ended = true;
    for (std::string_view word = next(); !word.empty(); word = next()) {
      if (word == "solid") {
        skip_line(), ended = false;
      } else if (word == "endsolid" || (word == "end" && rest_.starts_with(" solid"))) {
        skip_line(), ended = true;
      } else if (word == "facet") {
        if (facet > 0) fail(line_, fmt::format("a facet begins, and that of line {} has no 'endfacet'", facet));
        facet = line_, corners = 0, ended = false;
      } else if (word == "normal") {
        (void)numbers(word);
      } else if (word == "vertex") {
        if (facet == 0) fail(line_, "a 'vertex' outside of 'facet' and 'endfacet'");
        const Vec3f corner = numbers(word);
        if (++corners <= 3) mesh_.vertices.push_back(corner);  // of more, 'endfacet' says so
      } else if (word == "endfacet") {
        if (facet == 0) fail(line_, "an 'endfacet' without its 'facet'");
        if (corners != 3)
          fail(line_, fmt::format("a facet of {} corners; write three 'vertex x y z' in each", corners));
        add_triangle(mesh_, path_);
        facet = 0;
      }
    }
    if (facet > 0 || !ended)
      throw UserError(path_ + ": broken or truncated: " +
                      (facet > 0 ? fmt::format("the facet of line {} has no 'endfacet'", facet)
                                 : std::string("no 'endsolid' behind its triangles")) +
                      "; copy or export it anew");
  }

 private:
  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw UserError(fmt::format("{}:{}: {}", path_, line, what));
  }

  /// A line ends at "\n", "\r\n" or "\r".
  std::string_view next() {
    std::size_t at = 0;
    for (; at < rest_.size() && is_blank(rest_[at]); ++at)
      line_ += rest_[at] == '\n' || (rest_[at] == '\r' && !rest_.substr(at + 1).starts_with('\n'));
    rest_.remove_prefix(at);
    at = 0;
    while (at < rest_.size() && !is_blank(rest_[at])) ++at;
    const std::string_view word = rest_.substr(0, at);
    rest_.remove_prefix(at);
    return word;
  }

  /// A name may be any words.
  void skip_line() { rest_.remove_prefix(std::min(rest_.size(), rest_.find_first_of("\r\n"))); }

  Vec3f numbers(std::string_view keyword) {
    const std::size_t line = line_;
    Vec3f values;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::string_view word = next();
      if (!parse_float(word, values[axis]))
        fail(line, fmt::format("'{0}' has no number for {1}{2}; write '{0} x y z'", keyword, "xyz"[axis],
                               word.empty() || line_ != line ? "" : fmt::format(" but '{}'", one_line(word))));
    }
    return values;
  }

  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v'; }

  std::string_view rest_;
  const std::string& path_;
  TriangleMesh& mesh_;
  std::size_t line_ = 1;
};

/// Twelve floats a triangle, little-endian as this machine (the project is for x86-64): normal and corners.
void read_binary(std::string_view bytes, std::uint32_t triangles, const std::string& path, TriangleMesh& mesh) {
  mesh.vertices.reserve(3 * std::size_t(triangles)), mesh.triangles.reserve(triangles);
  for (const char* p = bytes.data() + kHead; triangles > 0; --triangles, p += kTriangle) {
    float corners[9];
    std::memcpy(corners, p + 3 * sizeof(float), sizeof corners);
    for (const float* c = corners; c != corners + 9; c += 3) mesh.vertices.push_back({c[0], c[1], c[2]});
    add_triangle(mesh, path);
  }
}

void read_bytes(std::string_view bytes, const std::string& path, TriangleMesh& mesh) {
  const std::string_view text = without_mark(bytes);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const bool says_text = first != std::string_view::npos && text.substr(first).starts_with("solid");
  std::uint64_t size = 0;
  std::uint32_t triangles = 0;
  if (bytes.size() >= kHead) {
    std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
    size = kHead + kTriangle * std::uint64_t(triangles);
  }
  if (bytes.size() >= kHead && bytes.size() == size) return read_binary(bytes, triangles, path, mesh);
  // Headers of binary files may begin with "solid" as well; but text holds no zero bytes, which numbers of triangles
  // do.
  if (says_text && bytes.substr(0, 1000).find('\0') == std::string_view::npos)
    return TextReader(text, path, mesh).run();
  if (bytes.size() < kHead)
    throw UserError(
        fmt::format("{}: no STL: neither text that begins with 'solid' nor a binary file, which has {} bytes "
                    "before its triangles; this has {}",
                    path, kHead, bytes.size()));
  throw UserError(
      fmt::format("{}: broken or truncated: as a binary STL its header promises {} triangle{}, {} bytes in all, and it "
                  "has {}; copy or export it anew",
                  path, triangles, triangles == 1 ? "" : "s", size, bytes.size()));
}

}  // namespace

Scene read_stl(const std::filesystem::path& path) {
  const FileBytes bytes(path);
  Scene scene;
  read_bytes(bytes.text(), path.string(), scene.mesh);
  if (scene.mesh.triangles.empty()) throw UserError(path.string() + ": no triangle in it");
  return scene;
}

}  // namespace arboretum
