#include "scenes/yaml_node.h"

#include <cmath>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "core/error.h"
#include "core/names.h"
#include "scenes/file_bytes.h"
#include "scenes/readers.h"
#include "scenes/vec3d.h"

namespace arboretum {
namespace {

/// A tab outside a comment is refused: YAML forbids it as indentation, and yaml-cpp reads some as something
/// else.
void refuse_tabs(const std::string& text, const std::filesystem::path& file) {
  std::size_t line = 1;
  bool comment = false;
  char before = '\n';
  for (char c : text) {
    if (c == '\n')
      ++line, comment = false;
    else if (c == '#' && (before == ' ' || before == '\n' || before == '\t'))
      comment = true;
    else if (c == '\t' && !comment) {
      throw UserError(
          fmt::format("{}:{}: a tab; YAML is indented with spaces: put spaces in its place", file.string(), line));
    }
    before = c;
  }
}

std::vector<YAML::Node> read_documents(const std::string& text, const std::filesystem::path& file) {
  refuse_tabs(text, file);
  if (text.find('\0') != std::string::npos)
    throw UserError(fmt::format("{}: holds zero bytes, so it is no YAML text", file.string()));
  try {
    return YAML::LoadAll(text);
  } catch (const YAML::Exception& error) {
    throw UserError(fmt::format("{}:{}: not valid YAML: {}; mend the line or the one above it", file.string(),
                                error.mark.line + 1, one_line(error.msg)));
  }
}

}  // namespace

YAML::Node read_document(const std::string& text, const std::filesystem::path& path, std::string_view what) {
  const std::vector<YAML::Node> documents = read_documents(text, path);
  if (documents.size() > 1)
    throw UserError(fmt::format("{}: {} YAML documents; {} is one: put the others into files of their own",
                                path.string(), documents.size(), what));
  return documents.empty() ? YAML::Node() : documents.front();
}

YamlFile::YamlFile(std::filesystem::path path) : path_(std::move(path)) {
  const FileBytes bytes(path_);
  root_ = read_document(std::string(bytes.text()), path_, "a scene");
  if (!root_.IsMap())
    throw UserError(path_.string() + ": is no scene file: expected keys such as 'meshes:' at its top");
}

void YamlFile::fail(const YAML::Node& node, const std::string& what) const {
  const int line = node.Mark().line + 1;
  throw UserError(line > 0 ? fmt::format("{}:{}: {}", path_.string(), line, what)
                           : fmt::format("{}: {}", path_.string(), what));
}

void YamlFile::check_keys(const YAML::Node& node, std::string_view what,
                          std::initializer_list<const char*> keys) const {
  if (!node.IsMap()) fail(node, fmt::format("{} must be a map of keys and values", what));
  const std::vector<std::string> valid(keys.begin(), keys.end());
  std::set<std::string> seen;
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) fail(entry.first, fmt::format("a key of {} is no word", what));
    const std::string& key = entry.first.Scalar();
    if (std::find(valid.begin(), valid.end(), key) == valid.end())
      fail(entry.first, unknown_name_message(fmt::format("key of {}", what), one_line(key), valid));
    if (!seen.insert(key).second) fail(entry.first, fmt::format("{} names '{}' twice", what, key));
  }
}

YAML::Node YamlFile::need(const YAML::Node& map, const char* key, std::string_view what) const {
  const YAML::Node value = map[key];
  if (!value || value.IsNull()) fail(map, fmt::format("{} needs '{}'", what, key));
  return value;
}

void YamlFile::check_list(const YAML::Node& node, std::string_view what) const {
  if (!node.IsSequence() || node.size() == 0) fail(node, fmt::format("{} must be a list with something in it", what));
}

std::string YamlFile::text(const YAML::Node& node, std::string_view what) const {
  if (!node.IsScalar() || node.Scalar().empty()) fail(node, fmt::format("{} must be a text", what));
  return node.Scalar();
}

double YamlFile::number(const YAML::Node& node, std::string_view what) const {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(float(value))) {
    fail(node, fmt::format("{} must be a finite number{}", what,
                           node.IsScalar() ? ", not '" + one_line(node.Scalar()) + "'" : ""));
  }
  return value;
}

std::uint64_t YamlFile::count(const YAML::Node& node, std::string_view what, std::uint64_t at_most) const {
  const double value = number(node, what);
  if (value < 1.0 || value != std::floor(value) || value > double(at_most))
    fail(node, fmt::format("{} must be a whole number from 1 to {}", what, at_most));
  return std::uint64_t(value);
}

bool YamlFile::boolean(const YAML::Node& node, std::string_view what) const {
  bool value = false;
  if (!node.IsScalar() || !YAML::convert<bool>::decode(node, value))
    fail(node, fmt::format("{} must be true or false", what));
  return value;
}

Vec3f YamlFile::vec3(const YAML::Node& node, std::string_view what) const {
  if (!node.IsSequence() || node.size() != 3) fail(node, fmt::format("{} must be a list of three numbers", what));
  return {float(number(node[0], what)), float(number(node[1], what)), float(number(node[2], what))};
}

Vec3f YamlFile::color(const YAML::Node& node, std::string_view what) const {
  Vec3f value;
  if (node.IsScalar()) {
    const float grey = float(number(node, what));
    value = {grey, grey, grey};
  } else {
    value = vec3(node, what);
  }
  if (value.x < 0 || value.y < 0 || value.z < 0) fail(node, fmt::format("{} must not be negative", what));
  return value;
}

Camera YamlFile::camera(const YAML::Node& node) const {
  check_keys(
      node, "camera",
      {"position", "look_at", "up", "vertical_fov", "mirror_x", "resolution", "aperture_radius", "focus_distance"});
  Camera camera;
  camera.position = vec3(need(node, "position", "camera"), "camera position");
  camera.look_at = vec3(need(node, "look_at", "camera"), "camera look_at");
  if (node["up"]) camera.up = vec3(node["up"], "camera up");
  const Vec3d forward = Vec3d(camera.look_at) - Vec3d(camera.position);
  if (!(length(forward) > 0.0)) fail(node, "camera position and look_at are the same point");
  if (!(length(cross(normalize(forward), Vec3d(camera.up))) > 1e-6 * length(Vec3d(camera.up))))
    fail(node, "camera up is zero or parallel to the view");
  if (node["vertical_fov"]) camera.vertical_fov = float(number(node["vertical_fov"], "camera vertical_fov"));
  if (!(camera.vertical_fov > 0.0f && camera.vertical_fov < 180.0f))
    fail(node["vertical_fov"], "camera vertical_fov must lie between 0 and 180 degrees");
  if (node["mirror_x"]) camera.mirror_x = boolean(node["mirror_x"], "camera mirror_x");
  if (const YAML::Node resolution = node["resolution"]) {
    if (!resolution.IsSequence() || resolution.size() != 2)
      fail(resolution, "camera resolution must be [width, height]");
    camera.width = unsigned(count(resolution[0], "camera width", 65536));
    camera.height = unsigned(count(resolution[1], "camera height", 65536));
  }
  for (const auto& [key, value] :
       {std::pair{"aperture_radius", &camera.aperture_radius}, {"focus_distance", &camera.focus_distance}}) {
    if (!node[key]) continue;
    *value = float(number(node[key], fmt::format("camera {}", key)));
    if (*value < 0.0f) fail(node[key], fmt::format("camera {} must not be negative", key));
  }
  // A pinhole camera has everything in focus: exporters write 0 for it.
  if (camera.aperture_radius > 0.0f && camera.focus_distance == 0.0f)
    fail(node["focus_distance"] ? node["focus_distance"] : node,
         "a camera with an aperture_radius needs a focus_distance above 0");
  return camera;
}

Light YamlFile::light(const YAML::Node& node) const {
  if (!node.IsMap()) fail(node, "a light must be a map with a 'type'");
  const std::string type = text(need(node, "type", "a light"), "a light's type");
  Light light;
  if (type == "point") {
    check_keys(node, "a point light", {"type", "position", "intensity"});
  } else if (type == "directional") {
    light.type = Light::Type::directional;
    check_keys(node, "a directional light", {"type", "direction", "intensity"});
  } else if (type == "spot") {
    light.type = Light::Type::spot;
    check_keys(node, "a spot light", {"type", "position", "direction", "intensity", "cone_degrees"});
  } else {
    const std::vector<std::string> types{"point", "directional", "spot"};
    fail(node["type"], unknown_name_message("light type", one_line(type), types));
  }
  if (light.type != Light::Type::directional)
    light.position = vec3(need(node, "position", "a " + type + " light"), "a light's position");
  if (light.type != Light::Type::point) {
    light.direction = vec3(need(node, "direction", "a " + type + " light"), "a light's direction");
    if (light.direction == Vec3f{0, 0, 0}) fail(node["direction"], "a light's direction must not be zero");
  }
  if (node["intensity"]) light.intensity = color(node["intensity"], "a light's intensity");
  if (node["cone_degrees"]) {
    light.cone_degrees = float(number(node["cone_degrees"], "cone_degrees"));
    if (!(light.cone_degrees > 0.0f && light.cone_degrees <= 180.0f))
      fail(node["cone_degrees"], "cone_degrees must lie within (0, 180]");
  }
  return light;
}

}  // namespace arboretum
