// glTF and the rest through assimp, with no post-processing of its: vertices are not merged,
// polygons are split by our own code, and the node transforms are applied here.
#include <assimp/DefaultLogger.hpp>
#include <assimp/GltfMaterial.h>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <assimp/material.h>
#include <assimp/scene.h>

#include <mutex>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/polygon.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

/// Keeps what assimp says while it reads: some of its readers mend broken files and say so nowhere else.
class Listener : public Assimp::LogStream {
 public:
  explicit Listener(std::vector<std::string>& lines) : lines_(lines) {}
  void write(const char* message) override {
    if (lines_.size() < 20) lines_.push_back(one_line(message));
  }

 private:
  std::vector<std::string>& lines_;
};

/// Assimp's logger is one for the process, so reading goes one at a time.
class LogCapture {
 public:
  explicit LogCapture(std::vector<std::string>& lines) : lock_(mutex()) {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(new Listener(lines), Assimp::Logger::Warn | Assimp::Logger::Err);
  }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  ~LogCapture() { Assimp::DefaultLogger::kill(); }

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::scoped_lock<std::mutex> lock_;
};

Vec3f color(const aiColor4D& c) { return {c.r, c.g, c.b}; }

/// Assimp gives what has no material one of its own, glossy in some formats. That of glTF is what its specification
/// says.
bool is_stand_in(const aiMaterial& material) {
  aiString name;
  float metallic = 0.0f;
  return material.Get(AI_MATKEY_NAME, name) == AI_SUCCESS &&
         std::string_view(name.C_Str()) == AI_DEFAULT_MATERIAL_NAME &&
         material.Get(AI_MATKEY_METALLIC_FACTOR, metallic) != AI_SUCCESS;
}

/// `file`: of the model, to whose folder the paths of images are relative.
Material convert(const aiMaterial& in, const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path();
  Material out;
  if (aiString name; in.Get(AI_MATKEY_NAME, name) == AI_SUCCESS) out.name = name.C_Str();
  const std::string place = fmt::format("{}: material '{}':", file.string(), one_line(out.name));
  aiColor4D c;
  if (in.Get(AI_MATKEY_COLOR_DIFFUSE, c) == AI_SUCCESS) out.diffuse = color(c);
  if (in.Get(AI_MATKEY_COLOR_SPECULAR, c) == AI_SUCCESS) out.specular = color(c);
  if (in.Get(AI_MATKEY_COLOR_EMISSIVE, c) == AI_SUCCESS) out.emission = color(c);
  in.Get(AI_MATKEY_SHININESS, out.shininess);
  in.Get(AI_MATKEY_OPACITY, out.opacity);
  in.Get(AI_MATKEY_REFRACTI, out.ior);
  if (aiString map; in.GetTexture(aiTextureType_DIFFUSE, 0, &map) == AI_SUCCESS)
    out.diffuse_map = (folder / map.C_Str()).string(), out.diffuse_map_place = place;
  if (aiString map; in.GetTexture(aiTextureType_OPACITY, 0, &map) == AI_SUCCESS)
    out.opacity_map = (folder / map.C_Str()).string(), out.opacity_map_place = place;

  // The metallic-roughness model of glTF.
  float metallic = 0.0f, transmission = 0.0f;
  if (in.Get(AI_MATKEY_METALLIC_FACTOR, metallic) == AI_SUCCESS) {
    in.Get(AI_MATKEY_ROUGHNESS_FACTOR, out.roughness);
    const Vec3f base = in.Get(AI_MATKEY_BASE_COLOR, c) == AI_SUCCESS ? color(c) : out.diffuse;
    out.diffuse = base * (1.0f - metallic);
    out.specular = base * metallic + Vec3f{0.04f, 0.04f, 0.04f} * (1.0f - metallic);
    out.illum = metallic > 0.5f ? 3 : 2;
  }
  if (in.Get(AI_MATKEY_TRANSMISSION_FACTOR, transmission) == AI_SUCCESS && transmission > 0.0f) {
    out.illum = 7;
    out.transmission = Vec3f{1, 1, 1} * transmission;
    if (out.ior == 1.0f) out.ior = 1.5f;
  }
  return out;
}

class AssimpReader {
 public:
  AssimpReader(const std::filesystem::path& path, const aiScene& in) : name_(path.string()), in_(in) {}

  Scene read() {
    for (unsigned i = 0; i < in_.mNumMaterials; ++i) {
      const aiMaterial& material = *in_.mMaterials[i];
      scene_.materials.push_back(is_stand_in(material) ? Material{.name = "default"} : convert(material, name_));
    }
    if (scene_.materials.size() > 65534) throw UserError(name_ + ": more than 65534 materials");
    add_node(*in_.mRootNode, aiMatrix4x4t<double>());
    if (short_faces_ > 0)
      scene_.report.warnings.push_back(fmt::format("{}: {} point{} or line{} left out", name_, short_faces_,
                                                   short_faces_ == 1 ? "" : "s", short_faces_ == 1 ? "" : "s"));
    if (scene_.mesh.triangles.empty()) throw UserError(name_ + ": no triangle in it");
    if (!scene_.texture_coordinates.empty()) scene_.texture_coordinates.resize(scene_.mesh.size());
    return std::move(scene_);
  }

 private:
  void add_node(const aiNode& node, const aiMatrix4x4t<double>& parent) {
    const aiMatrix4x4& m = node.mTransformation;
    const aiMatrix4x4t<double> to_world = parent * aiMatrix4x4t<double>(m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4,
                                                                        m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add_mesh(*in_.mMeshes[node.mMeshes[i]], to_world);
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(*node.mChildren[i], to_world);
  }

  void add_mesh(const aiMesh& mesh, const aiMatrix4x4t<double>& to_world) {
    TriangleMesh& out = scene_.mesh;
    const std::size_t first = out.vertices.size();
    if (first + mesh.mNumVertices >= 0xffffffffu) throw UserError(name_ + ": more than 2^32 - 2 vertices");
    const bool moved = !(to_world == aiMatrix4x4t<double>());
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      const aiVector3D& v = mesh.mVertices[i];
      aiVector3t<double> p(v.x, v.y, v.z);
      if (moved) p = to_world * p;
      out.vertices.push_back({float(p.x), float(p.y), float(p.z)});
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      corners_.clear();
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] >= mesh.mNumVertices) {
          throw UserError(fmt::format("{}: face {} names vertex {}, but its mesh has {}", name_, f, face.mIndices[k],
                                      mesh.mNumVertices));
        }
        corners_.push_back(std::uint32_t(first + face.mIndices[k]));
      }
      if (corners_.size() < 3) {
        ++short_faces_;
        continue;
      }
      scene_.report.polygons_split += corners_.size() > 3;
      triangulate(corners_, out.vertices, out.triangles);
    }
    if (mesh.HasTextureCoords(0)) add_texture_coordinates(mesh, first);
    // One a triangle, whatever a file says: a mesh of no material that there is would put all later ones in disorder.
    const bool is_there = mesh.mMaterialIndex < scene_.materials.size();
    out.materials.resize(out.triangles.size(), is_there ? std::uint16_t(mesh.mMaterialIndex) : std::uint16_t{0});
  }

  /// Of the triangles since those that have some; meshes before this one without any have (0, 0).
  void add_texture_coordinates(const aiMesh& mesh, std::size_t first) {
    std::vector<TextureTriangle>& all = scene_.texture_coordinates;
    for (std::size_t i = all.size(); i < scene_.mesh.size(); ++i) {
      const Triangle& t = scene_.mesh.triangles[i];
      TextureTriangle coordinates{};
      for (std::size_t k = 0; t.a >= first && k < 3; ++k) {
        const aiVector3D& at = mesh.mTextureCoords[0][(k == 0 ? t.a : k == 1 ? t.b : t.c) - first];
        coordinates[k] = {float(at.x), float(at.y)};
      }
      all.push_back(coordinates);
    }
  }

  std::string name_;
  const aiScene& in_;
  Scene scene_;
  std::vector<std::uint32_t> corners_;
  std::size_t short_faces_ = 0;
};

/// What assimp says of a file that it cannot read, as far as a user can do something about it.
[[noreturn]] void fail(const std::filesystem::path& path, std::string_view said) {
  constexpr std::string_view kNoFile = "could not open referenced file \"";
  if (const std::size_t at = said.find(kNoFile); at != std::string_view::npos) {
    const std::string_view name = said.substr(at + kNoFile.size());
    throw UserError(fmt::format("{}: it refers to '{}', and there is no such file beside it; put that there",
                                path.string(), one_line(name.substr(0, name.find('"')))));
  }
  if (said.starts_with("GLTF: ")) said.remove_prefix(6);
  std::string reason = one_line(said);
  while (reason.ends_with('.')) reason.pop_back();
  throw UserError(fmt::format("{}: broken or truncated: {}; copy or export it anew", path.string(), reason));
}

}  // namespace

Scene read_assimp(const std::filesystem::path& path) {
  check_readable_file(path);
  std::vector<std::string> said;
  Assimp::Importer importer;
  if (const std::string extension = path.extension().string();
      extension.empty() || !importer.IsExtensionSupported(extension)) {
    throw UserError(
        fmt::format("{}: unknown kind of file '{}'; OBJ, PLY, STL, glTF, GLB, OFF and others of assimp are read",
                    path.string(), extension));
  }
  const aiScene* in = nullptr;
  try {
    const LogCapture capture(said);
    in = importer.ReadFile(path.string(), 0);
  } catch (const std::exception& error) {
    fail(path, error.what());
  }
  if (!in || !in->mRootNode) fail(path, importer.GetErrorString());
  for (const std::string& line : said) {
    if (line.find("out of range") != std::string::npos) throw UserError(path.string() + ": " + line);
  }
  if (in->mFlags & AI_SCENE_FLAGS_INCOMPLETE && in->mNumMeshes == 0)
    throw UserError(path.string() + ": no triangle in it");
  Scene scene = AssimpReader(path, *in).read();
  for (const std::string& line : said) scene.report.warnings.push_back(path.string() + ": " + line);
  return scene;
}

}  // namespace arboretum
