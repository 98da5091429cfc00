// load_scene: the four ways in which a scene is named, one way out.
#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "core/error.h"
#include "core/names.h"
#include "core/parse_number.h"
#include "scenes/catalogue.h"
#include "scenes/generators/generators.h"
#include "scenes/preflight.h"
#include "scenes/readers.h"
#include "scenes/rescale.h"
#include "scenes/sanitise.h"
#include "scenes/scene.h"

namespace arboretum {
namespace {

std::string lower_extension(const std::filesystem::path& path) { return in_lower_case(path.extension().string()); }

bool is_yaml(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".yaml" || extension == ".yml";
}

std::uint64_t parse_whole_number(std::string_view text, std::string_view what, const std::string& word) {
  const std::optional<std::uint64_t> value = parse_number<std::uint64_t>(text);
  if (!value)
    throw UserError(
        fmt::format("scene '{}': {} '{}' is no whole number; write GENERATOR:TRIANGLES or GENERATOR:TRIANGLES:SEED",
                    word, what, text));
  return *value;
}

}  // namespace

Scene read_model(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".obj") return read_obj(path);
  if (extension == ".ply") return read_ply(path);
  if (extension == ".stl") return read_stl(path);
  if (extension == ".off") return read_off(path);
  check_before_assimp(path, extension);
  return read_assimp(path);
}

std::string short_faces_warning(const std::filesystem::path& path, std::size_t faces) {
  return fmt::format("{}: {} face{} of fewer than three corners left out", path.string(), faces, faces == 1 ? "" : "s");
}

std::string SceneSpec::name() const {
  if (!catalogue.empty()) return catalogue;
  if (!file.empty()) return one_line(file.stem().string());
  if (!scene.empty()) {
    std::error_code error;
    return is_yaml(scene) && std::filesystem::is_regular_file(scene, error) ? scene_file_name(scene)
                                                                            : one_line(scene.stem().string());
  }
  return fmt::format("{}-{}{}", generator, triangles, seed == 1 ? std::string() : fmt::format("-seed{}", seed));
}

Scene load_scene(const SceneSpec& spec) {
  const int forms = !spec.catalogue.empty() + !spec.file.empty() + !spec.scene.empty() + !spec.generator.empty();
  if (forms != 1) throw UserError("a scene is named by exactly one of: a catalogue name, file, scene, generate");
  if (!spec.generator.empty()) {
    Scene scene = generate_scene(spec.generator, spec.triangles, spec.seed);
    scene.name = spec.name();
    return scene;
  }
  if (!spec.catalogue.empty()) {
    const CatalogueEntry entry = find_catalogue_entry(spec.catalogue);
    if (entry.source != CatalogueEntry::Source::generator) return load_catalogue_scene(entry);
    Scene scene = generate_scene(entry.name, entry.triangles, 1);
    scene.name = spec.name();
    return scene;
  }
  const std::filesystem::path& path = spec.file.empty() ? spec.scene : spec.file;
  if (!spec.file.empty() && is_yaml(path))
    throw UserError(path.string() + ": is a scene file; name it with 'scene:' instead of 'file:'");
  if (!spec.scene.empty() && !is_yaml(path))
    throw UserError(path.string() + ": is no scene file (.yaml); name a model with 'file:' instead of 'scene:'");
  Scene scene = spec.file.empty() ? read_scene_yaml(path) : read_model(path);
  rescale(scene, path.string());
  sanitise(scene, path.string());
  scene.name = spec.name();
  return scene;
}

bool scene_moves(const SceneSpec& spec) {
  if (!spec.scene.empty() && is_yaml(spec.scene)) return scene_file_moves(spec.scene);
  const std::string& name = spec.generator.empty() ? spec.catalogue : spec.generator;
  return std::ranges::any_of(generators(), [&](const GeneratorInfo& g) { return g.moves && g.name == name; });
}

SceneSpec parse_scene_word(const std::string& word) {
  SceneSpec spec;
  if (word.empty()) throw UserError("a scene's name is empty; see: ./arboretum list scenes");
  std::error_code error;
  const std::filesystem::path path(word);
  const std::size_t colon = word.find(':');
  const std::string head = word.substr(0, colon);
  const std::vector<std::string> names = generator_names();
  const bool generated = std::find(names.begin(), names.end(), head) != names.end();
  if (!generated &&
      (word.find('/') != std::string::npos || std::filesystem::exists(path, error) || !path.extension().empty())) {
    (is_yaml(path) ? spec.scene : spec.file) = path;
    return spec;
  }
  if (generated) {
    spec.generator = head;
    if (colon == std::string::npos) return spec;
    const std::size_t second = word.find(':', colon + 1);
    spec.triangles = parse_whole_number(std::string_view(word).substr(colon + 1, second - colon - 1),
                                        "the number of triangles", word);
    if (second != std::string::npos)
      spec.seed = parse_whole_number(std::string_view(word).substr(second + 1), "the seed", word);
    return spec;
  }
  if (colon != std::string::npos) throw UserError(unknown_name_message("generator", head, names));
  spec.catalogue = find_catalogue_entry(word).name;
  return spec;
}

}  // namespace arboretum
