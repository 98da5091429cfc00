#include "structures/two_level/two_level.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/rounding.h"
#include "core/zero_area.h"
#include "structures/archive.h"
#include "structures/below.h"
#include "structures/builders/builders.h"
#include "structures/builders/phase_clock.h"
#include "structures/leaves/leaf_names.h"
#include "structures/own_parameters.h"

namespace arboretum::two_level {
namespace {

constexpr std::string_view kTopLeaf = "triangle1i";

bool has(const std::vector<std::string_view>& list, std::string_view name) {
  return std::ranges::find(list, name) != list.end();
}

/// Those that have triangles: the others take no part. A mesh without instances is one, where it is.
std::vector<const Instance*> instances_of(const TriangleMesh& mesh) {
  static const Instance whole;
  std::vector<const Instance*> instances;
  if (mesh.instancing) {
    for (const Instance& i : mesh.instancing->instances)
      if (mesh.instancing->prototypes[i.prototype].size() > 0) instances.push_back(&i);
  } else if (mesh.size() > 0) {
    instances.push_back(&whole);
  }
  return instances;
}

bool is_searchable(std::string_view below) {
  bool found = false;
  for_each_type(Searchable{}, [&]<class S>(std::type_identity<S>) { found |= S::kName == below; });
  return found;
}

/// Bounds of the box's image, computed in double and rounded outwards.
Bounds3f image(const AffineMap& map, const Bounds3f& box) {
  if (box.empty() || is_identity(map)) return box;
  Bounds3f result;
  for (int row = 0; row < 3; ++row) {
    double low = map.m[row][3], high = low;
    for (int column = 0; column < 3; ++column) {
      const double a = map.m[row][column] * box.lower[std::size_t(column)],
                   b = map.m[row][column] * box.upper[std::size_t(column)];
      low += std::min(a, b), high += std::max(a, b);
    }
    result.lower[std::size_t(row)] = rounded_down(low), result.upper[std::size_t(row)] = rounded_up(high);
  }
  return result;
}

/// The largest row sum of |m|, m the linear part; the largest |component| of the translation.
double norm(const AffineMap& map) {
  double largest = 0.0;
  for (const auto& r : map.m) largest = std::max(largest, std::fabs(r[0]) + std::fabs(r[1]) + std::fabs(r[2]));
  return largest;
}
double shift(const AffineMap& map) {
  return std::max({std::fabs(map.m[0][3]), std::fabs(map.m[1][3]), std::fabs(map.m[2][3])});
}

/// How far first(second(x)) is from x at most, for |x| up to 1 (`linear`) and for x = 0; bounds, rounding included.
struct Residual {
  double linear = 0.0, constant = 0.0;
  Residual(const AffineMap& first, const AffineMap& second) {
    for (int i = 0; i < 3; ++i) {
      double row[4];
      for (int j = 0; j < 4; ++j) {
        double sum = j == 3 ? first.m[i][3] : i == j ? -1.0 : 0.0, magnitude = std::fabs(sum);
        for (int k = 0; k < 3; ++k) {
          const double product = first.m[i][k] * second.m[k][j];
          sum += product, magnitude += std::fabs(product);
        }
        row[j] = std::fabs(sum) + 0x1p-50 * magnitude;
      }
      linear = std::max(linear, row[0] + row[1] + row[2]), constant = std::max(constant, row[3]);
    }
  }
};

/// What of a prototype all its instances share.
struct PrototypeFacts {
  Bounds3f bounds;
  std::vector<std::uint32_t> vertices;  ///< those that triangles name
  std::vector<bool> has_no_area;        ///< of its triangles

  PrototypeFacts() = default;
  explicit PrototypeFacts(const TriangleMesh& mesh) : bounds(mesh.bounds()), has_no_area(mesh.size()) {
    std::vector<bool> named(mesh.vertices.size());
    for (std::size_t i = 0; i < mesh.size(); ++i) {
      const Triangle& t = mesh.triangles[i];
      named[t.a] = named[t.b] = named[t.c] = true;
      const std::array<Vec3f, 3> c = mesh.corners(i);
      has_no_area[i] = has_zero_area(c[0], c[1], c[2]);
    }
    for (std::uint32_t v = 0; v < named.size(); ++v)
      if (named[v]) vertices.push_back(v);
  }
};

/// Finds Placed::laid_out, false also where the flat mesh's indices are not the prototype's plus one number, and
/// returns the instance's bounds in the flat mesh.
Bounds3f compare_with_flat(const TriangleMesh& object, const PrototypeFacts& facts, const TriangleMesh& mesh,
                           Placed& placed) {
  Bounds3f box;
  const Triangle* const flat = mesh.triangles.data() + placed.first_primitive;
  const std::uint32_t offset = flat[0].a - object.triangles[0].a;
  bool same_indices = true, same_areas = true;
  for (std::size_t k = 0; k < object.size(); ++k) {
    const Triangle &t = object.triangles[k], &f = flat[k];
    same_indices &= (f.a - t.a == offset) & (f.b - t.b == offset) & (f.c - t.c == offset);
    same_areas &= facts.has_no_area[k] == has_zero_area(mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c]);
  }
  placed.laid_out = same_indices && same_areas;
  if (!same_indices) {
    for (std::size_t k = 0; k < object.size(); ++k) box.extend(mesh.bounds(placed.first_primitive + k));
    return box;
  }
  for (const std::uint32_t v : facts.vertices) {
    const Vec3f at = mesh.vertices[v + offset],
                image = placed.identity ? object.vertices[v] : transform_point(*placed.to_world, object.vertices[v]);
    box.extend(at);
    placed.laid_out &= std::memcmp(&image, &at, sizeof(Vec3f)) == 0;
  }
  return box;
}

/// Placed::pad and pad_per_distance, as two_level_kernels.h derives them; `size`: the prototype's largest |coordinate|.
/// Infinite, so that every box is met, for a map that is as good as singular.
void set_pads(Placed& placed, double size) {
  const AffineMap &to_world = *placed.to_world, &to_object = placed.to_object;
  const double object_per_world = norm(to_object), world_per_object = norm(to_world);
  const double magnification = 4.01 * object_per_world * world_per_object;
  double mismatch = 0.0;  // between object space and what to_object makes of the flat mesh
  if (!placed.identity || !placed.laid_out) {
    const Residual back(to_object, to_world), forth(to_world, to_object);
    const double rounding = placed.laid_out ? 0x1p-23 : 0x1p-20, least = placed.laid_out ? 0x1p-149 : 0x1p-126;
    mismatch = back.linear * size + back.constant +
               object_per_world * (rounding * (world_per_object * size + shift(to_world)) + least);
    if (!(back.linear < 0x1p-10 && forth.linear < 0x1p-10)) mismatch = Bounds3f::kInfinity;
  }
  placed.pad = rounded_up(magnification * size + 1.01 * 0x1p21 * mismatch +
                          0x1p-24 * (object_per_world * shift(to_world) + shift(to_object)));
  placed.pad_per_distance = rounded_up(magnification);
}

/// One triangle an instance, with the instance's bounds: what the top is built over, by builders that take a triangle
/// as its box: one cut by a plane would be cut as the triangle, which stands for a box and is none. Metered.
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
  BelowVisitor(StructureVisitor& to, const AffineMap& to_world, std::uint32_t first_primitive, unsigned depth,
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
  [[nodiscard]] Bounds3f in_world(const Bounds3f& box) const { return image(to_world_, box); }

  StructureVisitor& to_;
  const AffineMap& to_world_;
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
    i.no_streams = i.no_queue =
        "not built: a ray that waits would keep both its searches, the top's and that in an instance; rays go alone or "
        "in packets";
    i.builders = binary_builder_names();
    i.takes_below = true;
    i.leaves = all_leaf_names();
    return i;
  }();
  return info;
}

void TwoLevel::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  check_below(static_info(), settings.parameters.below);
  const StructureEntry* entry = find_structure(settings.parameters.below);
  const StructureInfo& below = entry->info;
  const std::string pair = "two_level over " + std::string(below.name) + ": ";
  if (mesh.instancing && !is_searchable(below.name)) {
    throw UserError(pair + "kernels do not know how a ray that was mapped goes through " + std::string(below.name) +
                    "; take " + std::string(bvh::Bvh8::kName));
  }
  if (!has(below.builders, settings.builder))
    throw UserError(pair + std::string(below.name) + " has no builder " + settings.builder + "; its first is " +
                    std::string(below.builders.front()));
  if (!has(below.leaves, settings.leaf))
    throw UserError(pair + std::string(below.name) + " has no leaf " + settings.leaf);
  if (const std::string why = below.why_not_built(settings.builder, settings.leaf); !why.empty())
    throw UserError(pair + why);

  mesh_ = &mesh, below_ = settings.parameters.below, leaf_ = settings.leaf;
  prototypes_.clear(), placed_.clear();

  const auto add_prototype = [&](const TriangleMesh& prototype) {
    BuildReport one;
    prototypes_.push_back(create_structure(*entry, settings.parameters));
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
  BoxMesh boxes(instances_of(mesh).size());
  place([&](std::size_t i, const Bounds3f& box) { boxes.set(i, box); });
  clock.ends("instances");
  BuildSettings top = settings;
  if (!has(binary_builder_names(), top.builder)) top.builder = binary_builder_names().front();
  top.leaf = kTopLeaf, top.parameters.max_leaf_blocks = 1;
  top.parameters.duplication_budget = 0.0f;  // builders that split triangles must not (BoxMesh)
  BuildReport top_report;
  top_.build(boxes.mesh(), top, top_report);
  clock.ends("top");
}

const TriangleMesh& TwoLevel::prototype(std::size_t i) const {
  return mesh_->instancing ? mesh_->instancing->prototypes[i] : *mesh_;
}

template <class SetBox>
void TwoLevel::place(const SetBox& set_box) {
  const std::vector<const Instance*> instances = instances_of(*mesh_);
  placed_.resize(instances.size());
  if (!mesh_->instancing) {
    if (placed_.empty()) return;
    placed_[0].to_world = &instances[0]->to_world, placed_[0].below = prototypes_[0].get();
    return set_box(0, mesh_->bounds());
  }
  std::vector<PrototypeFacts> facts(prototypes_.size());
  tbb::parallel_for(std::size_t{0}, facts.size(), [&](std::size_t i) { facts[i] = PrototypeFacts(prototype(i)); });
  for (const Instance* instance : instances) {
    const Bounds3f box = image(instance->to_world, facts[instance->prototype].bounds);
    if (is_finite(box.lower) && is_finite(box.upper)) continue;
    throw UserError("two_level: the image of a prototype's box, of the instance that begins at triangle " +
                    std::to_string(instance->first_primitive) + ", is beyond float; give its map smaller numbers");
  }
  tbb::parallel_for(std::size_t{0}, instances.size(), [&](std::size_t i) {
    const Instance& instance = *instances[i];
    Placed placed;
    placed.identity = is_identity(instance.to_world);
    if (!placed.identity) placed.to_object = inverse(instance.to_world);
    placed.to_world = &instance.to_world;
    placed.below = prototypes_[instance.prototype].get();
    placed.first_primitive = instance.first_primitive;
    const PrototypeFacts& of = facts[instance.prototype];
    const Bounds3f box = compare_with_flat(prototype(instance.prototype), of, *mesh_, placed);
    set_pads(placed, largest_coordinate(of.bounds));
    placed_[i] = placed;
    set_box(i, box);
  });
}

void TwoLevel::archive(Archive& archive) {
  archive.expect(2);
  archive(below_, leaf_);
  top_.archive(archive);
  mesh_ = &archive.mesh();
  if (archive.is_loading()) {
    const StructureEntry* entry = find_structure(below_);
    if (!entry) throw UserError("two_level: the file's structure below, " + below_ + ", is not in this build");
    const std::size_t count = mesh_->instancing ? mesh_->instancing->prototypes.size() : instances_of(*mesh_).size();
    for (std::size_t i = 0; i < count; ++i) prototypes_.push_back(entry->create());
  }
  for (std::size_t i = 0; i < prototypes_.size(); ++i) {
    archive.of_mesh(prototype(i), [&](Archive& a) { prototypes_[i]->archive(a); });
  }
  if (archive.is_loading()) place([](std::size_t, const Bounds3f&) {});
}

bool TwoLevel::visit(StructureVisitor& visitor) const {
  std::set<const Accel*> shown;
  bool seen = true;
  const auto show = [&](std::uint32_t index, unsigned depth) {
    const Placed& p = placed_[index];
    BelowVisitor below(visitor, *p.to_world, p.first_primitive, depth, shown.insert(p.below).second);
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
