#include "structures/two_level/two_level.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/coordinates.h"
#include "core/error.h"
#include "intersectors/blocks.h"
#include "structures/archive.h"
#include "structures/builders/builders.h"
#include "structures/builders/phase_clock.h"
#include "structures/leaves/leaf_names.h"

namespace arboretum::two_level {
namespace {

constexpr std::string_view kTopLeaf = "triangle1i";

bool has(const std::vector<std::string_view>& list, std::string_view name) {
  return std::ranges::find(list, name) != list.end();
}

/// Those that have triangles: the others take no part. A mesh without instances is one, where it is.
std::vector<Instance> instances_of(const TriangleMesh& mesh) {
  if (!mesh.instancing) return std::vector<Instance>(mesh.size() > 0 ? 1 : 0);
  std::vector<Instance> instances = mesh.instancing->instances;
  std::erase_if(instances, [&](const Instance& i) { return mesh.instancing->prototypes[i.prototype].size() == 0; });
  return instances;
}

/// Bounds of the box's image, computed in double and rounded outwards.
Bounds3f image(const AffineMap& map, const Bounds3f& box) {
  if (box.empty()) return box;
  Bounds3f result;
  for (int row = 0; row < 3; ++row) {
    double low = map.m[row][3], high = low;
    for (int column = 0; column < 3; ++column) {
      const double a = map.m[row][column] * box.lower[std::size_t(column)],
                   b = map.m[row][column] * box.upper[std::size_t(column)];
      low += std::min(a, b), high += std::max(a, b);
    }
    result.lower[std::size_t(row)] = std::nextafter(float(low), -Bounds3f::kInfinity);
    result.upper[std::size_t(row)] = std::nextafter(float(high), Bounds3f::kInfinity);
  }
  return result;
}

/// One triangle an instance, with the instance's bounds: what the top is built over. Metered.
class BoxMesh {
 public:
  explicit BoxMesh(std::size_t count) {
    mesh_.vertices.resize(3 * count), mesh_.triangles.resize(count);
    MemoryMeter::add(bytes());
  }
  BoxMesh(const BoxMesh&) = delete;
  BoxMesh& operator=(const BoxMesh&) = delete;
  ~BoxMesh() { MemoryMeter::remove(bytes()); }

  void set(std::size_t i, const Bounds3f& box) noexcept {
    const auto first = std::uint32_t(3 * i);
    mesh_.vertices[first] = box.lower, mesh_.vertices[first + 1] = box.upper, mesh_.vertices[first + 2] = box.center();
    mesh_.triangles[i] = {first, first + 1, first + 2};
  }
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return mesh_; }

 private:
  [[nodiscard]] std::size_t bytes() const noexcept {
    return mesh_.vertices.size() * sizeof(Vec3f) + mesh_.triangles.size() * sizeof(Triangle);
  }
  TriangleMesh mesh_;
};

/// Hands on what a structure below shows, as part of the whole tree.
class BelowVisitor final : public StructureVisitor {
 public:
  BelowVisitor(StructureVisitor& to, const AffineMap* to_world, std::uint32_t first_primitive, unsigned depth,
               bool counts_bytes)
      : to_(to), to_world_(to_world), first_primitive_(first_primitive), depth_(depth), counts_bytes_(counts_bytes) {}

  void node(const NodeView& node) override {
    children_.clear();
    for (const Bounds3f& b : node.child_bounds) children_.push_back(in_world(b));
    to_.node({in_world(node.bounds), children_, node.depth + depth_, counts_bytes_ ? node.bytes : 0});
  }
  void leaf(const LeafView& leaf) override {
    primitives_.clear();
    for (std::uint32_t p : leaf.primitives) primitives_.push_back(p + first_primitive_);
    to_.leaf({in_world(leaf.bounds), primitives_, leaf.depth + depth_, leaf.blocks, leaf.block_width,
              counts_bytes_ ? leaf.bytes : 0});
  }

 private:
  [[nodiscard]] Bounds3f in_world(const Bounds3f& box) const { return to_world_ ? image(*to_world_, box) : box; }

  StructureVisitor& to_;
  const AffineMap* to_world_;
  std::uint32_t first_primitive_;
  unsigned depth_;
  bool counts_bytes_;
  std::vector<Bounds3f> children_;
  std::vector<std::uint32_t> primitives_;
};

/// Hands on the top's nodes, and shows an instance in place of each leaf.
template <class ShowInstance>
class TopVisitor final : public StructureVisitor {
 public:
  TopVisitor(StructureVisitor& to, ShowInstance show) : to_(to), show_(std::move(show)) {}
  void node(const NodeView& node) override { to_.node(node); }
  void leaf(const LeafView& leaf) override { show_(leaf.primitives[0], leaf.depth); }

 private:
  StructureVisitor& to_;
  ShowInstance show_;
};

}  // namespace

const StructureInfo& TwoLevel::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "a BVH over instances, a structure of another kind (parameter below) for each prototype";
    i.only_single_rays =
        "each ray enters an instance's own space, where it is another ray: what packets and streams share is lost at "
        "every instance";
    i.builders = binary_builder_names();
    i.takes_below = true;
    i.leaves = all_leaf_names();
    return i;
  }();
  return info;
}

void TwoLevel::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  const StructureEntry* entry = find_structure(settings.parameters.below);
  if (!entry) throw UserError("two_level: below: there is no structure '" + settings.parameters.below + "'");
  const StructureInfo& below = entry->info;
  const std::string pair = "two_level over " + std::string(below.name) + ": ";
  if (const std::string why = why_not_below(below); !why.empty()) throw UserError(pair + why);
  if (!has(below.builders, settings.builder))
    throw UserError(pair + std::string(below.name) + " has no builder " + settings.builder + "; its first is " +
                    std::string(below.builders.front()));
  if (!has(below.leaves, settings.leaf))
    throw UserError(pair + std::string(below.name) + " has no leaf " + settings.leaf);

  mesh_ = &mesh, below_ = settings.parameters.below, leaf_ = settings.leaf;
  prototypes_.clear(), placed_.clear();

  const auto add_prototype = [&](const TriangleMesh& prototype) {
    BuildReport one;
    prototypes_.push_back(entry->create());
    prototypes_.back()->build(prototype, settings, one);
    for (const auto& [name, seconds] : one.phases) {
      const auto known = std::ranges::find(report.phases, name, &std::pair<std::string, double>::first);
      if (known == report.phases.end())
        report.phases.emplace_back(name, seconds);
      else
        known->second += seconds;
    }
  };
  if (mesh.instancing) {
    for (const TriangleMesh& one : mesh.instancing->prototypes) add_prototype(one);
  } else if (mesh.size() > 0) {
    add_prototype(mesh);
  }

  PhaseClock clock(report);
  const std::vector<Instance> instances = instances_of(mesh);
  BoxMesh boxes(instances.size());
  place(instances, [&](std::size_t i, const Bounds3f& world) { boxes.set(i, world); });
  clock.ends("instances");
  BuildSettings top = settings;
  if (!has(binary_builder_names(), top.builder)) top.builder = binary_builder_names().front();
  top.leaf = kTopLeaf, top.parameters.max_leaf_blocks = 1;
  BuildReport top_report;
  top_.build(boxes.mesh(), top, top_report);
  clock.ends("top");
}

const TriangleMesh& TwoLevel::prototype(std::size_t i) const {
  return mesh_->instancing ? mesh_->instancing->prototypes[i] : *mesh_;
}

template <class SetBox>
void TwoLevel::place(const std::vector<Instance>& instances, const SetBox& set_box) {
  std::vector<Bounds3f> bounds(prototypes_.size());
  tbb::parallel_for(std::size_t{0}, bounds.size(), [&](std::size_t i) { bounds[i] = prototype(i).bounds(); });
  scene_size_ = largest_coordinate(mesh_->bounds());
  placed_.resize(instances.size());
  tbb::parallel_for(std::size_t{0}, instances.size(), [&](std::size_t i) {
    const Instance& instance = instances[i];
    const Bounds3f& object = bounds[instance.prototype];
    Placed& placed = placed_[i];
    placed = {};
    placed.identity = is_identity(instance.to_world);
    placed.to_object = placed.identity ? AffineMap{} : inverse(instance.to_world);
    placed.below = prototypes_[instance.prototype].get();
    placed.first_primitive = instance.first_primitive;
    placed.max_coordinate = largest_coordinate(object);
    // For the top: what the flat mesh has, and what the exact map makes of object space.
    Bounds3f world = object;
    if (!placed.identity) {
      world = image(instance.to_world, object);
      for (std::size_t k = 0; k < prototype(instance.prototype).size(); ++k)
        world.extend(mesh_->bounds(instance.first_primitive + k));
    }
    set_box(i, world);
  });
  magnification_ = 0.0f, reach_ = scene_size_;
  for (const Instance& instance : instances) {
    if (is_identity(instance.to_world)) continue;
    const Bounds3f world = image(instance.to_world, bounds[instance.prototype]);
    if (!is_finite(world.lower) || !is_finite(world.upper)) {
      throw UserError("two_level: the image of a prototype's box, of the instance that begins at triangle " +
                      std::to_string(instance.first_primitive) + ", is beyond float; give its map smaller numbers");
    }
    float shift = 0.0f;
    for (const auto& row : instance.to_world.m) shift = std::max(shift, float(std::fabs(row[3])));
    magnification_ = std::max(magnification_, float(condition(instance.to_world)));
    reach_ = std::max(reach_, scene_size_ + 2.0f * shift);
  }
}

void TwoLevel::archive(Archive& archive) {
  archive.expect(sizeof(Placed));
  archive(below_, leaf_);
  top_.archive(archive);
  mesh_ = &archive.mesh();
  const std::vector<Instance> instances = instances_of(*mesh_);
  if (archive.is_loading()) {
    const StructureEntry* entry = find_structure(below_);
    if (!entry) throw UserError("two_level: the file's structure below, " + below_ + ", is not in this build");
    const std::size_t count = mesh_->instancing ? mesh_->instancing->prototypes.size() : instances.size();
    for (std::size_t i = 0; i < count; ++i) prototypes_.push_back(entry->create());
  }
  for (std::size_t i = 0; i < prototypes_.size(); ++i) {
    archive.of_mesh(prototype(i), [&](Archive& a) { prototypes_[i]->archive(a); });
  }
  if (archive.is_loading()) place(instances, [](std::size_t, const Bounds3f&) {});
}

bool TwoLevel::visit(StructureVisitor& visitor) const {
  std::set<const Accel*> shown;
  bool seen = true;
  const std::vector<Instance> instances = instances_of(*mesh_);
  const auto show = [&](std::uint32_t index, unsigned depth) {
    const Placed& p = placed_[index];
    BelowVisitor below(visitor, p.identity ? nullptr : &instances[index].to_world, p.first_primitive, depth,
                       shown.insert(p.below).second);
    seen = p.below->visit(below) && seen;
  };
  TopVisitor top(visitor, show);
  return top_.visit(top) && seen;
}

std::size_t TwoLevel::bytes() const noexcept {
  std::size_t sum = top_.bytes() + placed_.size() * sizeof(Placed);
  for (const auto& p : prototypes_) sum += p->bytes();
  return sum;
}

}  // namespace arboretum::two_level
