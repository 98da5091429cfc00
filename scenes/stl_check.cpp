#include "scenes/stl_check.h"

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

/// Words of a text file one by one; a line's end parts them as blanks do.
class TextCheck {
 public:
  TextCheck(std::string_view text, const std::string& path) : rest_(text), path_(path) {}

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
        facet = line_, corners = 0, ended = false;
      } else if (word == "normal" || word == "vertex") {
        corners += word == "vertex";
        numbers(word);
      } else if (word == "endfacet") {
        if (corners != 3)
          fail(line_, fmt::format("a facet of {} corners; write three 'vertex x y z' in each", corners));
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

  std::string_view next() {
    std::size_t at = 0;
    for (; at < rest_.size() && is_blank(rest_[at]); ++at) line_ += rest_[at] == '\n';
    rest_.remove_prefix(at);
    at = 0;
    while (at < rest_.size() && !is_blank(rest_[at])) ++at;
    const std::string_view word = rest_.substr(0, at);
    rest_.remove_prefix(at);
    return word;
  }

  /// A name may be any words.
  void skip_line() { rest_.remove_prefix(std::min(rest_.size(), rest_.find_first_of("\r\n"))); }

  void numbers(std::string_view keyword) {
    const std::size_t line = line_;
    for (const char axis : {'x', 'y', 'z'}) {
      const std::string_view word = next();
      float value = 0.0f;
      if (word.empty() || parse_float(word.data(), word.data() + word.size(), value) != word.data() + word.size())
        fail(line, fmt::format("'{0}' has no number for {1}{2}; write '{0} x y z'", keyword, axis,
                               word.empty() || line_ != line ? "" : fmt::format(" but '{}'", one_line(word))));
    }
  }

  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v'; }

  std::string_view rest_;
  const std::string& path_;
  std::size_t line_ = 1;
};

}  // namespace

void check_stl(std::string_view bytes, const std::string& path) {
  const std::string_view text = without_mark(bytes);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const bool says_text = first != std::string_view::npos && text.substr(first).starts_with("solid");
  std::uint64_t size = 0;
  std::uint32_t triangles = 0;
  if (bytes.size() >= kHead) {
    std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
    size = kHead + kTriangle * std::uint64_t(triangles);
  }
  if (bytes.size() >= kHead && bytes.size() == size) return;
  // Headers of binary files may begin with "solid" as well; but text holds no zero bytes, which numbers of triangles
  // do.
  if (says_text && bytes.substr(0, 1000).find('\0') == std::string_view::npos) return TextCheck(text, path).run();
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

}  // namespace arboretum
