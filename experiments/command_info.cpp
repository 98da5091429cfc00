#include <fmt/format.h>

#include "experiments/commands.h"
#include "experiments/config_scenes.h"
#include "experiments/json_text.h"
#include "experiments/result.h"
#include "scenes/inspect.h"

namespace arboretum {
namespace {

Json as_json(const std::string& name, const SceneInfo& info) {
  const auto point = [](Vec3f p) { return Json::array({p.x, p.y, p.z}); };
  Json json = {{"name", name}, {"triangles", info.triangles}, {"vertices", info.vertices}};
  json["bounds"] = {{"lower", point(info.bounds.lower)}, {"upper", point(info.bounds.upper)}};
  json["triangles_read"] = info.report.triangles_read;
  json["dropped"] = {{"non_finite", info.report.non_finite},
                     {"out_of_range", info.report.out_of_range},
                     {"degenerate", info.report.degenerate}};
  json["duplicates"] = info.duplicates, json["slivers"] = info.slivers;
  json["edges"] = info.edges, json["boundary_edges"] = info.boundary_edges,
  json["non_manifold_edges"] = info.non_manifold_edges;
  json["closed"] = info.closed, json["materials"] = info.materials,
  json["emissive_triangles"] = info.emissive_triangles;
  json["key_frames"] = info.key_frames, json["moving_triangles"] = info.moving_triangles;
  json["shutter"] = {info.shutter.open, info.shutter.close};
  json["instances"] = info.instances, json["prototypes"] = info.prototypes;
  json["prototype_triangles"] = info.prototype_triangles;
  json["instances_in_scene_file"] = info.named_instances;
  json["lights"] = info.lights, json["warnings"] = info.report.warnings;
  Json& effects = json["effects"] = Json::array();
  for (const Effect& e : info.effects)
    effects.push_back({{"name", e.name}, {"called_for", e.called_for}, {"reason", e.reason}});
  return json;
}

}  // namespace

ExitStatus command_info(const std::string& word, bool json) {
  const Scene scene = load_scene(scene_spec_of_word(word));
  const SceneInfo info = inspect_scene(scene);
  if (json) {
    fmt::print("{}\n", to_text(as_json(scene.name, info), 1));
    return ExitStatus::kDone;
  }
  const Vec3f lower = info.bounds.lower, upper = info.bounds.upper;
  fmt::print("scene         {}\n", scene.name);
  fmt::print("triangles     {} ({} vertices)\n", info.triangles, info.vertices);
  fmt::print("bounds        [{:.6g} {:.6g} {:.6g}] to [{:.6g} {:.6g} {:.6g}]\n", lower.x, lower.y, lower.z, upper.x,
             upper.y, upper.z);
  fmt::print("dropped       {} with NaN or infinity, {} out of range, {} of zero area (degenerate)\n",
             info.report.non_finite, info.report.out_of_range, info.report.degenerate);
  fmt::print("duplicates    {}\n", info.duplicates);
  fmt::print("slivers       {}\n", info.slivers);
  fmt::print("surface       {} ({} edges, {} at a border, {} of more than two triangles)\n",
             info.closed ? "closed" : "open", info.edges, info.boundary_edges, info.non_manifold_edges);
  fmt::print("materials     {}\n", info.materials);
  fmt::print("lights        {}, {} emissive triangle{}\n", info.lights, info.emissive_triangles,
             info.emissive_triangles == 1 ? "" : "s");
  if (info.key_frames > 1)
    fmt::print("motion        {} key frames, {} triangles move; shutter open from {:g} to {:g} of [0, 1]\n",
               info.key_frames, info.moving_triangles, info.shutter.open, info.shutter.close);
  else
    fmt::print("motion        nothing moves\n");
  if (info.instances > 0)
    fmt::print("instances     {} of {} mesh{} with {} triangle{}; {} named by the scene\n", info.instances,
               info.prototypes, info.prototypes == 1 ? "" : "es", info.prototype_triangles,
               info.prototype_triangles == 1 ? "" : "s", info.named_instances);
  else if (info.named_instances > 0)
    fmt::print("instances     {} named by the scene, laid out in one mesh{}\n", info.named_instances,
               info.key_frames > 1 ? " because it moves" : "");
  else
    fmt::print("instances     none\n");
  for (const std::string& warning : info.report.warnings) fmt::print("warning       {}\n", warning);
  fmt::print("effects\n");
  for (const Effect& e : info.effects) fmt::print("  {} {:<14} {}\n", e.called_for ? "+" : "-", e.name, e.reason);
  return ExitStatus::kDone;
}

}  // namespace arboretum
