// Reader of tests/hard_cases.json: rays that broke somebody's intersector, each with its exact answer.
#pragma once

#include <cstdint>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

struct HardCase {
  std::string id, why, source;
  TriangleMesh mesh;  ///< three vertices of its own for each triangle
  Ray ray;
  bool hit = false;
  double t = 0.0;                          ///< the exact t rounded to double; only where hit
  std::vector<std::uint32_t> nearest_ids;  ///< all that share the exact nearest t, ascending
  std::size_t closed_hits = 0;             ///< closed triangles met within the closed interval
};

/// A float32 in decimal, or one of the strings "inf", "-inf", "nan".
[[nodiscard]] inline float hard_case_number(const nlohmann::json& value) {
  if (value.is_number()) return static_cast<float>(value.get<double>());
  const std::string text = value.get<std::string>();
  if (text == "inf") return std::numeric_limits<float>::infinity();
  if (text == "-inf") return -std::numeric_limits<float>::infinity();
  if (text == "nan") return std::numeric_limits<float>::quiet_NaN();
  throw std::runtime_error("hard_cases.json: '" + text + "' is no number, inf, -inf or nan");
}

[[nodiscard]] inline Vec3f hard_case_point(const nlohmann::json& value) {
  return {hard_case_number(value.at(0)), hard_case_number(value.at(1)), hard_case_number(value.at(2))};
}

/// Throws where the file is missing or not what it should be.
[[nodiscard]] inline std::vector<HardCase> load_hard_cases(const std::string& path = ARBORETUM_SOURCE_DIR
                                                           "/tests/hard_cases.json") {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<HardCase> cases;
  const nlohmann::json document = nlohmann::json::parse(file);
  for (const nlohmann::json& entry : document.at("cases")) {
    HardCase c;
    c.id = entry.at("id"), c.why = entry.at("why"), c.source = entry.at("source");
    for (const nlohmann::json& triangle : entry.at("triangles")) {
      const auto first = static_cast<std::uint32_t>(c.mesh.vertices.size());
      for (int k = 0; k < 3; ++k) c.mesh.vertices.push_back(hard_case_point(triangle.at(k)));
      c.mesh.triangles.push_back({first, first + 1, first + 2});
    }
    c.ray = {hard_case_point(entry.at("origin")), hard_case_number(entry.at("tnear")),
             hard_case_point(entry.at("direction")), hard_case_number(entry.at("tfar"))};
    c.hit = entry.at("hit");
    if (c.hit) c.t = entry.at("t");
    c.nearest_ids = entry.at("nearest_ids").get<std::vector<std::uint32_t>>();
    c.closed_hits = entry.at("closed_hits");
    cases.push_back(std::move(c));
  }
  return cases;
}

}  // namespace arboretum
