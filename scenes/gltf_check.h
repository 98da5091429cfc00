// What of a glTF's JSON would take assimp's stack or all of a machine's memory: brackets in brackets, and nodes that
// are no forest.
#pragma once

#include <string>
#include <string_view>

namespace arboretum {

/// Throws UserError for what is no JSON, for more than 100 brackets in each other, and where a node is a child twice
/// (glTF 2.0, section 3.5.2 forbids it), below itself, of no node that there is, or more than 1000 levels deep.
void check_gltf(std::string_view json, const std::string& name);

}  // namespace arboretum
