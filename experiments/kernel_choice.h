// KernelChoice: one row of the kernel table by names, `auto` filled in, and a structure built for it: what commands
// need that trace with one combination alone.
#pragma once

#include <memory>
#include <string>

#include "experiments/registry.h"

namespace arboretum {

struct KernelChoice {
  std::string structure = "auto";  ///< bvh8, or bvh4_motion for a mesh that moves
  std::string builder = "auto", leaf = "auto";
  std::string intersector = "auto";  ///< watertight, or pluecker where the structure has no kernels of it (embree)
  std::string box = "auto";
  std::string traversal = "auto";  ///< the structure's way called so, else single rays
  std::string isa = "auto";        ///< the best of this machine
  unsigned threads = 0;            ///< of the build; 0: one a core
};

struct BuiltKernel {
  const KernelRow* kernel = nullptr;
  std::string builder;
  std::unique_ptr<Accel> accel;
  BuildReport report;
  [[nodiscard]] std::string name() const;  ///< structure/builder/leaf/intersector/box/traversal/isa
};

/// Throws UserError for a name that does not exist (naming the nearest), for what does not go together, and where the
/// machine lacks the instruction set. The mesh must outlive the structure.
[[nodiscard]] BuiltKernel build_kernel(const KernelChoice& choice, const TriangleMesh& mesh, const Registry& registry);

}  // namespace arboretum
