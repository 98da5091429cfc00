// MTL through tinyobjloader.
#include <tiny_obj_loader.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

Vec3f color(const tinyobj::real_t (&c)[3]) { return {float(c[0]), float(c[1]), float(c[2])}; }

}  // namespace

std::vector<Material> read_mtl(const std::filesystem::path& path, std::vector<std::string>& warnings) {
  const FileBytes bytes(path);
  std::istringstream stream{std::string(without_mark(bytes.text()))};
  std::map<std::string, int> ids;
  std::vector<tinyobj::material_t> read;
  std::string warning, error;
  tinyobj::LoadMtl(&ids, &read, &stream, &warning, &error);
  if (!warning.empty()) warnings.push_back(path.string() + ": " + one_line(warning));

  std::vector<Material> materials;
  for (const tinyobj::material_t& m : read) {
    if (m.name.empty()) continue;  // tinyobjloader makes one of nothing at the end of an empty file
    Material material{.name = m.name,
                      .diffuse = color(m.diffuse),
                      .specular = color(m.specular),
                      .emission = color(m.emission),
                      .transmission = color(m.transmittance),
                      .shininess = float(m.shininess),
                      .roughness = float(m.roughness),
                      .ior = float(m.ior),
                      .opacity = float(m.dissolve),
                      .illum = m.illum};
    // tinyobjloader cannot tell an absent Tf from one of zeros; the format's default is a filter that lets
    // all through.
    if (material.transmission == Vec3f{0, 0, 0}) material.transmission = {1, 1, 1};
    for (Vec3f* c : {&material.diffuse, &material.specular, &material.emission, &material.transmission}) {
      if (!is_finite(*c))
        throw UserError(path.string() + ": material '" + m.name + "' has a colour that is no finite number");
    }
    if (!m.diffuse_texname.empty()) material.diffuse_map = beside(path, m.diffuse_texname).string();
    if (!m.alpha_texname.empty()) material.opacity_map = beside(path, m.alpha_texname).string();
    materials.push_back(std::move(material));
  }
  return materials;
}

std::filesystem::path beside(const std::filesystem::path& file, std::string name) {
  std::ranges::replace(name, '\\', '/');
  return file.parent_path() / name;
}

}  // namespace arboretum
