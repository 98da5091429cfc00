// Preflight: refuses files whose headers promise more than they hold, for formats where assimp would ask for
// the memory first: a few damaged bytes could otherwise take all of a machine's.
#pragma once

#include <filesystem>
#include <string_view>

namespace arboretum {

/// `extension` in lower case, with its dot. Formats other than .off and .glb pass. Throws UserError.
void check_header(const std::filesystem::path& path, std::string_view extension);

}  // namespace arboretum
