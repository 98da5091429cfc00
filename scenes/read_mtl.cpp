// MTL through tinyobjloader.
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/number_text.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

Vec3f color(const tinyobj::real_t (&c)[3]) { return {float(c[0]), float(c[1]), float(c[2])}; }

/// What stands behind a keyword: so many numbers within [least, most].
struct Numbers {
  std::string_view keyword;
  int count;
  float least = 0.0f, most = std::numeric_limits<float>::max();
};
constexpr Numbers kNumbers[] = {{"Ka", 3},           {"Kd", 3},       {"Ks", 3},      {"Ke", 3},      {"Tf", 3},
                                {"Kt", 3},           {"Ns", 1},       {"Ni", 1},      {"d", 1, 0, 1}, {"Tr", 1, 0, 1},
                                {"illum", 1, 0, 10}, {"Pr", 1, 0, 1}, {"Pm", 1, 0, 1}};

/// The line, a colour of one number written out, which stands for all three: tinyobjloader takes what is no number,
/// numbers that are missing and `-halo` for 0. Throws UserError.
std::string checked_line(std::string_view line, const std::string& where) {
  const std::string_view whole = line, keyword = next_word(line);
  if (keyword.starts_with("map_") && line.find_first_not_of(" \t\r") == std::string_view::npos)
    throw UserError(fmt::format("{}: {} names no file", where, keyword));
  const auto* known = std::ranges::find(kNumbers, keyword, &Numbers::keyword);
  if (known == std::end(kNumbers)) return std::string(whole);
  std::string_view first;
  for (int i = 0; i < known->count; ++i) {
    const std::string_view word = next_word(line);
    if (i == 1 && word.empty()) return fmt::format("{} {} {} {}", keyword, first, first, first);
    if (i == 0) first = word;
    float value;
    const bool is_number = parse_float(word, value) && (keyword != "illum" || value == std::trunc(value));
    if (!is_number) {
      throw UserError(word.empty() ? fmt::format("{}: {} needs {}", where, keyword,
                                                 known->count == 3 ? "three numbers, or one for all" : "a number")
                                   : fmt::format("{}: {}: '{}' is no {}", where, keyword, one_line(word),
                                                 keyword == "illum" ? "whole number" : "number"));
    }
    if (!(value >= known->least && value <= known->most)) {
      throw UserError(fmt::format("{}: {} is {}, not {}", where, keyword, word,
                                  known->most < std::numeric_limits<float>::max()
                                      ? fmt::format("within {} to {}", known->least, known->most)
                                      : "a finite number from 0 on"));
    }
  }
  return std::string(whole);
}

/// Where a material's maps are named.
struct MapPlaces {
  std::string diffuse, opacity;
};

/// `text` as tinyobjloader reads it right, and the places of the maps of each material, in their order.
std::pair<std::string, std::vector<MapPlaces>> checked_lines(std::string_view text, const std::filesystem::path& path) {
  std::pair<std::string, std::vector<MapPlaces>> result;
  auto& [checked, places] = result;
  for (std::size_t number = 1; !text.empty(); ++number) {
    std::string_view line = next_line(text);
    const std::string where = fmt::format("{}:{}", path.string(), number);
    checked += checked_line(line, where) + "\n";
    const std::string_view keyword = next_word(line);
    if (keyword == "newmtl" && line.find_first_not_of(" \t\r") != std::string_view::npos) places.emplace_back();
    if (keyword == "map_Kd" && !places.empty()) places.back().diffuse = where + ": map_Kd";
    if (keyword == "map_d" && !places.empty()) places.back().opacity = where + ": map_d";
  }
  return result;
}

}  // namespace

std::vector<Material> read_mtl(const std::filesystem::path& path, std::vector<std::string>& warnings) {
  const FileBytes bytes(path);
  const auto [text, places] = checked_lines(without_mark(bytes.text()), path);
  std::istringstream stream(text);
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
    if (!m.diffuse_texname.empty()) material.diffuse_map = beside(path, m.diffuse_texname).string();
    if (!m.alpha_texname.empty()) material.opacity_map = beside(path, m.alpha_texname).string();
    if (const std::size_t number = materials.size(); number < places.size()) {
      material.diffuse_map_place = places[number].diffuse;
      material.opacity_map_place = places[number].opacity;
    }
    materials.push_back(std::move(material));
  }
  return materials;
}

std::filesystem::path beside(const std::filesystem::path& file, std::string name) {
  std::ranges::replace(name, '\\', '/');
  return file.parent_path() / name;
}

}  // namespace arboretum
