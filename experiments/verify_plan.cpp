#include "experiments/verify_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "experiments/axis_words.h"
#include "experiments/call_axis.h"

namespace arboretum {
namespace {

std::vector<std::string> all_values(Axis axis, const Registry& registry, bool without_brute_force) {
  std::vector<std::string> values = known_values(axis, registry);
  std::erase_if(values,
                [&](const std::string& v) { return v == kAuto || v == kAll || v == "packet" || v == "hybrid"; });
  if (axis == Axis::isa) {
    values.clear();
    for (Isa isa : registry.isas) values.emplace_back(to_string(isa));
  }
  if (axis == Axis::structure)
    std::erase_if(values,
                  [&](const std::string& v) { return v == "embree" || (v == "brute_force" && without_brute_force); });
  return values;
}

}  // namespace

Plan make_verify_plan(const VerifyCommand& command, const SceneChoice& scene, bool without_brute_force,
                      const Registry& registry) {
  Experiment experiment;
  experiment.name = "verify", experiment.scenes = {scene};
  experiment.metrics = {.trace = true, .build = false, .quality = false, .accuracy = true};
  refuse_repeated_axes(command.axes);
  for (const std::string& word : command.axes) {
    const std::size_t equals = word.find('=');
    const auto axis = parse_axis(word.substr(0, equals));
    if (axis == Axis::call) throw UserError("command line: verify calls with batches alone and has no call axis");
    if (axis == Axis::workload || axis == Axis::threads)
      throw UserError(fmt::format("command line: verify has rays of its own and no {} axis; see --kinds, --threads",
                                  word.substr(0, equals)));
    // `all` of any axis; the builder has one of its own.
    if (axis && axis != Axis::builder && equals != std::string::npos && word.substr(equals + 1) == kAll) {
      experiment.axes[index_of(*axis)] = all_values(*axis, registry, without_brute_force);
      continue;
    }
    AxisWord read = read_axis_word(word, registry, {});
    experiment.axes[index_of(*parse_axis(read.key))] = std::move(read.values);
  }
  const auto fill = [&](Axis a, std::vector<std::string> values) {
    if (experiment.axes[index_of(a)].empty()) experiment.axes[index_of(a)] = std::move(values);
  };
  for (Axis a : {Axis::structure, Axis::intersector, Axis::isa}) fill(a, all_values(a, registry, without_brute_force));
  for (Axis a : {Axis::builder, Axis::leaf, Axis::box}) fill(a, {std::string(kAuto)});
  fill(Axis::traversal, {"single"}), fill(Axis::call, {std::string(kCalls.front())});
  fill(Axis::workload, {"verify"}), fill(Axis::threads, {"1"});
  Plan plan = make_plan(experiment, registry);
  apply_filter(plan, command.filter, command.skip);
  // The plan names cells after a workload, which they have not here.
  for (SkippedCell& cell : plan.skipped) cell.name.clear();
  return plan;
}

}  // namespace arboretum
