// Appearance: what of a scene's materials is not seen, in words: images that cannot be read, glass that is not there.
#pragma once

#include <string>
#include <vector>

#include "scenes/scene.h"

namespace arboretum {

/// Of an image that cannot be read: where it is named (`place`, of the material), why, and what becomes of it.
[[nodiscard]] std::string unread_image(const std::string& place, const std::string& image);
/// A line for each material that some triangle has and that cannot be seen: glass of Ni 1 without colour.
[[nodiscard]] std::vector<std::string> unseen_materials(const Scene& scene);

}  // namespace arboretum
