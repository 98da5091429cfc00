#include "experiments/effective.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "experiments/fnv.h"

namespace arboretum {
namespace {

void emit_list(YAML::Emitter& out, const std::vector<std::string>& values) {
  out << YAML::Flow << YAML::BeginSeq;
  for (const std::string& value : values) out << value;
  out << YAML::EndSeq;
}

/// `whole`: with where files are, and whether they are there, which changes no number: what they hold has hashes of its
/// own (plan.json), and a sweep may be measured on several machines.
void emit_scene(YAML::Emitter& out, const SceneChoice& scene, bool whole) {
  const SceneSpec& spec = scene.spec;
  const Placing& placing = scene.placing;
  if (!spec.catalogue.empty() && placing.label.empty()) {
    out << spec.catalogue;
    return;
  }
  out << YAML::Flow << YAML::BeginMap;
  if (!spec.catalogue.empty()) out << YAML::Key << "catalogue" << YAML::Value << spec.catalogue;
  const auto path = [&](const std::filesystem::path& file) {
    if (!whole) return scene.family();
    return scene.missing.empty() ? std::filesystem::absolute(file).lexically_normal().string()
                                 : file.string();  // one that is missing has no place
  };
  if (!spec.file.empty()) out << YAML::Key << "file" << YAML::Value << path(spec.file);
  if (!spec.scene.empty()) out << YAML::Key << "scene" << YAML::Value << path(spec.scene);
  if (whole && !scene.missing.empty()) out << YAML::Key << "optional" << YAML::Value << true;
  if (!spec.generator.empty()) {
    out << YAML::Key << "generate" << YAML::Value << spec.generator << YAML::Key << "triangles" << YAML::Value
        << spec.triangles << YAML::Key << "seed" << YAML::Value << spec.seed;
  }
  // As the configuration has them: they are a part of the name.
  for (std::string_view label = placing.label; !label.empty();) {
    const std::string_view pair = label.substr(1, label.find(':', 1) - 1);
    out << YAML::Key << std::string(pair.substr(0, pair.find('='))) << YAML::Value
        << std::string(pair.substr(pair.find('=') + 1));
    label.remove_prefix(pair.size() + 1);
  }
  out << YAML::EndMap;
}

void emit_choices(YAML::Emitter& out, std::string_view key, const std::vector<CellChoice>& choices) {
  if (choices.empty()) return;
  out << YAML::Key << std::string(key) << YAML::Value << YAML::BeginSeq;
  for (const CellChoice& choice : choices) {
    out << YAML::Flow << YAML::BeginMap;
    if (!choice.scenes.empty()) {
      out << YAML::Key << "scene" << YAML::Value;
      emit_list(out, choice.scenes);
    }
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (choice.axes[i].empty()) continue;
      out << YAML::Key << std::string(kAxisNames[i]) << YAML::Value;
      emit_list(out, choice.axes[i]);
    }
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
}

void emit_rays(YAML::Emitter& out, const RaySettings& rays) {
  std::vector<std::string> ways;
  for (SelfIntersection way : rays.self_intersection) ways.emplace_back(to_string(way));
  out << YAML::Key << "rays" << YAML::Value << YAML::Flow << YAML::BeginMap << YAML::Key << "self_intersection"
      << YAML::Value;
  emit_list(out, ways);
  if (std::ranges::find(rays.self_intersection, SelfIntersection::epsilon) != rays.self_intersection.end())
    out << YAML::Key << "epsilon" << YAML::Value << fmt::format("{}", rays.epsilon);
  out << YAML::EndMap;
}

/// `whole`: with what changes no measured number: plots, the folder of saved structures, where scenes are.
std::string text(const Experiment& e, bool whole) {
  YAML::Emitter out;
  out << YAML::BeginMap << YAML::Key << "experiment" << YAML::Value << e.name;
  out << YAML::Key << "scenes" << YAML::Value << YAML::BeginSeq;
  for (const SceneChoice& scene : e.scenes) emit_scene(out, scene, whole);
  out << YAML::EndSeq << YAML::Key << "axes" << YAML::Value << YAML::BeginMap;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    out << YAML::Key << std::string(kAxisNames[i]) << YAML::Value;
    emit_list(out, e.axes[i]);
  }
  out << YAML::EndMap << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap;
  for (const std::string& name : parameter_names()) {
    const auto named = e.parameters.find(name);
    out << YAML::Key << name << YAML::Value;
    emit_list(out, named == e.parameters.end() ? std::vector<std::string>{default_parameter(name)} : named->second);
  }
  out << YAML::EndMap;
  if (has_rays_on_surfaces(e)) emit_rays(out, e.rays);
  emit_choices(out, "include", e.include);
  emit_choices(out, "exclude", e.exclude);
  const MeasureSettings& m = e.measure;
  out << YAML::Key << "measure" << YAML::Value << YAML::BeginMap << YAML::Key << "repetitions" << YAML::Value
      << m.repetitions << YAML::Key << "warmup" << YAML::Value << m.warmup;
  if (whole || m.min_warmup_time > 0.0)
    out << YAML::Key << "min_warmup_time" << YAML::Value << fmt::format("{}", m.min_warmup_time);
  out << YAML::Key << "min_time" << YAML::Value << fmt::format("{}", m.min_time) << YAML::Key << "resolution"
      << YAML::Value << YAML::Flow << YAML::BeginSeq << m.width << m.height << YAML::EndSeq << YAML::Key << "memory"
      << YAML::Value << m.memory << YAML::Key << "seed" << YAML::Value << m.seed;
  if (whole && !m.structure_cache.empty()) {
    out << YAML::Key << "structure_cache" << YAML::Value
        << std::filesystem::absolute(m.structure_cache).lexically_normal().string();
  }
  out << YAML::EndMap;
  std::vector<std::string> metrics;
  for (const auto& [name, on] : {std::pair{"trace", e.metrics.trace},
                                 {"build", e.metrics.build},
                                 {"quality", e.metrics.quality},
                                 {"accuracy", e.metrics.accuracy}}) {
    if (on) metrics.emplace_back(name);
  }
  out << YAML::Key << "metrics" << YAML::Value;
  emit_list(out, metrics);
  if (whole) {
    out << YAML::Key << "plots" << YAML::Value;
    emit_list(out, e.plots);
  }
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace

std::string effective_yaml(const Experiment& experiment) { return text(experiment, true); }

std::string configuration_hash(const Experiment& experiment) {
  return fmt::format("{:016x}", fnv1a(text(experiment, false)));
}

}  // namespace arboretum
