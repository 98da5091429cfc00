#include "experiments/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <thread>

#include "core/error.h"
#include "core/names.h"
#include "experiments/axis_words.h"
#include "experiments/call_axis.h"
#include "experiments/config_plots.h"
#include "experiments/config_scenes.h"
#include "experiments/yaml_reader.h"
#include "rendering/workload.h"

namespace arboretum {
namespace {

std::vector<std::string> strings(std::span<const std::string_view> views) { return {views.begin(), views.end()}; }

class ConfigReader {
 public:
  ConfigReader(const std::filesystem::path& file, const Registry& registry) : yaml_(file), registry_(registry) {
    experiment_.file = file;
  }

  Experiment read(const Overrides& overrides) {
    const YAML::Node& root = yaml_.root();
    yaml_.check_map(root, "the configuration",
                    std::vector<std::string>{"experiment", "scenes", "axes", "parameters", "rays", "include", "exclude",
                                             "measure", "metrics", "plots"});
    experiment_.name = experiment_.file.stem().string();
    if (const auto node = root["experiment"]) read_name(node);
    if (!root["scenes"]) yaml_.fail(root, "no scenes; add `scenes: [bunny]` or another of `arboretum list scenes`");
    experiment_.scenes = read_scenes(yaml_, root["scenes"], experiment_.file.parent_path());
    if (const auto node = root["measure"]) read_measure(node);
    if (const auto node = root["axes"]) experiment_.axes = read_axes(node, "axes", false, nullptr);
    if (root["measure"] && root["measure"]["threads"] && !axis(Axis::threads).empty()) {
      yaml_.fail(root["measure"]["threads"], "threads are given in axes too; keep one of the two");
    }
    if (const auto node = root["parameters"]) read_parameters(node);
    if (const auto node = root["rays"]) read_rays(node);
    if (const auto node = root["include"]) experiment_.include = read_choices(node, "include");
    if (const auto node = root["exclude"]) experiment_.exclude = read_choices(node, "exclude");
    if (const auto node = root["metrics"]) read_metrics(node);
    apply(overrides);
    fill_defaults();
    refuse_ineffective_rays(root["rays"]);
    experiment_.plots = root["plots"] ? read_plots(yaml_, root["plots"], experiment_) : default_plots(experiment_);
    return std::move(experiment_);
  }

 private:
  std::vector<std::string>& axis(Axis a) { return experiment_.axes[index_of(a)]; }

  void read_name(const YAML::Node& node) {
    experiment_.name = yaml_.text(node, "experiment");
    const bool plain = std::ranges::all_of(
        experiment_.name, [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; });
    if (!plain || experiment_.name.front() == '.') {
      yaml_.fail(
          node, fmt::format("experiment '{}' names a folder: use letters, digits, '_', '-' and '.'", experiment_.name));
    }
  }

  AxisLists read_axes(const YAML::Node& map, std::string_view what, bool with_scene, CellChoice* choice) {
    std::vector<std::string> keys = strings(kAxisNames);
    if (with_scene) keys.emplace_back("scene");
    yaml_.check_map(map, what, keys);
    AxisLists lists;
    for (const auto& entry : map) {
      const std::string key = entry.first.Scalar();
      // yaml-cpp gives an empty flow list the line of its bracket, so errors point at the right place.
      const std::vector<YAML::Node> nodes = yaml_.list(entry.second, fmt::format("{}: {}", what, key));
      if (key == "scene") {
        for (const YAML::Node& node : nodes) choice->scenes.push_back(known_scene(node));
        continue;
      }
      const Axis a = *parse_axis(key);
      for (const YAML::Node& node : nodes) {
        std::string value = node.Scalar();
        if (const std::string wrong = check_axis_value(a, value, registry_); !wrong.empty()) yaml_.fail(node, wrong);
        auto& list = lists[index_of(a)];
        if (std::ranges::find(list, value) != list.end())
          yaml_.fail(node, fmt::format("{}: '{}' is given twice; keep one", key, value));
        list.push_back(value);
      }
    }
    return lists;
  }

  std::string known_scene(const YAML::Node& node) {
    std::vector<std::string> names;
    for (const SceneChoice& s : experiment_.scenes) {
      if (s.is_called(node.Scalar())) return node.Scalar();
      names.push_back(s.name);
    }
    yaml_.fail(node, unknown_name_message("scene", node.Scalar(), names));
  }

  std::vector<CellChoice> read_choices(const YAML::Node& node, std::string_view what) {
    if (!node.IsSequence()) {
      yaml_.fail(node, fmt::format("{} must be a list of maps, as in {}: [{{structure: embree}}]", what, what));
    }
    std::vector<CellChoice> choices;
    for (const YAML::Node& entry : node) {
      CellChoice choice;
      choice.where = yaml_.where(entry);
      choice.axes = read_axes(entry, what, true, &choice);
      if (entry.size() == 0) yaml_.fail(entry, fmt::format("{}: an entry names no axis", what));
      choices.push_back(std::move(choice));
    }
    return choices;
  }

  void read_parameters(const YAML::Node& map) {
    yaml_.check_map(map, "parameters", parameter_names());
    for (const auto& entry : map) {
      const std::string key = entry.first.Scalar();
      for (const YAML::Node& node : yaml_.list(entry.second, "parameters: " + key)) {
        Parameters scratch;
        if (const std::string wrong = set_parameter(scratch, key, node.Scalar()); !wrong.empty()) {
          yaml_.fail(node, fmt::format("{} must be {}, not '{}'", key, wrong, node.Scalar()));
        }
        // A default asks for nothing: effective.yaml names them all.
        if (scratch != Parameters{}) experiment_.parameter_places[key] = yaml_.where(entry.first);
        experiment_.parameters[key].push_back(node.Scalar());
      }
    }
  }

  void read_rays(const YAML::Node& map) {
    yaml_.check_map(map, "rays", std::vector<std::string>{"self_intersection", "epsilon"});
    RaySettings& rays = experiment_.rays;
    if (const auto n = map["self_intersection"]) {
      const std::vector<std::string> known = strings(kSelfIntersectionNames);
      rays.self_intersection.clear();
      for (const YAML::Node& value : yaml_.list(n, "rays: self_intersection")) {
        const auto found = std::ranges::find(known, value.Scalar());
        if (found == known.end()) yaml_.fail(value, unknown_name_message("self_intersection", value.Scalar(), known));
        const auto method = static_cast<SelfIntersection>(found - known.begin());
        if (std::ranges::find(rays.self_intersection, method) != rays.self_intersection.end())
          yaml_.fail(value, fmt::format("self_intersection: '{}' is given twice; keep one", value.Scalar()));
        rays.self_intersection.push_back(method);
      }
    }
    if (const auto n = map["epsilon"]) {
      rays.epsilon = yaml_.number(n, "epsilon (a share of the scene's diagonal)", 0.0, 1.0);
      if (std::ranges::find(rays.self_intersection, SelfIntersection::epsilon) == rays.self_intersection.end())
        yaml_.fail(n, "epsilon has no effect without self_intersection: epsilon; take it out");
    }
  }

  /// `node`: the configuration's `rays`, or none.
  void refuse_ineffective_rays(const YAML::Node& node) {
    if (!node || experiment_.overridden) return;
    if (!has_rays_on_surfaces(experiment_))
      yaml_.fail(node,
                 "rays has no effect: no workload starts on surfaces (shadow, ambient_occlusion, reflection, diffuse)");
  }

  void read_measure(const YAML::Node& map) {
    yaml_.check_map(map, "measure",
                    std::vector<std::string>{"repetitions", "warmup", "min_warmup_time", "min_time", "resolution",
                                             "threads", "memory", "seed", "structure_cache"});
    MeasureSettings& m = experiment_.measure;
    if (const auto n = map["repetitions"])
      m.repetitions = static_cast<unsigned>(yaml_.integer(n, "repetitions", 1, kMaxRepetitions));
    if (const auto n = map["warmup"]) m.warmup = static_cast<unsigned>(yaml_.integer(n, "warmup", 0, 1000));
    if (const auto n = map["min_warmup_time"])
      m.min_warmup_time = yaml_.number(n, "min_warmup_time (seconds)", 0.0, 3600.0);
    if (const auto n = map["min_time"]) m.min_time = yaml_.number(n, "min_time (seconds)", 0.0, 3600.0);
    if (const auto n = map["threads"]) threads_ = std::to_string(yaml_.integer(n, "threads", 1, kMaxThreads));
    if (const auto n = map["memory"]) m.memory = yaml_.bytes(n, "memory");
    if (const auto n = map["seed"]) m.seed = yaml_.integer(n, "seed", 0, ~std::uint64_t{0});
    if (const auto n = map["structure_cache"]) {
      m.structure_cache = experiment_.file.parent_path() / yaml_.text(n, "structure_cache");
      experiment_.structure_cache_where = yaml_.where(n);
    }
    if (const auto n = map["resolution"]) {
      if (!n.IsSequence() || n.size() != 2) yaml_.fail(n, "resolution must be [width, height], as in [512, 512]");
      m.width = static_cast<unsigned>(yaml_.integer(n[0], "resolution: width", 1, 32768));
      m.height = static_cast<unsigned>(yaml_.integer(n[1], "resolution: height", 1, 32768));
    }
  }

  void read_metrics(const YAML::Node& node) {
    Metrics& m = experiment_.metrics;
    m = {false, false, false, false};
    const std::vector<std::string> known = strings(kMetricNames);
    for (const YAML::Node& value : yaml_.list(node, "metrics")) {
      const std::string name = value.Scalar();
      if (std::ranges::find(known, name) == known.end()) yaml_.fail(value, unknown_name_message("metric", name, known));
      (name == "trace" ? m.trace : name == "build" ? m.build : name == "quality" ? m.quality : m.accuracy) = true;
    }
    if (m.accuracy && !m.trace)
      yaml_.fail(node, "metric accuracy has no effect without trace: add trace or take accuracy out");
    if (m.quality && !m.trace && !m.build)
      yaml_.fail(node, "metric quality has no effect without trace or build: add one of them");
  }

  void apply(const Overrides& overrides) {
    refuse_repeated_axes(overrides.axes);
    for (const std::string& word : overrides.axes) apply_axis(word);
    if (overrides.threads) {
      if (std::ranges::any_of(overrides.axes, [](const std::string& word) { return word.starts_with("threads="); }))
        throw UserError("command line: --threads and threads= say the same; keep one");
      if (*overrides.threads < 1 || *overrides.threads > kMaxThreads) {
        throw UserError(fmt::format("--threads: an integer from 1 to {}, not {}", kMaxThreads, *overrides.threads));
      }
      axis(Axis::threads) = {std::to_string(*overrides.threads)};
      given_.push_back(Axis::threads);
      experiment_.overridden = true;
    }
    restrict_includes();
    if (overrides.repetitions) experiment_.measure.repetitions = *overrides.repetitions;
    if (overrides.seed) experiment_.measure.seed = *overrides.seed;
    if (overrides.min_warmup_time) experiment_.measure.min_warmup_time = *overrides.min_warmup_time;
    if (overrides.min_time) experiment_.measure.min_time = *overrides.min_time;
  }

  void apply_axis(const std::string& word) {
    auto [key, values] = read_axis_word(word, registry_, {"scene"});
    experiment_.overridden = true;
    if (key == "scene") return choose_scenes(values);
    axis(*parse_axis(key)) = values;
    given_.push_back(*parse_axis(key));
  }

  /// What the command line says of the rays and the machine (isa, workload, threads, scene) holds for `include` too: of
  /// an entry's own values those stay that it names. What an entry is there for, its structure, builder, leaf,
  /// intersector, boxes and traversal, are its own.
  void restrict_includes() {
    std::erase_if(experiment_.include, [&](CellChoice& choice) {
      std::string_view none;
      for (Axis a : given_) {
        if (a != Axis::isa && a != Axis::workload && a != Axis::threads) continue;
        std::vector<std::string>& named = choice.axes[index_of(a)];
        if (named.empty()) continue;
        named = common_values(named, axis(a));
        if (named.empty()) none = to_string(a);
      }
      if (std::erase_if(choice.scenes, [&](const std::string& word) { return !has_scene(word); }) > 0 &&
          choice.scenes.empty())
        none = "scene";
      if (none.empty()) return false;
      experiment_.left_out.push_back(
          fmt::format("{}: this include is left out: the command line names no {} of it", choice.where, none));
      return true;
    });
  }

  bool has_scene(const std::string& word) const {
    return std::ranges::any_of(experiment_.scenes, [&](const SceneChoice& s) { return s.is_called(word); });
  }

  /// `all` stands for every builder.
  static std::vector<std::string> common_values(const std::vector<std::string>& named,
                                                const std::vector<std::string>& given) {
    const auto has = [](const std::vector<std::string>& list, std::string_view value) {
      return std::ranges::find(list, value) != list.end();
    };
    if (has(given, kAll)) return named;
    if (has(named, kAll)) return given;
    std::vector<std::string> both;
    std::ranges::copy_if(named, std::back_inserter(both), [&](const std::string& value) { return has(given, value); });
    return both;
  }

  /// A scene on the command line is one of the configuration's by its name, or any other that the word names.
  void choose_scenes(const std::vector<std::string>& words) {
    std::vector<SceneChoice> chosen;
    for (const std::string& word : words) {
      const std::size_t before = chosen.size();
      std::ranges::copy_if(experiment_.scenes, std::back_inserter(chosen),
                           [&](const SceneChoice& s) { return s.is_called(word); });
      if (chosen.size() == before) chosen.push_back(scene_of_word(word));
    }
    experiment_.scenes = chosen;
  }

  void fill_defaults() {
    const auto fill = [&](Axis a, std::string value) {
      if (axis(a).empty()) axis(a).push_back(std::move(value));
    };
    const auto first_known = [&](Axis a, std::string preferred) {
      const auto known = known_values(a, registry_);
      const bool has = std::ranges::find(known, preferred) != known.end();
      return has || known.empty() ? preferred : known.front();
    };
    fill(Axis::structure, first_known(Axis::structure, "bvh8"));
    fill(Axis::builder, std::string(kAuto));
    fill(Axis::leaf, std::string(kAuto));
    fill(Axis::intersector, first_known(Axis::intersector, "watertight"));
    fill(Axis::box, std::string(kAuto));
    fill(Axis::traversal, first_known(Axis::traversal, "single"));
    fill(Axis::call, std::string(kCalls.front()));
    fill(Axis::isa, std::string(to_string(registry_.isas.back())));
    fill(Axis::workload, "primary");
    fill(Axis::threads, threads_);
  }

  YamlReader yaml_;
  const Registry& registry_;
  Experiment experiment_;
  std::string threads_ = "1";
  std::vector<Axis> given_;  ///< by the command line
};

}  // namespace

bool has_rays_on_surfaces(const Experiment& experiment) {
  const auto has = [](const AxisLists& axes) {
    return std::ranges::any_of(axes[index_of(Axis::workload)], starts_on_surfaces);
  };
  return has(experiment.axes) ||
         std::ranges::any_of(experiment.include, [&](const CellChoice& c) { return has(c.axes); });
}

Experiment read_experiment(const std::filesystem::path& file, const Registry& registry, const Overrides& overrides) {
  return ConfigReader(file, registry).read(overrides);
}

}  // namespace arboretum
