// The `scenes:` list of a configuration, checked before anything is measured: names are known and files
// exist.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "experiments/yaml_reader.h"

namespace arboretum {

/// Paths are relative to `folder`, the configuration's own; what is not there is looked for in the folder that the
/// environment variable ARBORETUM_SCENES names. `optional: true` takes a scene that is in neither as missing. Throws
/// UserError; no two scenes may share a name.
[[nodiscard]] std::vector<SceneChoice> read_scenes(const YamlReader& yaml, const YAML::Node& node,
                                                   const std::filesystem::path& folder);
/// A scene named on the command line: what parse_scene_word takes; a file with a relative path that is not there is
/// looked for in the folder of ARBORETUM_SCENES as well.
[[nodiscard]] SceneSpec scene_spec_of_word(const std::string& word);
/// The same as a scene of an experiment.
[[nodiscard]] SceneChoice scene_of_word(const std::string& word);

}  // namespace arboretum
