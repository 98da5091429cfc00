#include "scenes/layout.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "core/coordinates.h"
#include "core/error.h"

namespace arboretum {
namespace {

constexpr std::size_t kMostFrames = 4096;

/// The kept triangles of [begin, end) as a mesh of their own; vertices that cannot be traced become the origin.
TriangleMesh part_of(const TriangleMesh& mesh, std::size_t begin, std::size_t end, const std::vector<bool>& kept) {
  std::uint32_t low = ~0u, high = 0;
  for (std::size_t i = begin; i < end; ++i) {
    if (!kept[i - begin]) continue;
    const Triangle& t = mesh.triangles[i];
    low = std::min({low, t.a, t.b, t.c}), high = std::max({high, t.a, t.b, t.c});
  }
  TriangleMesh part;
  if (low > high) return part;
  part.vertices.assign(mesh.vertices.begin() + low, mesh.vertices.begin() + high + 1);
  for (Vec3f& v : part.vertices)
    if (!is_in_range(v)) v = Vec3f{};
  for (std::size_t i = begin; i < end; ++i) {
    const Triangle& t = mesh.triangles[i];
    if (kept[i - begin]) part.triangles.push_back({t.a - low, t.b - low, t.c - low});
  }
  return part;
}

bool is_in_range(const TriangleMesh& mesh, const std::vector<bool>& kept) {
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    if (!kept[i]) continue;
    for (const Vec3f& p : mesh.corners(i))
      if (!is_in_range(p)) return false;
  }
  return true;
}

}  // namespace

TriangleMesh with_frames(const TriangleMesh& mesh, std::size_t frames) {
  TriangleMesh result{mesh.vertices, mesh.triangles, mesh.materials};
  if (frames < 2) return result;
  const std::size_t steps = mesh.moves() ? (frames - 1) / (mesh.frames() - 1) : 1;
  for (std::size_t k = 1; k < frames; ++k) {
    if (!mesh.moves() || k % steps == 0) {
      result.later_frames.push_back(mesh.moves() ? mesh.frame(k / steps) : mesh.vertices);
      continue;
    }
    const std::vector<Vec3f>&a = mesh.frame(k / steps), &b = mesh.frame(k / steps + 1);
    std::vector<Vec3f>& frame = result.later_frames.emplace_back(a.size());
    for (std::size_t v = 0; v < a.size(); ++v) frame[v] = interpolate(a[v], b[v], float(k % steps) / float(steps));
  }
  return result;
}

std::uint32_t Layout::add_part(TriangleMesh part) {
  parts_.push_back(std::move(part));
  return std::uint32_t(parts_.size() - 1);
}

void Layout::place(std::uint32_t part, const AffineMap& to_world, std::size_t first_material) {
  placed_.push_back({part, to_world, first_material});
  triangles_ += parts_[part].size(), vertices_ += parts_[part].vertices.size();
  if (triangles_ >= 0xffffffffu || vertices_ >= 0xffffffffu)
    throw UserError("more than 2^32 - 2 triangles or vertices once the instances are laid out");
}

void Layout::append(TriangleMesh& mesh, const TriangleMesh& part, const Placed& placed) const {
  const auto first = std::uint32_t(mesh.vertices.size());
  const bool moved = !is_identity(placed.to_world);
  const auto add = [&](std::vector<Vec3f>& to, const std::vector<Vec3f>& from) {
    for (const Vec3f& v : from) to.push_back(moved ? transform_point(placed.to_world, v) : v);
  };
  add(mesh.vertices, part.vertices);
  for (std::size_t k = 0; k < mesh.later_frames.size(); ++k) add(mesh.later_frames[k], part.later_frames[k]);
  for (const Triangle& t : part.triangles) mesh.triangles.push_back({t.a + first, t.b + first, t.c + first});
  for (std::size_t i = 0; i < part.size(); ++i)
    mesh.materials.push_back(std::uint16_t(placed.first_material + (part.materials.empty() ? 0 : part.materials[i])));
}

TriangleMesh Layout::take(bool keep_instances) {
  std::size_t intervals = 1;
  bool moves = false;
  for (const Placed& p : placed_) {
    if (!parts_[p.part].moves()) continue;
    moves = true;
    intervals = std::lcm(intervals, parts_[p.part].frames() - 1);
    if (intervals >= kMostFrames)
      throw UserError(
          "the meshes' key frames fall on more than 4096 different times; give them counts that go together, as 3, 5 "
          "and 9");
  }
  if (moves) {
    for (TriangleMesh& part : parts_) part = with_frames(part, intervals + 1);
  }
  TriangleMesh mesh;
  if (moves) mesh.later_frames.resize(intervals);
  mesh.vertices.reserve(vertices_), mesh.triangles.reserve(triangles_), mesh.materials.reserve(triangles_);
  for (std::vector<Vec3f>& frame : mesh.later_frames) frame.reserve(vertices_);
  auto instancing = std::make_shared<Instancing>();
  for (const Placed& p : placed_) {
    instancing->instances.push_back({p.part, std::uint32_t(mesh.size()), p.to_world});
    append(mesh, parts_[p.part], p);
  }
  if (keep_instances && !moves) {
    for (TriangleMesh& part : parts_) part.materials = {};
    instancing->prototypes = std::move(parts_);
    mesh.instancing = std::move(instancing);
  }
  parts_.clear(), placed_.clear();
  return mesh;
}

std::shared_ptr<const Instancing> kept_instances(const TriangleMesh& mesh, const std::vector<bool>& kept) {
  const Instancing& before = *mesh.instancing;
  auto after = std::make_shared<Instancing>();
  constexpr std::uint32_t kNone = ~0u;
  // What of a prototype is kept: its new number
  std::map<std::pair<std::uint32_t, std::vector<bool>>, std::uint32_t> known;
  std::uint32_t next = 0;
  for (const Instance& instance : before.instances) {
    const TriangleMesh& prototype = before.prototypes[instance.prototype];
    const std::size_t begin = instance.first_primitive, end = begin + prototype.size();
    std::vector<bool> pattern(kept.begin() + std::ptrdiff_t(begin), kept.begin() + std::ptrdiff_t(end));
    const auto left = std::uint32_t(std::count(pattern.begin(), pattern.end(), true));
    if (left == 0) continue;
    std::uint32_t number = kNone;
    if (is_identity(instance.to_world) || condition(instance.to_world) <= kWorstCondition) {
      const auto [entry, fresh] = known.try_emplace({instance.prototype, pattern}, kNone);
      if (fresh && is_in_range(prototype, pattern)) {
        entry->second = std::uint32_t(after->prototypes.size());
        after->prototypes.push_back(part_of(prototype, 0, prototype.size(), pattern));
      }
      number = entry->second;
    }
    if (number != kNone) {
      after->instances.push_back({number, next, instance.to_world});
    } else {
      after->instances.push_back({std::uint32_t(after->prototypes.size()), next, AffineMap{}});
      after->prototypes.push_back(part_of(mesh, begin, end, pattern));
    }
    next += left;
  }
  return after;
}

}  // namespace arboretum
