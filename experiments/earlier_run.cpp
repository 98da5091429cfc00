#include "experiments/earlier_run.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "experiments/result_folder.h"

namespace arboretum {

void EarlierRun::refuse_other_shard(const Shard& shard) const {
  if (!record_ || shard.is_whole() || record_->shard == shard) return;
  throw UserError(fmt::format(
      "{}: holds {}, this is shard {}; choose another folder with --out, then `merge` them", folder_.string(),
      record_->shard.is_whole() ? "results of the whole plan" : "shard " + record_->shard.text(), shard.text()));
}

void EarlierRun::refuse_other_geometry(const Experiment& experiment,
                                       std::map<std::string, std::string>& geometry) const {
  if (!record_) return;
  for (const SceneChoice& scene : experiment.scenes) {
    const auto then = record_->geometry.find(scene.name);
    const auto now = geometry.find(scene.name);
    if (then == record_->geometry.end() || now == geometry.end() || then->second == now->second) continue;
    throw UserError(
        fmt::format("{}: scene {} is not what {} was measured with ({}: hash {}, then {}); put its files back as they "
                    "were, or choose another folder with --out",
                    scene.where, scene.name, folder_.string(), kHeldByGeometry, now->second, then->second));
  }
  geometry.insert(record_->geometry.begin(), record_->geometry.end());
}

void EarlierRun::take_up_scenes(Json& scenes) const {
  if (!record_) return;
  const Json earlier = record_->context.value("scenes", Json::object());
  for (const auto& [name, report] : earlier.items())
    if (!scenes.contains(name)) scenes[name] = report;
}

std::vector<Json> EarlierRun::other_contexts(const Json& now) const {
  if (!record_) return {};
  std::vector<Json> all = record_->earlier, others;
  all.push_back(record_->context);
  for (const Json& context : all) {
    const auto same = [&](const Json& other) { return differing_conditions(context, other).empty(); };
    if (!same(now) && std::ranges::none_of(others, same)) others.push_back(context);
  }
  return others;
}

Json EarlierRun::merged_from() const { return record_ ? record_->context.value("merged_from", Json()) : Json(); }

Origin EarlierRun::origin() const {
  return record_ && record_->earlier.empty() ? origin_of(record_->context) : Origin{};
}

}  // namespace arboretum
