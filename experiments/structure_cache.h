// StructureCache: built structures kept in a folder from one run to the next (`measure: {structure_cache: DIR}`).
#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "experiments/scene_data.h"
#include "structures/accel.h"

namespace arboretum {

class StructureCache {
 public:
  /// An empty `folder`: no cache, nothing is found or kept. A folder that is missing is made with the first structure.
  StructureCache(std::filesystem::path folder, NoteFunction note);

  /// The saved structure that fits, built by this very program; nullptr where there is none. A file that does not fit
  /// is noted and left to keep() to replace.
  [[nodiscard]] std::unique_ptr<Accel> find(std::string_view structure, const TriangleMesh& mesh,
                                            const BuildSettings& settings);
  /// Saves; what cannot be saved is noted once, and is no error.
  void keep(Accel& accel, const TriangleMesh& mesh, const BuildSettings& settings);

 private:
  std::filesystem::path folder_;
  NoteFunction note_;
  std::set<std::string> noted_;
};

}  // namespace arboretum
