// Preflight: refuses files whose headers promise more than they hold, for formats where assimp would ask for
// the memory first (a few damaged bytes could otherwise take all of a machine's), and what assimp reads past or never
// ends with.
#pragma once

#include <filesystem>
#include <string_view>

namespace arboretum {

/// `extension` in lower case, with its dot. Formats other than .gltf, .glb and .vrm pass. Throws UserError.
void check_before_assimp(const std::filesystem::path& path, std::string_view extension);

}  // namespace arboretum
