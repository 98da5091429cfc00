#include "scenes/preflight.h"

#include <charconv>
#include <cstdint>
#include <cstring>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/file_bytes.h"

namespace arboretum {
namespace {

/// OFF: the first two numbers of the file, comments left out, are its vertices and faces.
void check_off(std::string_view text, const std::string& name) {
  std::uint64_t counts[2] = {};
  std::size_t found = 0;
  const char *p = text.data(), *end = p + text.size();
  while (p != end && found < 2) {
    if (*p == '#') {
      while (p != end && *p != '\n') ++p;
    } else if (*p >= '0' && *p <= '9') {
      const auto [next, error] = std::from_chars(p, end, counts[found]);
      if (error != std::errc{}) counts[found] = ~std::uint64_t{0};
      p = next, ++found;
    } else {
      ++p;
    }
  }
  // A vertex takes six characters at least ("0 0 0\n"), a face four.
  if (found < 2 || counts[0] > text.size() / 6 + 1 || counts[1] > text.size() / 4 + 1) {
    throw UserError(fmt::format(
        "{}: broken or truncated: the header promises {} vertices and {} faces, more than the file can hold", name,
        counts[0], counts[1]));
  }
}

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
}

}  // namespace

void check_header(const std::filesystem::path& path, std::string_view extension) {
  if (extension != ".off" && extension != ".glb") return;
  const FileBytes bytes(path);
  if (extension == ".off")
    check_off(bytes.text(), path.string());
  else
    check_glb(bytes.text(), path.string());
}

}  // namespace arboretum
