#include "experiments/config_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <system_error>

#include "core/error.h"
#include "core/names.h"
#include "scenes/catalogue.h"

namespace arboretum {
namespace {

std::vector<std::string> generator_names() {
  std::vector<std::string> names;
  for (const CatalogueEntry& entry : catalogue())
    if (entry.source == CatalogueEntry::Source::generator) names.push_back(entry.name);
  return names;
}

SceneSpec named(const std::string& name) {
  const CatalogueEntry entry = find_catalogue_entry(name);
  SceneSpec spec;
  if (entry.source == CatalogueEntry::Source::generator)
    spec.generator = name, spec.triangles = entry.triangles;
  else
    spec.catalogue = name;
  return spec;
}

std::filesystem::path existing(const YamlReader& yaml, const YAML::Node& node, std::string_view what,
                               const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / yaml.text(node, what);
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    yaml.fail(node, fmt::format("{} '{}' is no file; paths are relative to the configuration", what,
                                path.string()));
  }
  return path;
}

SceneSpec read_scene(const YamlReader& yaml, const YAML::Node& node, const std::filesystem::path& folder) {
  if (node.IsScalar()) {
    try {
      return named(yaml.text(node, "scene"));
    } catch (const UserError& e) {
      yaml.fail(node, e.what());
    }
  }
  yaml.check_map(node, "a scene", std::vector<std::string>{"file", "scene", "generate", "triangles", "seed"});
  const int forms = int(bool(node["file"])) + int(bool(node["scene"])) + int(bool(node["generate"]));
  if (forms != 1) yaml.fail(node, "a scene has exactly one of file, scene and generate");
  SceneSpec spec;
  if (const auto n = node["file"]) spec.file = existing(yaml, n, "file", folder);
  if (const auto n = node["scene"]) spec.scene = existing(yaml, n, "scene", folder);
  if (const auto n = node["generate"]) {
    spec.generator = yaml.text(n, "generate");
    const std::vector<std::string> known = generator_names();
    if (std::ranges::find(known, spec.generator) == known.end())
      yaml.fail(n, unknown_name_message("generator", spec.generator, known));
    spec.triangles = find_catalogue_entry(spec.generator).triangles;
  }
  for (const char* key : {"triangles", "seed"}) {
    if (node[key] && spec.generator.empty())
      yaml.fail(node[key], fmt::format("{} has no effect without generate: take it out", key));
  }
  if (const auto n = node["triangles"])
    spec.triangles = yaml.integer(n, "triangles", 1, std::uint64_t{1} << 31);
  if (const auto n = node["seed"])
    spec.seed = yaml.integer(n, "seed", 0, std::numeric_limits<std::uint64_t>::max());
  return spec;
}

/// A name that is a part of cell names: no '/', which parts them.
std::string cell_word(std::string name) {
  std::ranges::replace(name, '/', '_');
  std::ranges::replace(name, ' ', '_');
  return name;
}

}  // namespace

std::vector<SceneChoice> read_scenes(const YamlReader& yaml, const YAML::Node& node,
                                     const std::filesystem::path& folder) {
  if (!node.IsSequence()) yaml.fail(node, "scenes must be a list, as in scenes: [bunny]");
  if (node.size() == 0) yaml.fail(node, "scenes is empty; name at least one, as in scenes: [bunny]");
  std::vector<SceneChoice> scenes;
  for (const YAML::Node& entry : node) {
    SceneSpec spec = read_scene(yaml, entry, folder);
    std::string name = cell_word(spec.name());
    if (std::ranges::find(scenes, name, &SceneChoice::name) != scenes.end()) {
      yaml.fail(entry,
                fmt::format("scene '{}' is given twice; keep one, or give the files different names", name));
    }
    const bool moves = scene_moves(spec);
    scenes.push_back({std::move(spec), std::move(name), moves});
  }
  return scenes;
}

SceneChoice scene_of_word(const std::string& word) {
  SceneSpec spec = parse_scene_word(word);
  std::string name = cell_word(spec.name());
  const bool moves = scene_moves(spec);
  return {std::move(spec), std::move(name), moves};
}

}  // namespace arboretum
