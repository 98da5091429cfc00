// Readers: one model file in, one Scene out. They check that indices are in range and leave the rest of the
// sanitising (non-finite, out of range, zero area) to scenes/sanitise.h.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/scene.h"

namespace arboretum {

/// Wavefront OBJ through tinyobjloader, materials of its mtllib included. Throws UserError.
[[nodiscard]] Scene read_obj(const std::filesystem::path& path);
/// PLY, ASCII or binary. A `material_id` of a face indexes the materials of the MTL file of the same stem.
/// Throws UserError.
[[nodiscard]] Scene read_ply(const std::filesystem::path& path);
/// STL, binary or text, and OFF as text. Throw UserError.
[[nodiscard]] Scene read_stl(const std::filesystem::path& path);
[[nodiscard]] Scene read_off(const std::filesystem::path& path);
/// glTF, GLB and whatever else assimp knows, node transforms applied. Throws UserError.
[[nodiscard]] Scene read_assimp(const std::filesystem::path& path);
/// Materials in the file's order. Warnings of the parser are appended, one line each.
[[nodiscard]] std::vector<Material> read_mtl(const std::filesystem::path& path, std::vector<std::string>& warnings);
/// A scene file of the project. Throws UserError.
[[nodiscard]] Scene read_scene_yaml(const std::filesystem::path& path);
/// Its `name:`, or the file's stem where it gives none; models are not read. Throws UserError for a name that cannot be
/// part of a cell's.
[[nodiscard]] std::string scene_file_name(const std::filesystem::path& path);
/// Whether a mesh of the scene file has key frames and its shutter opens; models are not read.
[[nodiscard]] bool scene_file_moves(const std::filesystem::path& path);

/// Any model by its extension, not sanitised.
[[nodiscard]] Scene read_model(const std::filesystem::path& path);

/// The warning that so many faces of a file are left out.
[[nodiscard]] std::string short_faces_warning(const std::filesystem::path& path, std::size_t faces);

/// A file that a model names, relative to the model's folder; a backslash parts folders as '/' does.
[[nodiscard]] std::filesystem::path beside(const std::filesystem::path& file, std::string name);

/// A library's message, or a word of a file, fit for one line: control characters made spaces, each byte that is no
/// part of UTF-8 made '?'.
[[nodiscard]] std::string one_line(std::string_view text);

}  // namespace arboretum
