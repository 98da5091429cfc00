#include "structures/brute_force/brute_force.h"

#include <algorithm>
#include <numeric>

#include "core/error.h"
#include "core/names.h"
#include "structures/archive.h"
#include "structures/leaves/leaf_names.h"

namespace arboretum::brute_force {

const StructureInfo& BruteForce::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "every ray tests every triangle: the reference, for small scenes";
    i.only_single_rays = "every ray tests every triangle: there is no node to share";
    i.builders = {"in_order"};
    i.uses_parameters = false;
    i.flat = true;
    i.leaves = all_leaf_names();
    return i;
  }();
  return info;
}

void BruteForce::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport&) {
  if (settings.builder != info().builders.front()) {
    throw UserError(
        unknown_name_message("builder of brute_force", settings.builder, std::vector<std::string>{"in_order"}));
  }
  constexpr std::size_t kMostTriangles = 0x7ffffffe;  // ids are compared as int32, and INT_MAX stands for none
  if (mesh.size() > kMostTriangles) throw UserError("brute_force: the mesh has more than 2^31 - 2 triangles; split it");
  const LeafForm& form = require_leaf_form(kName, settings.leaf);
  block_width_ = form.width;
  block_count_ = unsigned((mesh.size() + form.width - 1) / form.width);
  arena_ = Arena();
  arena_ = Arena(block_count_ * form.bytes);
  std::vector<std::uint32_t> ids(mesh.size());
  std::iota(ids.begin(), ids.end(), 0u);
  form.fill(arena_.data(), mesh, ids);
  triangles_ = mesh.size();
  bounds_ = mesh.bounds();
  vertices_ = mesh.vertices.data();
  leaf_ = settings.leaf;
}

void BruteForce::archive(Archive& archive) {
  archive(leaf_, arena_, triangles_, block_count_, block_width_, bounds_);
  vertices_ = archive.mesh().vertices.data();
}

bool BruteForce::visit(StructureVisitor& visitor) const {
  if (triangles_ == 0) return true;
  std::vector<std::uint32_t> primitives(triangles_);
  std::iota(primitives.begin(), primitives.end(), 0u);
  visitor.leaf({.bounds = bounds_,
                .primitives = primitives,
                .depth = 0,
                .blocks = block_count_,
                .block_width = block_width_,
                .bytes = arena_.bytes()});
  return true;
}

}  // namespace arboretum::brute_force
