// The commands of the command line. Each returns the exit status; errors come out as UserError.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/benchmark_flags.h"
#include "experiments/comparison.h"
#include "experiments/config.h"
#include "experiments/merge.h"
#include "experiments/kernel_choice.h"
#include "rendering/render.h"

namespace arboretum {

struct RunCommand {
  std::filesystem::path config;
  Overrides overrides;
  std::filesystem::path out;  ///< empty: results/<experiment>
  std::string filter, skip;
  std::optional<std::string> shard;  ///< "2/8", as typed
  bool list = false, dry_run = false, resume = false, fail_fast = false, no_plots = false;
  BenchmarkFlags benchmark;
  std::string command_line;  ///< as typed, for the results
};

/// Of a scene or random meshes, where no number is given.
inline constexpr std::uint64_t kVerifyRays = 100'000;

struct VerifyCommand {
  std::string subject;                ///< a scene word, a cases file (.json), or `random`
  std::vector<std::string> axes;      ///< `isa=avx2,avx512`, as typed
  std::optional<std::uint64_t> rays;  ///< in all; empty: kVerifyRays, or each case of a file once
  std::uint64_t seed = 1;
  std::vector<double> offsets;
  std::vector<int> scales;         ///< exponents of two
  std::vector<std::string> kinds;  ///< of rays; empty: all that the scene has
  std::filesystem::path out;       ///< empty: nothing is written
  std::optional<unsigned> threads;
  bool spread = false;  ///< each batch of rays goes to one cell instead of all
  std::string filter, skip;
};

struct MergeCommand {
  std::filesystem::path out;
  std::vector<std::filesystem::path> parts;
  MergeOptions options;
  bool require_all = false, no_plots = false;
  std::string command_line;  ///< as typed, for the results
};

struct CompareCommand {
  std::filesystem::path a, b;
  CompareOptions options;
  std::string filter, skip;
  bool allow_different_machines = false, all = false;
  std::string json, csv;       ///< files; "-": stdout; empty: none
  std::filesystem::path plot;  ///< empty: none
};

struct RenderCommand {
  std::string scene;
  std::filesystem::path out;  ///< empty: image.png
  std::string effects = "auto", integrator = "auto";
  std::string exposure;           ///< auto or stops; empty: auto, or 0 where what is drawn is no light
  std::string heat_map;           ///< empty, nodes or triangles
  std::string resolution;         ///< WIDTHxHEIGHT; empty: the camera's
  std::optional<unsigned> depth;  ///< of paths, as `clamp`
  std::optional<float> clamp;
  RenderSettings settings;  ///< but what is said above
  KernelChoice kernel;
};

ExitStatus command_run(RunCommand command);
ExitStatus command_merge(const MergeCommand& command);
ExitStatus command_compare(const CompareCommand& command);
ExitStatus command_verify(const VerifyCommand& command);
/// Of what `registry` has; tests hand in kernels that lie.
ExitStatus command_verify(const VerifyCommand& command, const Registry& registry);
/// `axis` empty: all of them.
ExitStatus command_list(const std::string& axis, bool json);
ExitStatus command_info(const std::string& scene, bool json);
ExitStatus command_render(const RenderCommand& command);
ExitStatus command_plot(const std::filesystem::path& results, const std::vector<std::string>& figures);
ExitStatus command_fetch(const std::vector<std::string>& scenes);

}  // namespace arboretum
