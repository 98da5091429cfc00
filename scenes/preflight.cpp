#include "scenes/preflight.h"

#include <cstdint>
#include <cstring>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/gltf_check.h"

namespace arboretum {
namespace {

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
  if (extension != ".gltf" && extension != ".glb" && extension != ".vrm") return;
  const FileBytes bytes(path);
  if (extension != ".gltf") {  // a VRM is a GLB
    check_glb(bytes.text(), path.string());
  } else {
    check_gltf(bytes.text(), path.string());
  }
}

}  // namespace arboretum
