#include "scenes/sanitise.h"

#include <fmt/format.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "scenes/layout.h"

namespace arboretum {
namespace {

/// Why a triangle cannot be traced. Zero area: in every key frame; the others: in any.
struct Faults {
  bool non_finite = false, out_of_range = false, zero_area = true;
  [[nodiscard]] bool any() const noexcept { return non_finite || out_of_range || zero_area; }
};

Faults faults_of(const TriangleMesh& mesh, std::size_t i) {
  const Triangle& t = mesh.triangles[i];
  Faults faults;
  for (std::size_t k = 0; k < mesh.frames(); ++k) {
    const std::vector<Vec3f>& frame = mesh.frame(k);
    const Vec3f a = frame[t.a], b = frame[t.b], c = frame[t.c];
    if (!is_finite(a) || !is_finite(b) || !is_finite(c)) {
      faults.non_finite = true;
    } else if (!is_in_range(a) || !is_in_range(b) || !is_in_range(c)) {
      faults.out_of_range = true;
    } else if (faults.zero_area && !has_zero_area(a, b, c)) {
      faults.zero_area = false;
    }
  }
  return faults;
}

}  // namespace

void sanitise(Scene& scene, const std::string& source) {
  TriangleMesh& mesh = scene.mesh;
  LoadReport& report = scene.report;
  if (report.triangles_read == 0) report.triangles_read = mesh.triangles.size();  // a placed scene comes again
  const bool has_materials = mesh.materials.size() == mesh.triangles.size();
  if (!has_materials) mesh.materials.clear();
  const bool has_texture_coordinates = scene.texture_coordinates.size() == mesh.triangles.size();
  if (!has_texture_coordinates) scene.texture_coordinates.clear();
  std::vector<bool> stays(mesh.size());
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Faults faults = faults_of(mesh, i);
    stays[i] = !faults.any();
    if (faults.non_finite) {
      ++report.non_finite;
    } else if (faults.out_of_range) {
      ++report.out_of_range;
    } else if (faults.zero_area) {
      ++report.degenerate;
    }
  }
  if (mesh.instancing) mesh.instancing = kept_instances(mesh, stays);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    if (!stays[i]) continue;
    mesh.triangles[kept] = mesh.triangles[i];
    if (has_materials) mesh.materials[kept] = mesh.materials[i];
    if (has_texture_coordinates) scene.texture_coordinates[kept] = scene.texture_coordinates[i];
    ++kept;
  }
  mesh.triangles.resize(kept);
  if (has_materials) mesh.materials.resize(kept);
  if (has_texture_coordinates) scene.texture_coordinates.resize(kept);
  const auto mend = [](std::vector<Vec3f>& vertices) {
    for (Vec3f& v : vertices)
      if (!is_finite(v) || !is_in_range(v)) v = Vec3f{};
  };
  mend(mesh.vertices);
  for (std::vector<Vec3f>& frame : mesh.later_frames) mend(frame);
  if (kept == 0) {
    throw UserError(fmt::format("{}: no triangle left: of {} read, {} are not finite, {} out of range, {} of zero area",
                                source, report.triangles_read, report.non_finite, report.out_of_range,
                                report.degenerate));
  }
  if (scene.materials.empty()) {
    scene.materials.push_back(Material{.name = "default"});
    mesh.materials.clear();
  }
}

std::string dropped_in_words(const LoadReport& report) {
  std::string reasons;
  const auto add = [&](std::size_t count, const char* what) {
    if (count > 0) reasons += fmt::format("{}{} {}", reasons.empty() ? "" : ", ", count, what);
  };
  add(report.non_finite, "with NaN or infinity"), add(report.out_of_range, "out of range");
  add(report.degenerate, "of zero area");
  if (reasons.empty()) return {};
  return fmt::format("dropped {} of {} triangles: {}", report.non_finite + report.out_of_range + report.degenerate,
                     report.triangles_read, reasons);
}

}  // namespace arboretum
