#include "scenes/catalogue.h"

#include <cstdlib>

#include <fmt/format.h>

#include "core/data_folder.h"
#include "core/error.h"
#include "core/names.h"
#include "scenes/generators/generators.h"
#include "scenes/readers.h"
#include "scenes/rescale.h"
#include "scenes/sanitise.h"
#include "scenes/yaml_node.h"

namespace arboretum {
namespace {

std::filesystem::path catalogue_file() {
  const char* other = std::getenv("ARBORETUM_CATALOGUE");
  return other && *other ? std::filesystem::path(other) : data_folder() / "scenes" / "catalogue.yaml";
}

CatalogueEntry read_entry(const YamlFile& file, const YAML::Node& node) {
  file.check_keys(node, "a catalogue entry",
                  {"name", "description", "package", "file", "licence", "triangles", "camera"});
  CatalogueEntry entry;
  const auto text = [&](const char* key) { return file.text(file.need(node, key, "a catalogue entry"), key); };
  entry.name = text("name");
  entry.description = text("description");
  entry.licence = text("licence");
  entry.triangles = file.count(file.need(node, "triangles", "a catalogue entry"), "triangles", 0xffffffffu);
  if (node["camera"]) entry.camera = file.camera(node["camera"]);
  const YAML::Node package = file.need(node, "package", "a catalogue entry");
  file.check_keys(package, "package", {"debian", "npm", "member"});
  if (package["debian"]) {
    entry.source = CatalogueEntry::Source::debian;
    entry.package = file.text(package["debian"], "debian");
  } else {
    entry.source = CatalogueEntry::Source::npm;
    entry.package = file.text(file.need(package, "npm", "package"), "npm");
    entry.member = file.text(file.need(package, "member", "an npm package"), "member");
  }
  const std::filesystem::path path = text("file");
  entry.file = path.is_absolute() ? path : cache_folder() / path;
  return entry;
}

}  // namespace

std::filesystem::path cache_folder() {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  if (cache && *cache == '/') return std::filesystem::path(cache) / "arboretum";
  const char* home = std::getenv("HOME");
  return std::filesystem::path(home && *home ? home : ".") / ".cache" / "arboretum";
}

bool CatalogueEntry::is_present() const {
  std::error_code error;
  return source == Source::generator || std::filesystem::is_regular_file(file, error);
}

std::vector<CatalogueEntry> catalogue() {
  const YamlFile file(catalogue_file());
  file.check_keys(file.root(), "the catalogue", {"scenes"});
  const YAML::Node scenes = file.need(file.root(), "scenes", "the catalogue");
  file.check_list(scenes, "scenes");
  std::vector<CatalogueEntry> entries;
  for (const YAML::Node& node : scenes) entries.push_back(read_entry(file, node));
  for (const GeneratorInfo& generator : generators()) {
    CatalogueEntry entry;
    entry.name = generator.name;
    entry.description = generator.summary;
    entry.licence = "generated";
    entry.triangles = SceneSpec{}.triangles;
    entries.push_back(std::move(entry));
  }
  return entries;
}

CatalogueEntry find_catalogue_entry(std::string_view name) {
  std::vector<std::string> names;
  for (CatalogueEntry& entry : catalogue()) {
    if (entry.name == name) return std::move(entry);
    names.push_back(entry.name);
  }
  throw UserError(unknown_name_message("scene", name, names));
}

Scene load_catalogue_scene(const CatalogueEntry& entry) {
  if (!entry.is_present()) {
    throw UserError(fmt::format("scene '{}' is not there yet ({}); bring it with: ./arboretum fetch {}", entry.name,
                                entry.file.string(), entry.name));
  }
  Scene scene = read_model(entry.file);
  rescale(scene, entry.file.string());
  sanitise(scene, entry.file.string());
  scene.name = entry.name;
  if (entry.camera) scene.camera = entry.camera;
  if (scene.report.triangles_read != entry.triangles) {
    scene.report.warnings.push_back(fmt::format("{}: {} triangles, where the catalogue says {}; fetch it again",
                                                entry.file.string(), scene.report.triangles_read, entry.triangles));
  }
  return scene;
}

}  // namespace arboretum
