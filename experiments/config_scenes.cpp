#include "experiments/config_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <system_error>

#include "core/error.h"
#include "core/names.h"
#include "scenes/catalogue.h"
#include "scenes/generators/generators.h"

namespace arboretum {
namespace {

SceneSpec named(const std::string& name) {
  const CatalogueEntry entry = find_catalogue_entry(name);
  SceneSpec spec;
  if (entry.source == CatalogueEntry::Source::generator)
    spec.generator = name, spec.triangles = entry.triangles;
  else
    spec.catalogue = name;
  return spec;
}

/// The folder that ARBORETUM_SCENES names; empty: none.
std::filesystem::path scenes_folder() {
  const char* folder = std::getenv("ARBORETUM_SCENES");
  return folder ? folder : "";
}

/// The file in that folder; empty where it is not there.
std::filesystem::path in_scenes_folder(const std::filesystem::path& file) {
  const std::filesystem::path folder = scenes_folder();
  if (folder.empty() || file.empty()) return {};
  std::error_code error;
  return std::filesystem::is_regular_file(folder / file, error) ? folder / file : std::filesystem::path();
}

/// Where the file is; with `optional` `missing` says why it is nowhere.
std::filesystem::path find_file(const YamlReader& yaml, const YAML::Node& node, std::string_view what,
                                const std::filesystem::path& folder, bool optional, std::string& missing) {
  const std::string text = yaml.text(node, what);
  const std::filesystem::path path = folder / text;
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return path;
  if (std::filesystem::path there = in_scenes_folder(text); !there.empty()) return there;
  if (!optional) {
    yaml.fail(node, fmt::format("{} '{}' is no file; paths are relative to the configuration, or to the folder "
                                "that ARBORETUM_SCENES names",
                                what, path.string()));
  }
  const std::string scenes = scenes_folder().string();
  missing = fmt::format("optional scene {} is not here: ARBORETUM_SCENES{}", text,
                        scenes.empty() ? ", the folder to find it in, is not set" : " is " + scenes);
  return text;
}

/// What `read` throws gets file and line of the node that asked for it.
template <class Read>
auto with_place(const YamlReader& yaml, const YAML::Node& node, const Read& read) {
  try {
    return read();
  } catch (const UserError& e) {
    yaml.fail(node, e.what());
  }
}

SceneSpec read_scene(const YamlReader& yaml, const YAML::Node& node, const std::filesystem::path& folder,
                     std::string& missing) {
  if (node.IsScalar()) {
    // As on the command line, but a name is never a file of the folder that the program happens to run in.
    const std::string word = yaml.text(node, "scene"), extension = std::filesystem::path(word).extension().string();
    SceneSpec spec;
    if (extension == ".yaml" || extension == ".yml") {
      spec.scene = find_file(yaml, node, "scene", folder, false, missing);
    } else if (!extension.empty() || word.find('/') != std::string::npos) {
      spec.file = find_file(yaml, node, "file", folder, false, missing);
    } else {
      spec = with_place(yaml, node,
                        [&] { return word.find(':') == std::string::npos ? named(word) : parse_scene_word(word); });
      if (!spec.generator.empty())
        with_place(yaml, node, [&] { return check_generated(spec.generator, spec.triangles, spec.seed), 0; });
    }
    return spec;
  }
  yaml.check_map(node, "a scene",
                 std::vector<std::string>{"file", "scene", "generate", "catalogue", "triangles", "seed", "optional",
                                          "stretch", "size", "offset"});
  const int forms =
      int(bool(node["file"])) + int(bool(node["scene"])) + int(bool(node["generate"])) + int(bool(node["catalogue"]));
  if (forms != 1) yaml.fail(node, "a scene has exactly one of file, scene, generate and catalogue");
  SceneSpec spec;
  if (const auto n = node["catalogue"]) {
    if (node["optional"]) yaml.fail(node["optional"], "optional has no effect with catalogue: take it out");
    spec = read_scene(yaml, n, folder, missing);
  }
  bool optional = false;
  if (const auto n = node["optional"]) {
    const std::string word = yaml.text(n, "optional");
    if (word != "true" && word != "false") yaml.fail(n, fmt::format("optional must be true or false, not '{}'", word));
    optional = word == "true";
    if (node["generate"]) yaml.fail(n, "optional has no effect with generate: take it out");
  }
  if (const auto n = node["file"]) spec.file = find_file(yaml, n, "file", folder, optional, missing);
  if (const auto n = node["scene"]) spec.scene = find_file(yaml, n, "scene", folder, optional, missing);
  if (const auto n = node["generate"]) {
    spec.generator = yaml.text(n, "generate");
    const std::vector<std::string> known = generator_names();
    if (std::ranges::find(known, spec.generator) == known.end())
      yaml.fail(n, unknown_name_message("generator", spec.generator, known));
    spec.triangles = find_catalogue_entry(spec.generator).triangles;
  }
  for (const char* key : {"triangles", "seed"}) {
    if (node[key] && !node["generate"])
      yaml.fail(node[key], fmt::format("{} has no effect without generate: take it out", key));
  }
  if (const auto n = node["triangles"]) spec.triangles = yaml.integer(n, "triangles", 1, std::uint64_t{1} << 31);
  if (const auto n = node["seed"]) spec.seed = yaml.integer(n, "seed", 0, std::numeric_limits<std::uint64_t>::max());
  if (!spec.generator.empty()) {
    const YAML::Node& at = node["triangles"] && spec.triangles > kMaxGeneratedTriangles ? node["triangles"]
                           : node["seed"]                                               ? node["seed"]
                                                                                        : node;
    with_place(yaml, at, [&] { check_generated(spec.generator, spec.triangles, spec.seed); });
  }
  return spec;
}

/// Each of the values that `key` has, `usual` where it is not there.
struct PlacingValue {
  double value;
  std::string label;
};
std::vector<PlacingValue> placing_values(const YamlReader& yaml, const YAML::Node& node, const std::string& key,
                                         double low, double high, double usual) {
  if (!node.IsMap() || !node[key]) return {{usual, ""}};
  std::vector<PlacingValue> values;
  for (const YAML::Node& n : yaml.list(node[key], key)) {
    values.push_back({yaml.number(n, key, low, high), fmt::format(":{}={}", key, n.Scalar())});
  }
  return values;
}

/// Every combination of the values given.
std::vector<Placing> read_placings(const YamlReader& yaml, const YAML::Node& node) {
  std::vector<Placing> placings;
  for (const auto& stretch : placing_values(yaml, node, "stretch", 1e-9, 1e9, 1.0))
    for (const auto& size : placing_values(yaml, node, "size", 1e-9, 1e9, 1.0))
      for (const auto& offset : placing_values(yaml, node, "offset", -kMaxCoordinate, kMaxCoordinate, 0.0))
        placings.push_back(
            {stretch.value, size.value, offset.value, fmt::format("{}{}{}", stretch.label, size.label, offset.label)});
  return placings;
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
    std::string missing;
    const SceneSpec spec = read_scene(yaml, entry, folder, missing);
    const bool moves = missing.empty() && scene_moves(spec);
    for (const Placing& placing : read_placings(yaml, entry)) {
      const std::string name = fmt::format("{}{}", cell_word(spec.name()), placing.label);
      if (std::ranges::find(scenes, name, &SceneChoice::name) != scenes.end()) {
        yaml.fail(entry, fmt::format("scene '{}' is given twice; keep one, or name them apart: another file name, or "
                                     "{{scene: FILE.yaml}}, a scene file with a `name:` of its own",
                                     name));
      }
      scenes.push_back({spec, name, moves, missing, placing, yaml.where(entry)});
    }
  }
  return scenes;
}

SceneSpec scene_spec_of_word(const std::string& word) {
  SceneSpec spec = parse_scene_word(word);
  for (std::filesystem::path* file : {&spec.file, &spec.scene}) {
    std::error_code error;
    if (file->empty() || std::filesystem::exists(*file, error)) continue;
    if (std::filesystem::path there = in_scenes_folder(*file); !there.empty()) *file = std::move(there);
  }
  return spec;
}

SceneChoice scene_of_word(const std::string& word) {
  SceneSpec spec = scene_spec_of_word(word);
  if (!spec.generator.empty()) check_generated(spec.generator, spec.triangles, spec.seed);
  std::string name = cell_word(spec.name());
  const bool moves = scene_moves(spec);
  return {.spec = std::move(spec), .name = std::move(name), .moves = moves, .where = "command line"};
}

}  // namespace arboretum
