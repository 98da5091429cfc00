#include "structures/accel.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>

#include "core/error.h"
#include "core/memory_meter.h"
#include "core/mesh_check.h"
#include "core/names.h"
#include "core/timer.h"
#include "structures/below.h"
#include "structures/build_threads.h"
#include "structures/own_parameters.h"
#include "structures/parameter_limits.h"
#include "structures/registry.h"

namespace arboretum {
namespace {

/// What a build holds at most, by the process's meter. Of builds at once the first alone sets the peak back, so that
/// none loses what it measures by: theirs are of all of them together.
class BuildMemory {
 public:
  BuildMemory() {
    const std::lock_guard lock(mutex_);
    if (under_way_++ == 0) MemoryMeter::reset_peak();
    before_ = MemoryMeter::current();
  }
  ~BuildMemory() {
    const std::lock_guard lock(mutex_);
    --under_way_;
  }
  BuildMemory(const BuildMemory&) = delete;
  BuildMemory& operator=(const BuildMemory&) = delete;

  /// Never less than the structure's bytes: others may have given back meanwhile what they held before.
  [[nodiscard]] std::size_t peak_bytes(const Accel& accel) const {
    const std::size_t peak = MemoryMeter::peak();
    return std::max(peak > before_ ? peak - before_ : 0, accel.bytes());
  }

 private:
  inline static std::mutex mutex_;
  inline static unsigned under_way_ = 0;
  std::size_t before_ = 0;
};

}  // namespace

std::span<const StructureEntry> all_structures() {
  static const std::vector<StructureEntry> entries = [] {
    std::vector<StructureEntry> list = registered_structures();
    for (const StructureEntry& e : list) {
      if (std::ranges::count(list, e.info.name, [](const StructureEntry& o) { return o.info.name; }) > 1)
        throw UserError("two structures are called " + std::string(e.info.name) + "; give one another kName");
    }
    // What stands above others takes the builders of all that can stand below it.
    for (StructureEntry& above : list) {
      if (!above.info.takes_below) continue;
      for (const StructureEntry& below : list) {
        if (!why_not_below(below.info).empty()) continue;
        for (std::string_view builder : below.info.builders) {
          if (std::ranges::find(above.info.builders, builder) == above.info.builders.end())
            above.info.builders.push_back(builder);
        }
      }
    }
    return list;
  }();
  return entries;
}

void Accel::refit(const TriangleMesh&) {
  throw UserError(std::string(info().name) + " cannot be refitted; build it anew");
}

void Accel::archive(Archive&) {
  throw UserError(std::string(info().name) + " cannot be saved to a file; build it anew");
}

std::string why_not_below(const StructureInfo& below) {
  if (below.takes_below) return std::string(below.name) + " stands above other structures, not below one";
  if (below.build_depends_on_isa)
    return std::string(below.name) + " is a library with a scene of its own, and cannot stand below";
  if (below.needs_motion)
    return std::string(below.name) + " is for moving scenes, and instances are held at one moment";
  return {};
}

const StructureEntry* find_structure(std::string_view name) {
  for (const StructureEntry& e : all_structures())
    if (e.info.name == name) return &e;
  return nullptr;
}

std::unique_ptr<Accel> build_structure(std::string_view name, const TriangleMesh& mesh, const BuildSettings& settings,
                                       BuildReport& report) {
  const StructureEntry* entry = find_structure(name);
  if (!entry) {
    std::vector<std::string> names;
    for (const StructureEntry& e : all_structures()) names.emplace_back(e.info.name);
    throw UserError(unknown_name_message("structure", name, names));
  }
  const auto check = [&](const char* kind, const std::string& value, const std::vector<std::string_view>& valid) {
    for (std::string_view v : valid)
      if (v == value) return;
    const std::vector<std::string> names(valid.begin(), valid.end());
    throw UserError(std::string(name) + ": " + unknown_name_message(kind, value, names));
  };
  check("builder", settings.builder, entry->info.builders);
  check("leaf", settings.leaf, entry->info.leaves);
  if (const std::string why = entry->info.why_not_built(settings.builder, settings.leaf); !why.empty())
    throw UserError(why);

  check_parameters(settings.parameters);
  check_below(entry->info, settings.parameters.below);
  check_triangles(mesh, Largest::finite);
  if (!entry->info.holds_motion) check_one_moment(mesh, name);
  if (entry->info.takes_below) check_instances(mesh, Largest::finite);

  std::unique_ptr<Accel> accel = create_structure(*entry, settings.parameters);
  report = {};
  BuildSettings allowed = settings;
  allowed.threads = allowed_threads(settings.threads);
  tbb::task_arena arena(int(allowed.threads), 1);
  const BuildMemory memory;
  const double wall = wall_seconds(), cpu = process_cpu_seconds();
  arena.execute([&] { accel->build(mesh, allowed, report); });
  report.seconds = wall_seconds() - wall - report.apart_seconds;
  report.cpu_seconds = std::max(process_cpu_seconds() - cpu - report.apart_seconds, 0.0);
  report.peak_bytes = memory.peak_bytes(*accel);
  return accel;
}

double refit_structure(Accel& accel, const TriangleMesh& mesh, unsigned threads) {
  const double start = wall_seconds();
  tbb::task_arena(int(allowed_threads(threads)), 1).execute([&] { accel.refit(mesh); });
  return wall_seconds() - start;
}

}  // namespace arboretum
