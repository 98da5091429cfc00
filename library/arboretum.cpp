#include "library/arboretum.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/mesh_check.h"
#include "core/names.h"
#include "structures/below.h"
#include "structures/build_threads.h"
#include "structures/parameter_limits.h"
#include "structures/structure_file.h"
#include "traversal/kernel_keys.h"

namespace arboretum {
namespace {

void check_name(std::string_view kind, std::string_view name, std::span<const std::string_view> valid) {
  (void)index_of_name(kind, name, valid);
}

std::vector<std::string_view> isa_names(std::span<const Isa> isas) {
  std::vector<std::string_view> names;
  for (Isa isa : isas) names.push_back(to_string(isa));
  return names;
}

std::string_view leaf_of(const TracerSettings& s, Isa isa) {
  return is_auto(s.leaf) ? default_leaf(s.structure, s.intersector, isa) : std::string_view(s.leaf);
}

/// Of a structure that stands above others the row where the one below has the same, so that a scene without instances
/// is answered.
const KernelRow* find_both(const TracerSettings& s, std::string_view leaf, std::string_view traversal, Isa isa) {
  const auto find_of = [&](std::string_view structure) {
    return find_kernel(structure, leaf, s.intersector, s.box, traversal, isa);
  };
  const KernelRow* row = find_of(s.structure);
  return row && find_structure(s.structure)->info.takes_below && !find_of(s.parameters.below) ? nullptr : row;
}

const KernelRow* find(const TracerSettings& s, std::string_view traversal, Isa isa) {
  const std::string_view leaf = leaf_of(s, isa);
  const KernelRow* row = find_both(s, leaf, resolve_traversal(traversal, isa), isa);
  return row || traversal != kAuto ? row : find_both(s, leaf, "single", isa);
}

/// Why find() found none.
std::string why_none(const TracerSettings& s, Isa isa) {
  const std::string traversal = resolve_traversal(s.traversal, isa);
  const auto why = [&](std::string_view structure) {
    return why_no_kernel(structure, leaf_of(s, isa), s.intersector, s.box, traversal, isa);
  };
  std::string of_structure = why(s.structure);
  const auto has_intersector = [&](const KernelRow& row) {
    return row.structure == s.structure && row.intersector == s.intersector;
  };
  if (std::ranges::none_of(kernel_table(), has_intersector))
    of_structure.append("; intersector auto takes ").append(resolve_intersector(kAuto, s.structure, kernel_table()));
  if (!of_structure.empty() || !find_structure(s.structure)->info.takes_below) return of_structure;
  return s.structure + " over " + s.parameters.below + ": " + why(s.parameters.below);
}

/// In this order: instances are looked at through indices.
void check_mesh(const TriangleMesh& mesh) {
  check_triangles(mesh);
  check_instances(mesh);
}

/// The instruction sets that the settings allow, the best first.
std::vector<Isa> allowed_isas(const TracerSettings& s) {
  const std::span<const Isa> available = available_isas();
  if (is_auto(s.isa)) return {available.rbegin(), available.rend()};
  const std::optional<Isa> isa = parse_isa(s.isa);
  if (!isa) check_name("isa", s.isa, isa_names(kAllIsas));
  if (!is_available(*isa)) {
    std::string line = "isa " + s.isa + " is not available here; use one of";
    for (std::string_view name : isa_names(available)) line.append(" ").append(name);
    throw UserError(line);
  }
  return {*isa};
}

/// The first of the structure's; of one that stands above others the first that the one below has.
std::string_view default_builder(const StructureInfo& info, const BuilderParameters& parameters) {
  const StructureEntry* below = info.takes_below ? find_structure(parameters.below) : nullptr;
  return below ? below->info.builders.front() : info.builders.front();
}

/// The row for batches. Fills in what is left to the others: of the settings that `auto` and the like may stand in, all
/// but the builder.
const KernelRow& resolve_kernel(TracerSettings& s) {
  const AxisValues& known = axis_values();
  s.intersector = std::string(resolve_intersector(s.intersector, s.structure, kernel_table()));
  s.box = std::string(resolve_box(s.box, s.intersector));
  if (!is_auto(s.leaf)) check_name("leaf", s.leaf, find_structure(s.structure)->info.leaves);
  check_name("intersector", s.intersector, known.intersectors);
  check_name("box", s.box, known.boxes);
  if (is_auto(s.traversal)) s.traversal = kAuto;
  const std::vector<Isa> isas = allowed_isas(s);
  if (const std::string way = resolve_traversal(s.traversal, isas.front()); way == s.traversal && way != kAuto)
    check_name("traversal", way, known.traversals);
  for (Isa isa : isas) {
    if (const KernelRow* row = find(s, s.traversal, isa)) {
      s.isa = to_string(isa), s.leaf = row->leaf, s.traversal = row->traversal;
      return *row;
    }
  }
  throw UserError(why_none(s, isas.front()));
}

}  // namespace

TriangleMesh make_mesh(std::span<const float> coordinates, std::span<const std::uint32_t> indices) {
  if (coordinates.size() % 3 != 0)
    throw UserError("make_mesh: " + std::to_string(coordinates.size()) + " coordinates; a vertex has three");
  if (indices.size() % 3 != 0)
    throw UserError("make_mesh: " + std::to_string(indices.size()) + " indices; a triangle has three");
  TriangleMesh mesh;
  mesh.vertices.reserve(coordinates.size() / 3);
  for (std::size_t i = 0; i < coordinates.size(); i += 3)
    mesh.vertices.push_back({coordinates[i], coordinates[i + 1], coordinates[i + 2]});
  mesh.triangles.reserve(indices.size() / 3);
  for (std::size_t i = 0; i < indices.size(); i += 3)
    mesh.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  return mesh;
}

TriangleMesh make_mesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles) {
  TriangleMesh mesh;
  mesh.vertices.assign(vertices.begin(), vertices.end());
  mesh.triangles.assign(triangles.begin(), triangles.end());
  return mesh;
}

Tracer::Tracer(TriangleMesh mesh, TracerSettings settings, NotBuiltYet)
    : mesh_(std::make_unique<const TriangleMesh>(std::move(mesh))), settings_(std::move(settings)) {
  check_mesh(*mesh_);
  settings_.structure = std::string(resolve_structure(settings_.structure, mesh_->moves()));
  const StructureEntry* entry = find_structure(settings_.structure);
  if (!entry) {
    std::vector<std::string_view> names;
    for (const StructureEntry& e : all_structures()) names.push_back(e.info.name);
    check_name("structure", settings_.structure, names);
  }
  if (is_auto(settings_.parameters.below)) settings_.parameters.below = BuilderParameters{}.below;
  check_below(entry->info, settings_.parameters.below);
  if (is_auto(settings_.builder)) settings_.builder = default_builder(entry->info, settings_.parameters);
  if (settings_.threads == 0) settings_.threads = std::max(1u, std::thread::hardware_concurrency());
  batch_ = &resolve_kernel(settings_);
  const auto row_or_batch = [&](const std::string& traversal) {
    const KernelRow* row = find(settings_, traversal, batch_->isa);
    return row ? row : batch_;
  };
  one_ = row_or_batch("single");
  const std::string together = batch_->traversal.starts_with("hybrid") ? "hybrid" : "packet";
  for (std::size_t i = 0; i < kPacketSizes.size(); ++i)
    packet_[i] = row_or_batch(together + std::to_string(kPacketSizes[i]));
}

BuildSettings Tracer::build_settings() const {
  return {.builder = settings_.builder,
          .leaf = settings_.leaf,
          .isa = batch_->isa,
          .threads = settings_.threads,
          .parameters = settings_.parameters};
}

Tracer::Tracer(TriangleMesh mesh, TracerSettings settings)
    : Tracer(std::move(mesh), std::move(settings), NotBuiltYet{}) {
  accel_ = build_structure(settings_.structure, *mesh_, build_settings(), report_);
}

Tracer Tracer::load(TriangleMesh mesh, const std::filesystem::path& file, TracerSettings settings) {
  Tracer tracer(std::move(mesh), std::move(settings), NotBuiltYet{});
  check_parameters(tracer.settings_.parameters);
  tracer.accel_ = load_structure(tracer.settings_.structure, *tracer.mesh_, tracer.build_settings(), file);
  return tracer;
}

void Tracer::save(const std::filesystem::path& file) const { save_structure(*accel_, *mesh_, build_settings(), file); }

void Tracer::refit(TriangleMesh mesh) {
  auto moved = std::make_unique<const TriangleMesh>(std::move(mesh));
  check_mesh(*moved);
  refit_structure(*accel_, *moved, settings_.threads);
  mesh_ = std::move(moved);
}

void Tracer::check(const RayBatch& rays, std::size_t answers) const {
  if (answers != rays.size())
    throw UserError("a batch of " + std::to_string(rays.size()) + " rays with room for " + std::to_string(answers) +
                    " answers");
  if (!rays.times.empty() && rays.times.size() != rays.size())
    throw UserError("a batch of " + std::to_string(rays.size()) + " rays with " + std::to_string(rays.times.size()) +
                    " times");
  check_settings(rays.settings);
  if (const std::string why = why_no_threshold(batch_->traversal, rays.settings.hybrid_threshold); !why.empty())
    throw UserError(why);
}

void Tracer::closest_hit(RayBatch rays, std::span<Hit> hits) const {
  check(rays, hits.size());
  batch_->closest_hit(*accel_, rays, hits, nullptr);
}

void Tracer::any_hit(RayBatch rays, std::span<std::uint8_t> occluded) const {
  check(rays, occluded.size());
  batch_->any_hit(*accel_, rays, occluded, nullptr);
}

}  // namespace arboretum
