// StructurePool: the structures of one scene that cells share, built once and freed when the last cell has
// ended.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "experiments/registry.h"
#include "experiments/result.h"
#include "experiments/scene_data.h"
#include "experiments/structure_cache.h"

namespace arboretum {

/// Build settings of a cell.
[[nodiscard]] BuildSettings settings_of(const Cell& cell);

class StructurePool {
 public:
  /// `quality`: compute statistics (SAH, EPO, depths) of every structure.
  StructurePool(const TriangleMesh& mesh, const Registry& registry, bool quality, StructureCache& cache);

  /// Cells with the same key trace the same structure: structure, builder, parameters, leaf, and ISA or
  /// threads where the structure says that its build depends on them.
  [[nodiscard]] std::string key(const Cell& cell) const;
  /// Bytes that the cell's structure may take: as measured, else guessed from its triangles.
  [[nodiscard]] std::size_t expected_bytes(const Cell& cell) const;
  /// The structure, at the first call loaded from the cache, or built with all threads of the machine (the tree
  /// is the same for any number) and kept in the cache.
  [[nodiscard]] const Accel& get(const Cell& cell);
  /// Seconds and threads of the shared build, apart from what build cells measure; or seconds of loading it.
  void add_build_facts(const Cell& cell, Json& facts) const;
  void release(const std::string& key) { held_.erase(key); }
  [[nodiscard]] std::size_t held_bytes() const;
  /// Triangles, bytes, bytes_per_triangle and, with quality, statistics of a structure with this key.
  [[nodiscard]] const Json& facts(const Cell& cell, const Accel& accel);

 private:
  const TriangleMesh& mesh_;
  const Registry& registry_;
  bool quality_;
  StructureCache& cache_;
  std::map<std::string, std::unique_ptr<Accel>> held_;
  struct SharedBuild {
    BuildReport report;
    unsigned threads = 1;
    bool loaded = false;  ///< from the cache; report.seconds are then those of loading
  };
  std::map<std::string, SharedBuild> builds_;
  std::map<std::string, Json> facts_;
};

}  // namespace arboretum
