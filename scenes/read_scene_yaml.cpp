// Scene files: YAML -> one Scene, instances laid out in one mesh and kept beside it, key frames kept.
#include <Eigen/Geometry>

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "core/error.h"
#include "core/names.h"
#include "scenes/images.h"
#include "scenes/layout.h"
#include "scenes/readers.h"
#include "scenes/yaml_node.h"

namespace arboretum {
namespace {

using Transform = Eigen::Affine3d;

AffineMap as_map(const Transform& t) {
  AffineMap map;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) map.m[row][column] = t.matrix()(row, column);
  return map;
}

/// Cell names are parted by '/'.
std::string name_of(const YamlFile& file) {
  const YAML::Node node = file.root()["name"];
  if (!node) return one_line(file.path().stem().string());
  for (const auto& entry : file.root())  // what is not there has the next line for its place
    if (entry.first.IsScalar() && entry.first.Scalar() == "name" && entry.second.IsNull())
      file.fail(entry.first, "name has no value; give one or take the line out");
  const std::string name = file.text(node, "name");
  const auto is_bad = [](unsigned char c) { return c == '/' || c < ' ' || c == 127; };
  if (std::ranges::any_of(name, is_bad) || name.find_first_not_of(' ') == std::string::npos)
    file.fail(node, fmt::format("name '{}' cannot be a part of a cell's name: leave out '/' and control characters, "
                                "and have more than blanks",
                                one_line(name)));
  return name;
}

class SceneFile {
 public:
  explicit SceneFile(const std::filesystem::path& path) : file_(path) {}

  Scene read() {
    const YAML::Node& root = file_.root();
    file_.check_keys(root, "the scene",
                     {"name", "source", "meshes", "camera", "shutter", "environment", "lights", "instances"});
    scene_.name = name_of(file_);
    if (root["source"]) static_cast<void>(file_.text(root["source"], "source"));
    if (root["camera"]) scene_.camera = file_.camera(root["camera"]);
    if (root["shutter"]) read_shutter(root["shutter"]);
    if (root["environment"]) read_environment(root["environment"]);
    if (root["lights"]) {
      file_.check_list(root["lights"], "lights");
      for (const YAML::Node& node : root["lights"]) scene_.lights.push_back(file_.light(node));
    }
    read_meshes(file_.need(root, "meshes", "the scene"));
    lay_out(root["instances"]);
    settle_motion(root["shutter"]);
    return std::move(scene_);
  }

 private:
  struct Part {
    std::string name;
    Scene model;
    std::size_t first_material = 0;
    bool instanced = false;
  };

  /// What `read` throws gets file and line of the node that names what is read.
  template <class Read>
  auto at(const YAML::Node& node, const Read& read) {
    try {
      return read();
    } catch (const UserError& e) {
      file_.fail(node, e.what());
    }
  }

  void read_shutter(const YAML::Node& node) {
    if (!node.IsSequence() || node.size() != 2) file_.fail(node, "shutter must be [open, close]");
    scene_.shutter = {float(file_.number(node[0], "shutter open")), float(file_.number(node[1], "shutter close"))};
    const auto [open, close] = scene_.shutter;
    if (close < open) file_.fail(node, "the shutter closes before it opens");
    if (!(open >= 0.0f && close <= 1.0f))
      file_.fail(
          node,
          fmt::format("the shutter [{:g}, {:g}] must lie within [0, 1], the time from the first key frame to the last",
                      open, close));
  }

  void read_environment(const YAML::Node& node) {
    file_.check_keys(node, "environment", {"radiance", "image"});
    if (bool(node["radiance"]) == bool(node["image"]))
      file_.fail(node, "environment needs either 'radiance' or 'image'");
    if (node["radiance"]) {
      scene_.environment = file_.color(node["radiance"], "environment radiance");
      return;
    }
    const std::filesystem::path image = file_.beside(file_.text(node["image"], "environment image"));
    scene_.environment = at(node["image"], [&] { return mean_radiance(read_radiance(image)); });
    scene_.environment_image = image.string();
  }

  void read_meshes(const YAML::Node& node) {
    file_.check_list(node, "meshes");
    for (const YAML::Node& entry : node) {
      std::vector<std::string> frames;
      std::vector<YAML::Node> places;  // of the frames
      std::string name;
      if (entry.IsScalar()) {
        frames.push_back(file_.text(entry, "a mesh")), places.push_back(entry);
      } else {
        file_.check_keys(entry, "a mesh", {"file", "keyframes", "name"});
        if (bool(entry["file"]) == bool(entry["keyframes"]))
          file_.fail(entry, "a mesh is a path, {file: path} or {keyframes: [paths]}");
        if (entry["name"]) name = file_.text(entry["name"], "a mesh's name");
        if (entry["file"])
          frames.push_back(file_.text(entry["file"], "a mesh's file")), places.push_back(entry["file"]);
        if (entry["keyframes"]) {
          file_.check_list(entry["keyframes"], "keyframes");
          for (const YAML::Node& frame : entry["keyframes"])
            frames.push_back(file_.text(frame, "a key frame")), places.push_back(frame);
        }
      }
      if (name.empty()) name = std::filesystem::path(frames.front()).stem().string();
      Part part{.name = name,
                .model = at(places.front(), [&] { return read_model(file_.beside(frames.front())); }),
                .first_material = 0,
                .instanced = false};
      read_key_frames(entry, frames, places, part.model);
      parts_.push_back(std::move(part));
    }
  }

  /// The later frames must have the first one's triangles, corner by corner.
  void read_key_frames(const YAML::Node& node, const std::vector<std::string>& frames,
                       const std::vector<YAML::Node>& places, Scene& first) {
    for (std::size_t i = 1; i < frames.size(); ++i) {
      Scene frame = at(places[i], [&] { return read_model(file_.beside(frames[i])); });
      if (frame.mesh.triangles != first.mesh.triangles || frame.mesh.vertices.size() != first.mesh.vertices.size())
        file_.fail(node, fmt::format("key frame '{}' has other triangles than '{}'", frames[i], frames[0]));
      first.mesh.later_frames.push_back(std::move(frame.mesh.vertices));
    }
    scene_.key_frames = std::max(scene_.key_frames, unsigned(frames.size()));
  }

  /// A shutter that never opens shows one moment: the scene stands still.
  void settle_motion(const YAML::Node& shutter) {
    if (!scene_.mesh.moves()) return;
    const auto [open, close] = scene_.shutter;
    if (open < close) return;
    scene_.mesh = pose(scene_.mesh, open);
    scene_.report.warnings.push_back(
        fmt::format("{}: {} key frames, but {}: all stand as at time {:g}", file_.path().string(), scene_.key_frames,
                    shutter ? "the shutter never opens" : "no shutter: [open, close]", open));
  }

  /// Meshes that an instance names appear where their instances say, the others once where they are.
  void lay_out(const YAML::Node& instances) {
    for (Part& part : parts_) {
      part.first_material = scene_.materials.size();
      if (part.model.materials.empty()) part.model.materials.push_back(Material{.name = "default"});
      scene_.materials.insert(scene_.materials.end(), part.model.materials.begin(), part.model.materials.end());
      LoadReport& from = part.model.report;
      scene_.report.polygons_split += from.polygons_split;
      scene_.report.warnings.insert(scene_.report.warnings.end(), from.warnings.begin(), from.warnings.end());
    }
    if (scene_.materials.size() > 65535) throw UserError(file_.path().string() + ": more than 65535 materials");
    std::vector<std::pair<std::size_t, Transform>> placed;
    if (instances) {
      file_.check_list(instances, "instances");
      for (const YAML::Node& node : instances) {
        file_.check_keys(node, "an instance", {"mesh", "transforms"});
        const std::size_t part = find_part(file_.need(node, "mesh", "an instance"));
        const YAML::Node transforms = file_.need(node, "transforms", "an instance");
        file_.check_list(transforms, "transforms");
        for (const YAML::Node& t : transforms) placed.emplace_back(part, transform(t));
        parts_[part].instanced = true;
      }
      scene_.instances = placed.size();
    }
    for (std::size_t i = 0; i < parts_.size(); ++i)
      if (!parts_[i].instanced) placed.emplace_back(i, Transform::Identity());
    lay_out_texture_coordinates(placed);
    Layout layout;
    for (Part& part : parts_) layout.add_part(std::move(part.model.mesh));
    for (const auto& [part, t] : placed) layout.place(std::uint32_t(part), as_map(t), parts_[part].first_material);
    scene_.mesh = layout.take(scene_.instances > 0);
  }

  /// In the order of the triangles; a mesh without any has (0, 0) where others have some.
  void lay_out_texture_coordinates(const std::vector<std::pair<std::size_t, Transform>>& placed) {
    std::vector<TextureTriangle>& all = scene_.texture_coordinates;
    std::size_t triangles = 0;
    for (const auto& [part, transform] : placed) {
      const Scene& model = parts_[part].model;
      if (!model.texture_coordinates.empty()) {
        all.resize(triangles);
        all.insert(all.end(), model.texture_coordinates.begin(), model.texture_coordinates.end());
      }
      triangles += model.mesh.size();
    }
    if (!all.empty()) all.resize(triangles);
  }

  std::size_t find_part(const YAML::Node& node) {
    const std::string word = file_.text(node, "an instance's mesh");
    std::vector<std::string> names;
    std::vector<std::size_t> meant;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      if (parts_[i].name == word) meant.push_back(i);
      names.push_back(parts_[i].name);
    }
    if (meant.size() > 1)
      file_.fail(node, fmt::format("{} meshes are called '{}'; give them names, as {{file: path, name: other}}",
                                   meant.size(), one_line(word)));
    if (!meant.empty()) return meant.front();
    if (unsigned index = 0; YAML::convert<unsigned>::decode(node, index)) {
      if (index < parts_.size()) return index;
      file_.fail(node, fmt::format("mesh {} does not exist: there are {}, counted from 0", index, parts_.size()));
    }
    file_.fail(node, unknown_name_message("mesh", one_line(word), names));
  }

  /// 16 numbers, row by row; or scaled, then rotated about an axis through the origin, then translated.
  Transform transform(const YAML::Node& node) {
    Transform result = Transform::Identity();
    if (node.IsSequence()) {
      if (node.size() != 16)
        file_.fail(node, fmt::format("a transform has 16 numbers, row by row, not {}", node.size()));
      for (int i = 0; i < 16; ++i)
        result.matrix()(i / 4, i % 4) = file_.number(node[std::size_t(i)], "a transform's element");
      if (result.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1))
        file_.fail(node, "a transform's last row must be 0 0 0 1");
    } else {
      file_.check_keys(node, "a transform", {"translate", "rotate", "scale"});
      if (const YAML::Node t = node["translate"]) {
        const Vec3f v = file_.vec3(t, "translate");
        result.translate(Eigen::Vector3d(v.x, v.y, v.z));
      }
      if (const YAML::Node r = node["rotate"]) {
        file_.check_keys(r, "rotate", {"axis", "degrees"});
        const Vec3f axis = file_.vec3(file_.need(r, "axis", "rotate"), "rotate axis");
        if (axis == Vec3f{0, 0, 0}) file_.fail(r, "rotate axis must not be zero");
        const double degrees = file_.number(file_.need(r, "degrees", "rotate"), "rotate degrees");
        result.rotate(
            Eigen::AngleAxisd(degrees * EIGEN_PI / 180.0, Eigen::Vector3d(axis.x, axis.y, axis.z).normalized()));
      }
      if (const YAML::Node s = node["scale"]) {
        Vec3f v;
        if (s.IsScalar())
          v = Vec3f{1, 1, 1} * float(file_.number(s, "scale"));
        else
          v = file_.vec3(s, "scale");
        result.scale(Eigen::Vector3d(v.x, v.y, v.z));
      }
    }
    if (result.linear().determinant() == 0.0) file_.fail(node, "a transform flattens its mesh: its determinant is 0");
    return result;
  }

  YamlFile file_;
  Scene scene_;
  std::vector<Part> parts_;
};

}  // namespace

Scene read_scene_yaml(const std::filesystem::path& path) { return SceneFile(path).read(); }

std::string scene_file_name(const std::filesystem::path& path) { return name_of(YamlFile(path)); }

bool scene_file_moves(const std::filesystem::path& path) {
  const YamlFile file(path);
  const YAML::Node shutter = file.root()["shutter"], meshes = file.root()["meshes"];
  if (!shutter || !shutter.IsSequence() || shutter.size() != 2 || !meshes || !meshes.IsSequence()) return false;
  if (!(file.number(shutter[0], "shutter open") < file.number(shutter[1], "shutter close"))) return false;
  return std::any_of(meshes.begin(), meshes.end(), [](const YAML::Node& mesh) {
    return mesh.IsMap() && mesh["keyframes"] && mesh["keyframes"].size() > 1;
  });
}

}  // namespace arboretum
