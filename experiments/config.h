// Experiment: what a configuration file asks for, checked. Nothing in it is guessed: a key or value that
// means nothing is an error that names file, line and the nearest valid word.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "experiments/axes.h"
#include "experiments/parameters.h"
#include "rendering/self_intersection.h"
#include "scenes/scene.h"

namespace arboretum {

inline constexpr std::array<std::string_view, 4> kMetricNames{"trace", "build", "quality", "accuracy"};

/// What is done to a scene's coordinates: stretched along y, sized, then moved by offset * (1, -3/4, 1/2), rounded
/// once. A scene that is placed loses its camera and lights (it is framed whole) and its instances.
struct Placing {
  double stretch = 1.0, size = 1.0, offset = 0.0;
  std::string label = {};  ///< what the configuration says of it: ":size=100:offset=1e4"; empty: nothing
};

struct SceneChoice {
  SceneSpec spec;
  std::string name;          ///< as in cell names
  bool moves = false;        ///< it has key frames, and its shutter opens
  std::string missing = {};  ///< why an optional scene is not here: its cells are skipped with this reason
  Placing placing = {};
  std::string where = {};  ///< file:line, or `command line`
  /// The name without the placing: include, exclude and the command line may name all placings of a scene by it.
  [[nodiscard]] std::string family() const { return name.substr(0, name.size() - placing.label.size()); }
  [[nodiscard]] bool is_called(std::string_view word) const { return word == name || word == family(); }
};

/// One entry of `include` or `exclude`. An empty list: the axis is not named.
struct CellChoice {
  AxisLists axes;
  std::vector<std::string> scenes;
  std::string where;  ///< file:line
};

/// Most repetitions of a cell.
inline constexpr unsigned kMaxRepetitions = 100'000;

struct MeasureSettings {
  unsigned repetitions = 7;
  unsigned warmup = 1;           ///< untimed passes over all rays before the first repetition
  double min_warmup_time = 0.0;  ///< seconds that the untimed passes last at least
  /// Seconds that the passes of one repetition last at least; builds, kEnoughOfBuilds where that is less. So long as
  /// kMostPasses and kMostBuilds allow it (experiments/passes.h).
  double min_time = 0.2;
  unsigned width = 512, height = 512;
  std::size_t memory = std::size_t{8} << 30;  ///< bytes of structures held at once
  std::uint64_t seed = 1;
  std::filesystem::path structure_cache = {};  ///< folder of built structures to load and keep; empty: none
};

/// Of all workloads together; ineffective where none starts on surfaces.
struct RaySettings {
  std::vector<SelfIntersection> self_intersection{SelfIntersection::error_bound};  ///< several are swept
  double epsilon = SurfaceStart{}.epsilon;
};

struct Metrics {
  bool trace = true, build = true, quality = true, accuracy = true;
};

struct Experiment {
  std::string name;
  std::filesystem::path file;
  std::vector<SceneChoice> scenes;
  AxisLists axes;  ///< every axis has a value
  ParameterSweep parameters;
  std::map<std::string, std::string> parameter_places;  ///< file:line of each that has a value other than its default
  RaySettings rays;
  std::vector<CellChoice> include, exclude;
  MeasureSettings measure;
  Metrics metrics;
  std::vector<std::string> plots;
  std::string structure_cache_where = {};  ///< file:line of measure.structure_cache
  /// A line for each entry of `include` of which the command line's axes leave no cell.
  std::vector<std::string> left_out = {};
  bool overridden = false;  ///< the command line changed an axis: an exclude may then match nothing
};

/// What the command line lays over the file.
struct Overrides {
  std::vector<std::string> axes;  ///< `isa=avx2,avx512`, as typed
  std::optional<unsigned> repetitions = {}, threads = {};
  std::optional<std::uint64_t> seed = {};
  std::optional<double> min_time = {}, min_warmup_time = {};
};

/// Whether a workload of the sweep starts on surfaces, so that RaySettings mean something.
[[nodiscard]] bool has_rays_on_surfaces(const Experiment& experiment);

/// Reads and checks. Throws UserError, one line: `file:line: what; mend`.
[[nodiscard]] Experiment read_experiment(const std::filesystem::path& file, const Registry& registry,
                                         const Overrides& overrides = {});

}  // namespace arboretum
