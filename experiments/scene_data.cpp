#include "experiments/scene_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "core/error.h"
#include "core/timer.h"
#include "experiments/exclusion.h"
#include "experiments/fnv.h"
#include "experiments/sampling.h"
#include "oracle/hard_rays.h"
#include "rendering/hard_workload.h"
#include "scenes/file_bytes.h"
#include "scenes/sanitise.h"
#include "scenes/vec3d.h"
#include "structures/structure_file.h"

namespace arboretum {
namespace {

/// Longest edge over the height on it.
double median_aspect(const TriangleMesh& mesh) {
  std::vector<double> aspects;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto c = mesh.corners(i);
    const Vec3d a(c[0]), b(c[1]), d(c[2]);
    const double longest = std::max({length(b - a), length(d - b), length(a - d)});
    aspects.push_back(longest * longest / length(cross(b - a, d - a)));
  }
  return median(aspects);
}

template <class T>
std::uint64_t hash_of_all(const std::vector<T>& values, std::uint64_t before) {
  const auto bytes = std::as_bytes(std::span(values));
  return fnv1a({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, before);
}

/// Of what it holds and not of its path: parts of a sweep find their files in different folders.
std::uint64_t hash_of_image(const std::string& path) {
  try {
    return fnv1a(FileBytes(path).text());
  } catch (const UserError&) {
    return 0;  // what wears it goes without
  }
}

}  // namespace

SceneData::SceneData(const SceneChoice& choice, const MeasureSettings& measure, NoteFunction note)
    : name_(choice.name), view_{.width = measure.width, .height = measure.height, .seed = measure.seed},
      note_(std::move(note)) {
  if (!note_) note_ = [this](const std::string& line) { waiting_.push_back(line); };
  const double begin = wall_seconds();
  scene_ = load_scene(choice.spec);
  if (!choice.placing.label.empty()) place(choice.placing);
  note_(fmt::format("{}: {} triangles, loaded in {:.2f} s", name_, mesh().size(), wall_seconds() - begin));
  if (const std::string dropped = dropped_in_words(scene_.report); !dropped.empty())
    note_(fmt::format("{}: {}", name_, dropped));
  for (const std::string& warning : scene_.report.warnings) note_(fmt::format("{}: {}", name_, warning));
}

std::string SceneData::geometry() const {
  const auto words = [](const Vec3f& v) { return fmt::format("{} {} {} ", v.x, v.y, v.z); };
  std::map<std::string, std::uint64_t> images;  // materials share them
  const auto image = [&](const std::string& path) {
    if (path.empty()) return std::string();
    const auto [known, fresh] = images.try_emplace(path);
    if (fresh) known->second = hash_of_image(path);
    return fmt::format("image {:x} ", known->second);
  };
  std::string rest;
  if (const std::optional<Camera>& c = scene_.camera) {
    rest += words(c->position) + words(c->look_at) + words(c->up) +
            fmt::format("{} {} {} {} {} {} ", c->vertical_fov, c->mirror_x, c->width, c->height, c->aperture_radius,
                        c->focus_distance);
  }
  for (const Light& l : scene_.lights)
    rest += fmt::format("light {} {} ", int(l.type), l.cone_degrees) + words(l.position) + words(l.direction) +
            words(l.intensity);
  if (scene_.environment != Vec3f{0, 0, 0}) rest += "environment " + words(scene_.environment);
  for (const Material& m : scene_.materials) {
    rest += "material " + words(m.diffuse) + words(m.specular) + words(m.emission) + words(m.transmission) +
            fmt::format("{} {} {} {} {} ", m.shininess, m.roughness, m.ior, m.opacity, m.illum) + image(m.diffuse_map) +
            (m.opacity_map.empty() ? "" : "of opacity ") + image(m.opacity_map);
  }
  const auto [open, close] = scene_.shutter;
  if (open != 0.0f || close != 0.0f) rest += fmt::format("shutter {} {} ", open, close);
  rest += image(scene_.environment_image);
  const std::uint64_t hash = hash_of_all(mesh().materials, fnv1a(rest, hash_of(mesh())));
  return fmt::format("{:016x}", hash_of_all(scene_.texture_coordinates, hash));
}

Json SceneData::load_report() const {
  const LoadReport& report = scene_.report;
  Json json{{"triangles", mesh().size()}, {"triangles_read", report.triangles_read}};
  json["dropped"] =
      Json{{"non_finite", report.non_finite}, {"out_of_range", report.out_of_range}, {"degenerate", report.degenerate}};
  if (const std::string dropped = dropped_in_words(report); !dropped.empty()) json["dropped_in_words"] = dropped;
  if (!report.warnings.empty()) json["warnings"] = report.warnings;
  return json;
}

std::vector<std::string> dropped_warnings(const Json& scenes) {
  std::vector<std::string> warnings;
  for (const auto& [name, report] : scenes.items()) {
    const Json dropped = report.value("dropped", Json::object());
    if (dropped.value("non_finite", 0) + dropped.value("out_of_range", 0) > 0)
      warnings.push_back(fmt::format("{}: {}", name, report.value("dropped_in_words", "")));
  }
  return warnings;
}

void SceneData::note_to(NoteFunction note) {
  note_ = std::move(note);
  for (const std::string& line : waiting_) note_(line);
  waiting_.clear();
}

void SceneData::place(const Placing& placing) {
  const std::array<double, 3> by = displacement(placing.offset);
  const auto move = [&](std::vector<Vec3f>& vertices) {
    for (Vec3f& v : vertices)
      for (std::size_t axis = 0; axis < 3; ++axis)
        v[axis] = float(double(v[axis]) * (axis == 1 ? placing.stretch : 1.0) * placing.size + by[axis]);
  };
  move(scene_.mesh.vertices);
  for (auto& frame : scene_.mesh.later_frames) move(frame);
  scene_.mesh.instancing.reset();
  scene_.camera.reset();
  scene_.lights.clear();
  sanitise(scene_, name_);  // rounding may have left triangles without area
  const Bounds3f box = mesh().bounds();
  facts_["offset"] = placing.offset, facts_["radius"] = 0.5 * length(Vec3d(box.upper) - Vec3d(box.lower));
  facts_["triangle_aspect_median"] = median_aspect(mesh());
}

Oracle& SceneData::oracle() {
  if (!oracle_) {
    const double begin = wall_seconds();
    oracle_ = std::make_unique<Oracle>(mesh());
    note_(fmt::format("{}: oracle built in {:.2f} s", name_, wall_seconds() - begin));
  }
  return *oracle_;
}

const Workload& SceneData::workload(const std::string& name, SurfaceStart start) {
  if (!starts_on_surfaces(name)) start = {};
  if (const auto known = workloads_.find({name, start.method}); known != workloads_.end()) return known->second;
  const auto keep = [&](const std::string& of, SelfIntersection method, Workload made) -> const Workload& {
    return workloads_.emplace(std::pair{of, method}, std::move(made)).first->second;
  };
  if (is_hard(name)) return keep(name, start.method, make_hard_workload(name, scene_, view_));
  if (name == "primary") return keep(name, start.method, make_primary(scene_, view_));
  const Workload& primary = workload("primary");
  if (starts_on_surfaces(name)) static_cast<void>(primary_hits());
  View view = view_;
  view.start = start;
  return keep(name, start.method, make_workload(name, scene_, view, primary.batch(), primary_hits_));
}

const std::vector<Hit>& SceneData::primary_hits() {
  if (primary_hits_.empty())
    for (const ExactHit& exact : closest_truth(workload("primary"))) primary_hits_.push_back(exact.hit);
  return primary_hits_;
}

const RenderedRays& SceneData::rendered(const std::string& name) {
  if (const auto known = rendered_.find(name); known != rendered_.end()) return known->second;
  const Vec3d light = light_position(scene_, workload("primary").batch(), primary_hits());
  const Oracle& exact = oracle();
  const double begin = wall_seconds();
  const RenderedRays& rays = rendered_.try_emplace(name, name, scene_, view_, light, exact).first->second;
  note_(fmt::format("{}/{}: {} rays of the renderer and their exact answers in {:.2f} s", name_, name,
                    rays.closest().rays.size() + rays.any().rays.size(), wall_seconds() - begin));
  return rays;
}

template <class Answers, class Compute>
const Answers& SceneData::truth(Answers& entry, const Workload& workload, std::string_view of, const Compute& compute) {
  Oracle& exact = oracle();
  const double begin = wall_seconds();
  entry = compute(exact);
  note_(fmt::format("{}/{}: exact answers of {} rays{} in {:.2f} s", name_, workload.name, workload.rays.size(), of,
                    wall_seconds() - begin));
  return entry;
}

const std::vector<ExactHit>& SceneData::closest_truth(const Workload& workload) {
  auto [entry, fresh] = closest_truth_.try_emplace(&workload);
  if (!fresh) return entry->second;
  return truth(entry->second, workload, "", [&](const Oracle& exact) {
    return workload.excludes_sources ? closest_hit_excluding(exact, workload.batch(), workload.sources)
                                     : exact.closest_hit(workload.batch());
  });
}

const std::vector<std::uint8_t>& SceneData::any_truth(const Workload& workload) {
  auto [entry, fresh] = any_truth_.try_emplace(&workload);
  if (!fresh) return entry->second;
  return truth(entry->second, workload, "", [&](const Oracle& exact) {
    if (!workload.excludes_sources) return exact.any_hit(workload.batch());
    std::vector<std::uint8_t> occluded;
    for (const ExactHit& h : closest_hit_excluding(exact, workload.batch(), workload.sources))
      occluded.push_back(h.hit.is_hit());
    return occluded;
  });
}

const std::vector<ExactHit>& SceneData::start_truth(const Workload& workload) {
  auto [entry, fresh] = start_truth_.try_emplace(workload.name);
  if (!fresh) return entry->second;
  return truth(entry->second, workload, " from their hit points", [&](const Oracle& exact) {
    return exact.closest_hit_from(workload.starts, {workload.references, workload.times}, workload.sources);
  });
}

std::vector<std::array<float, 2>> SceneData::seen_pixels(const Workload& workload) {
  const auto& truth = closest_truth(workload);
  std::vector<std::array<float, 2>> seen;
  for (std::size_t i = 0; i < workload.pixels.size(); ++i) {  // they are aimed from t = 0 to t = 1
    if (truth[i].hit.is_hit() && std::fabs(truth[i].t - 1.0) < 1e-3) seen.push_back(workload.pixels[i]);
  }
  return seen;
}

std::vector<std::array<float, 2>> SceneData::leak_pixels(const Workload& workload, std::span<const Hit> answers) {
  const auto& truth = closest_truth(workload);
  std::vector<std::array<float, 2>> leaks;
  for (std::size_t i = 0; i < workload.pixels.size(); ++i) {
    if (oracle().judge(workload.rays[i], workload.batch().time(i), truth[i], answers[i]).crack)
      leaks.push_back(workload.pixels[i]);
  }
  return leaks;
}

StartCheck SceneData::check_starts(const Workload& workload, std::span<const Hit> answers) {
  return check_closest_starts(start_truth(workload), answers, workload.sources);
}

StartCheck SceneData::check_starts(const Workload& workload, std::span<const std::uint8_t> answers) {
  return check_any_starts(start_truth(workload), answers);
}

double SceneData::start_distance(const Workload& workload) const {
  const Bounds3f box = mesh().bounds();
  const double diagonal = length(Vec3d(box.upper) - Vec3d(box.lower));
  double sum = 0.0;
  for (std::size_t i = 0; i < workload.starts.size(); ++i) {
    const auto& p = workload.starts[i];
    sum += length(Vec3d(workload.rays[i].origin) - Vec3d(p[0], p[1], p[2])) + double(workload.rays[i].tnear);
  }
  return sum / (diagonal * double(std::max<std::size_t>(workload.starts.size(), 1)));
}

AnswerCheck SceneData::check(const RenderedRays& rays, std::span<const Hit> answers) {
  return oracle().check_closest_hit(rays.closest().batch(), rays.closest_truth(), answers);
}

AnswerCheck SceneData::check(const RenderedRays& rays, std::span<const std::uint8_t> answers) {
  return oracle().check_any_hit(rays.any().batch(), rays.any_truth(), answers);
}

AnswerCheck SceneData::check(const Workload& workload, std::span<const Hit> answers) {
  const auto& truth = closest_truth(workload);
  return oracle().check_closest_hit(workload.batch(), truth, answers);
}

AnswerCheck SceneData::check(const Workload& workload, std::span<const std::uint8_t> answers) {
  const auto& truth = any_truth(workload);
  return oracle().check_any_hit(workload.batch(), truth, answers);
}

}  // namespace arboretum
