// What is wrong with an STL file, binary or text: assimp reads text up to where it is cut off and says nothing, and of
// other faults it says neither line nor mend.
#pragma once

#include <string>
#include <string_view>

namespace arboretum {

/// Throws UserError for a binary file of another size than its number of triangles takes, for text whose corners are no
/// numbers or not three a facet, or that has no end, and for what is neither. Words are told by case, as assimp does.
void check_stl(std::string_view bytes, const std::string& path);

}  // namespace arboretum
