#include "experiments/scene_data.h"

#include <fmt/format.h>

#include "core/timer.h"

namespace arboretum {

SceneData::SceneData(const SceneChoice& choice, const MeasureSettings& measure, NoteFunction note)
    : name_(choice.name),
      view_{.width = measure.width, .height = measure.height, .seed = measure.seed},
      note_(std::move(note)) {
  const double begin = wall_seconds();
  scene_ = load_scene(choice.spec);
  note_(fmt::format("{}: {} triangles, loaded in {:.2f} s", name_, mesh().size(), wall_seconds() - begin));
  const LoadReport& report = scene_.report;
  if (report.non_finite + report.out_of_range + report.degenerate > 0) {
    note_(fmt::format("{}: dropped {} triangles with NaN or infinity, {} out of range, {} of zero area",
                      name_, report.non_finite, report.out_of_range, report.degenerate));
  }
  for (const std::string& warning : report.warnings) note_(fmt::format("{}: {}", name_, warning));
}

Oracle& SceneData::oracle() {
  if (!oracle_) {
    const double begin = wall_seconds();
    oracle_ = std::make_unique<Oracle>(mesh());
    note_(fmt::format("{}: oracle built in {:.2f} s", name_, wall_seconds() - begin));
  }
  return *oracle_;
}

const Workload& SceneData::workload(const std::string& name) {
  if (const auto known = workloads_.find(name); known != workloads_.end()) return known->second;
  if (!workloads_.contains("primary")) workloads_.emplace("primary", make_primary(scene_, view_));
  const Workload& primary = workloads_.at("primary");
  if (name == "primary") return primary;
  if (is_secondary(name) && primary_hits_.empty()) {
    for (const ExactHit& exact : closest_truth(primary)) primary_hits_.push_back(exact.hit);
  }
  return workloads_.emplace(name, make_workload(name, scene_, view_, primary.batch(), primary_hits_))
      .first->second;
}

const std::vector<ExactHit>& SceneData::closest_truth(const Workload& workload) {
  auto [entry, fresh] = closest_truth_.try_emplace(workload.name);
  if (fresh) {
    Oracle& exact = oracle();
    const double begin = wall_seconds();
    entry->second = exact.closest_hit(workload.batch());
    note_(fmt::format("{}/{}: exact answers of {} rays in {:.2f} s", name_, workload.name,
                      workload.rays.size(), wall_seconds() - begin));
  }
  return entry->second;
}

const std::vector<std::uint8_t>& SceneData::any_truth(const Workload& workload) {
  auto [entry, fresh] = any_truth_.try_emplace(workload.name);
  if (fresh) {
    Oracle& exact = oracle();
    const double begin = wall_seconds();
    entry->second = exact.any_hit(workload.batch());
    note_(fmt::format("{}/{}: exact answers of {} rays in {:.2f} s", name_, workload.name,
                      workload.rays.size(), wall_seconds() - begin));
  }
  return entry->second;
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
