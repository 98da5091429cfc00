// Cases files: rays with their exact answers, in the format of tests/hard_cases.json.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

struct VerifyCase {
  std::string id, why;
  TriangleMesh mesh;               ///< what a loader keeps: triangles with a corner that is not finite are left out
  std::vector<std::uint32_t> ids;  ///< of the mesh's triangles, in the file
  Ray ray;
};

/// Reads `{"cases": [{"id", "triangles": [[[x, y, z] x 3] ...], "origin", "direction", "tnear", "tfar", "hit", "t",
/// "nearest_ids", "closed_hits", "why", "source"} ...]}`; numbers are float32 in decimal, or "inf", "-inf", "nan".
/// tnear is 0 and tfar infinite where they are left out; hit, t (of a miss null), nearest_ids and closed_hits may be
/// left out, and where they are given must be what exact arithmetic finds, each by itself. Throws UserError, for a key
/// of another name too.
[[nodiscard]] std::vector<VerifyCase> read_case_file(const std::filesystem::path& file);

/// A case of the format on one line, with the exact answers filled in.
[[nodiscard]] std::string case_json(const std::string& id, const std::string& why, const TriangleMesh& mesh,
                                    const Ray& ray);

/// A ray alone, on one line: of what no case could be made of. `id` tells the scene and the ray's number in it.
[[nodiscard]] std::string ray_json(const std::string& id, const std::string& why, const Ray& ray, float time);

}  // namespace arboretum
