#include "experiments/structure_pool.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "core/timer.h"

namespace arboretum {

BuildSettings settings_of(const Cell& cell) {
  return {.builder = cell.builder,
          .leaf = cell.leaf,
          .isa = cell.isa,
          .threads = cell.threads,
          .parameters = cell.parameters};
}

StructurePool::StructurePool(const TriangleMesh& mesh, const Registry& registry, bool quality, StructureCache& cache)
    : mesh_(mesh), registry_(registry), quality_(quality), cache_(cache) {}

std::string StructurePool::key(const Cell& cell) const {
  std::string key = fmt::format("{}/{}/{}", cell.structure, cell.builder_name(), cell.leaf);
  const StructureEntry* entry = registry_.structure(cell.structure);
  if (entry && entry->info.build_depends_on_isa) key += fmt::format("/{}", to_string(cell.isa));
  if (entry && entry->info.build_depends_on_threads) key += fmt::format("/threads:{}", cell.threads);
  return key;
}

std::size_t StructurePool::expected_bytes(const Cell& cell) const {
  constexpr std::size_t kBytesPerTriangle = 200;  // a wide BVH with precomputed edges takes 100 to 160
  const auto known = facts_.find(key(cell));
  return known != facts_.end() ? known->second.at("bytes").get<std::size_t>() : kBytesPerTriangle * mesh_.size();
}

const Accel& StructurePool::get(const Cell& cell) {
  const std::string name = key(cell);
  if (const auto known = held_.find(name); known != held_.end()) return *known->second;
  BuildSettings settings = settings_of(cell);
  const StructureInfo& info = registry_.structure(cell.structure)->info;
  if (!info.build_depends_on_isa) settings.isa = registry_.isas.back();
  if (!info.build_depends_on_threads) settings.threads = std::max(1u, std::thread::hardware_concurrency());
  SharedBuild& build = builds_[name];
  build.threads = settings.threads;
  const double begin = wall_seconds();
  std::unique_ptr<Accel> accel = cache_.find(cell.structure, mesh_, settings);
  build.loaded = accel != nullptr;
  if (build.loaded) {
    build.report.seconds = wall_seconds() - begin;
  } else {
    accel = registry_.build(cell.structure, mesh_, settings, build.report);
    cache_.keep(*accel, mesh_, settings);
  }
  return *held_.emplace(name, std::move(accel)).first->second;
}

void StructurePool::add_build_facts(const Cell& cell, Json& facts) const {
  const SharedBuild& build = builds_.at(key(cell));
  facts[build.loaded ? "shared_load_seconds" : "shared_build_seconds"] = build.report.seconds;
  if (!build.loaded) facts["shared_build_threads"] = build.threads;
}

std::size_t StructurePool::held_bytes() const {
  std::size_t sum = 0;
  for (const auto& [key, accel] : held_) sum += accel->bytes();
  return sum;
}

const Json& StructurePool::facts(const Cell& cell, const Accel& accel) {
  auto [entry, fresh] = facts_.try_emplace(key(cell), Json::object());
  if (fresh) {
    Json& facts = entry->second;
    facts["triangles"] = mesh_.size();
    facts["bytes"] = accel.bytes();
    facts["bytes_per_triangle"] = static_cast<double>(accel.bytes()) / static_cast<double>(mesh_.size());
    // A moving structure shows itself as it is half-way through.
    if (quality_ && mesh_.moves())
      add_facts(facts, compute_statistics(accel, pose(mesh_, 0.5f), cell.parameters, true));
    else if (quality_)
      add_facts(facts, compute_statistics(accel, mesh_, cell.parameters, true));
  }
  return entry->second;
}

}  // namespace arboretum
