// Strict reading of YAML for scene files and the catalogue: every fault is one line with file and line
// number.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

#include "core/vec3.h"
#include "scenes/scene.h"

namespace arboretum {

/// The YAML document that `text` is; null where it is empty. `what`: the kind of file, "a scene", for messages. Throws
/// UserError where it is none, or there are several.
[[nodiscard]] YAML::Node read_document(const std::string& text, const std::filesystem::path& path,
                                       std::string_view what);

class YamlFile {
 public:
  /// Reads the file; its root must be a map. Throws UserError.
  explicit YamlFile(std::filesystem::path path);

  [[nodiscard]] const YAML::Node& root() const noexcept { return root_; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// `name`, relative to the folder of the file.
  [[nodiscard]] std::filesystem::path beside(const std::string& name) const { return path_.parent_path() / name; }

  [[noreturn]] void fail(const YAML::Node& node, const std::string& what) const;
  /// Fails unless `node` is a map whose keys are all among `keys`, each once. `what` names the map in the
  /// message.
  void check_keys(const YAML::Node& node, std::string_view what, std::initializer_list<const char*> keys) const;
  /// The value of a key that must be there.
  [[nodiscard]] YAML::Node need(const YAML::Node& map, const char* key, std::string_view what) const;
  void check_list(const YAML::Node& node, std::string_view what) const;

  [[nodiscard]] std::string text(const YAML::Node& node, std::string_view what) const;
  /// A finite number.
  [[nodiscard]] double number(const YAML::Node& node, std::string_view what) const;
  [[nodiscard]] std::uint64_t count(const YAML::Node& node, std::string_view what, std::uint64_t at_most) const;
  [[nodiscard]] bool boolean(const YAML::Node& node, std::string_view what) const;
  [[nodiscard]] Vec3f vec3(const YAML::Node& node, std::string_view what) const;
  /// Three numbers, or one that stands for all three; none negative.
  [[nodiscard]] Vec3f color(const YAML::Node& node, std::string_view what) const;
  /// `{position, look_at, up, vertical_fov, mirror_x, resolution, aperture_radius, focus_distance}`.
  [[nodiscard]] Camera camera(const YAML::Node& node) const;
  /// `{type, position, direction, intensity, cone_degrees}`, of which each type has its own.
  [[nodiscard]] Light light(const YAML::Node& node) const;

 private:
  std::filesystem::path path_;
  YAML::Node root_;
};

}  // namespace arboretum
