#include "scenes/preflight.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/gltf_check.h"
#include "scenes/stl_check.h"

namespace arboretum {
namespace {

/// OFF as assimp reads it: a keyword, three counts, then a vertex a line and a face a line.
class OffCheck {
 public:
  OffCheck(std::string_view text, const std::string& name) : rest_(text.substr(0, text.find('\0'))), name_(name) {}

  void run() {
    const bool has_dimension = skip_keyword();
    if (has_dimension) (void)number(rest_);
    const std::uint64_t vertices = count(), faces = count();
    // A vertex takes six characters at least ("0 0 0\n"), a face four.
    if (vertices > rest_.size() / 6 + 1 || faces > rest_.size() / 4 + 1) {
      broken(fmt::format("the header promises {} vertices and {} faces, more than the file can hold", vertices, faces));
    }
    (void)count();  // of edges
    skip_to_token();
    std::string_view line;
    for (std::uint64_t i = 0; i < vertices; ++i)
      if (!next_line(line)) broken(fmt::format("{} vertices of the {} that the header promises", i, vertices));
    for (std::uint64_t i = 0; i < faces; ++i) {
      if (!next_line(line)) broken(fmt::format("{} faces of the {} that the header promises", i, faces));
      check_face(line, i, vertices);
    }
  }

 private:
  static constexpr std::size_t kLongestLine = 4000;  // assimp cuts lines at 4096 characters

  [[noreturn]] void broken(const std::string& what) const {
    throw UserError(fmt::format("{}: broken or truncated: {}", name_, what));
  }

  static bool is_blank(char c) { return c == ' ' || c == '\t'; }
  static bool is_line_end(char c) { return c == '\n' || c == '\r' || c == '\f'; }

  void skip_to_token() {
    while (!rest_.empty() && (is_blank(rest_[0]) || is_line_end(rest_[0]) || rest_[0] == '#')) {
      const bool is_comment = rest_[0] == '#';
      rest_.remove_prefix(is_comment ? std::min(rest_.size(), rest_.find_first_of("\n\r\f")) : 1);
    }
  }

  /// [ST][C][N][4][n]OFF, or nothing. Whether a dimension follows.
  bool skip_keyword() {
    skip_to_token();
    std::string_view word = rest_;
    for (const std::string_view prefix : {"ST", "C", "N", "4"})
      if (word.starts_with(prefix)) word.remove_prefix(prefix.size());
    const bool has_dimension = word.starts_with('n');
    if (has_dimension) word.remove_prefix(1);
    if (!word.starts_with("OFF")) return false;
    rest_ = word.substr(3);
    return has_dimension;
  }

  /// Takes a whole number off the front of `text`; none where there is no such number.
  static std::optional<std::uint64_t> number(std::string_view& text) {
    while (!text.empty() && is_blank(text[0])) text.remove_prefix(1);
    std::uint64_t value = 0;
    const auto [next, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (next == text.data()) return {};
    text.remove_prefix(std::size_t(next - text.data()));
    return error == std::errc{} ? value : ~std::uint64_t{0};
  }

  std::uint64_t count() {
    skip_to_token();
    const std::optional<std::uint64_t> value = number(rest_);
    if (!value) broken("no numbers of vertices, faces and edges behind the keyword OFF");
    return *value;
  }

  bool next_line(std::string_view& line) {
    while (!rest_.empty() && is_line_end(rest_[0])) rest_.remove_prefix(1);
    if (rest_.empty()) return false;
    line = rest_.substr(0, rest_.find_first_of("\n\r\f"));
    if (line.size() > kLongestLine) broken(fmt::format("a line of more than {} characters", kLongestLine));
    rest_.remove_prefix(line.size());
    if (const std::size_t first = line.find_first_not_of(" \t"); first != std::string_view::npos && line[first] == '#')
      throw UserError(name_ + ": a comment among the vertices or faces, where assimp reads none; take it out");
    return true;
  }

  void check_face(std::string_view line, std::uint64_t face, std::uint64_t vertices) const {
    const std::optional<std::uint64_t> corners = number(line);
    if (!corners || *corners == 0) broken(fmt::format("face {} does not begin with its number of corners", face));
    for (std::uint64_t k = 0; k < *corners; ++k) {
      const std::optional<std::uint64_t> index = number(line);
      if (!index) broken(fmt::format("face {} has {} corners of the {} that it promises", face, k, *corners));
      if (*index >= vertices) {
        throw UserError(fmt::format("{}: face {}: vertex index {} is out of range: there are {} vertices", name_, face,
                                    *index, vertices));
      }
    }
  }

  std::string_view rest_;
  const std::string& name_;
};

/// GLB: twelve bytes of header, the last four its length, then chunks that begin with their length.
void check_glb(std::string_view bytes, const std::string& name) {
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof(value));
    return std::size_t(value);
  };
  if (bytes.size() < 20 || bytes.substr(0, 4) != "glTF" || word(8) > bytes.size())
    throw UserError(name + ": broken or truncated: no whole GLB header, or fewer bytes than it promises");
  for (std::size_t at = 12; at + 8 <= bytes.size(); at += 8 + word(at)) {
    if (word(at) > bytes.size() - at - 8)
      throw UserError(name + ": broken or truncated: a chunk of the GLB is longer than the file");
  }
  check_gltf(bytes.substr(20, word(12)), name);
}

}  // namespace

void check_before_assimp(const std::filesystem::path& path, std::string_view extension) {
  if (extension != ".off" && extension != ".stl" && extension != ".gltf" && extension != ".glb" && extension != ".vrm")
    return;
  const FileBytes bytes(path);
  if (extension == ".stl") {
    check_stl(bytes.text(), path.string());
  } else if (extension == ".off") {
    const std::string name = path.string();
    OffCheck(bytes.text(), name).run();
  } else if (extension != ".gltf") {  // a VRM is a GLB
    check_glb(bytes.text(), path.string());
  } else {
    check_gltf(bytes.text(), path.string());
  }
}

}  // namespace arboretum
