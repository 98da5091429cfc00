#include "scenes/appearance.h"

#include <fmt/format.h>

#include "scenes/images.h"
#include "scenes/material_kind.h"
#include "scenes/readers.h"

namespace arboretum {

std::string unread_image(const std::string& place, const std::string& image) {
  return fmt::format("{}{}{}: {}; its material goes without", place, place.empty() ? "" : " ", one_line(image),
                     fault_of_image(image));
}

std::vector<std::string> unseen_materials(const Scene& scene) {
  std::vector<std::size_t> triangles(scene.materials.size());
  for (std::size_t i = 0; i < scene.mesh.size(); ++i) {
    const std::size_t id = scene.mesh.materials.empty() ? 0 : scene.mesh.materials[i];
    if (id < triangles.size()) ++triangles[id];
  }
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Material& m = scene.materials[i];
    if (triangles[i] > 0 && is_invisible(m))
      lines.push_back(fmt::format(
          "material '{}' is glass (illum {}) of Ni 1 without colour: {} triangle{} cannot be seen; give it a "
          "Ni, or another illum",
          one_line(m.name), m.illum, triangles[i], triangles[i] == 1 ? "" : "s"));
  }
  return lines;
}

}  // namespace arboretum
