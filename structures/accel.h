// Accel: what every acceleration structure is to the rest of the project.
//
// A structure lives in structures/<folder>/. It builds itself from a mesh, shows its nodes and leaves to a visitor (so
// that statistics are computed once, in one place, for all), and says what it can be built with. How rays go through
// it is written in structures/<folder>/*_kernels.h, once for all instruction sets (traversal/kernel_table.h).
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/bounds.h"
#include "core/isa.h"
#include "core/mesh.h"

namespace arboretum {

class Archive;

using ParameterValue = std::variant<unsigned, float, std::string>;

/// Parameters of a builder; a builder reads those that concern it. Part of the cell when they are swept.
struct BuilderParameters {
  static constexpr unsigned kOwn = ~0u;  ///< the builder's own choice
  unsigned bins = 32;                    ///< binned SAH: bins an axis, 4 .. 64
  float traversal_cost = 1.0f;           ///< cost of a node visit, in units of one block test
  float intersection_cost = 1.0f;        ///< cost of testing one leaf block
  unsigned max_leaf_blocks = 4;          ///< leaf blocks in a leaf at most, 1 .. 8
  unsigned morton_bits = 63;             ///< morton, ploc: bits of a code, 30 or 63
  unsigned ploc_radius = 16;             ///< ploc: neighbours looked at on each side, 1 .. 128
  float duplication_budget = 0.75f;      ///< spatial_sah: references added at most, as a share of the triangles, 0 .. 4
  float spatial_overlap = 1e-5f;  ///< spatial_sah: least overlap of an object split for a spatial one to be tried, and
                                  ///< least area that a reference more must save: shares of the root's area
  /// spatial_sah: a share x of references more must lower the estimated cost by (1 - this) x, 0.01 .. 1
  float spatial_gain = 0.8f;
  unsigned reinsertion_rounds = 4;  ///< builders that end in _reinsertion: passes over the tree, 1 .. 64
  unsigned reinsertion_top = kOwn;  ///< BVHs: how many of the tree's largest nodes the builder ends by reinserting, 0
                                    ///< .. 65536; kOwn: 512 after binned_sah, sweep_sah and spatial_sah, else none
  float empty_bonus = 0.2f;    ///< kdtree: share of the cost taken off a split that cuts away empty space, 0 .. 0.95
  unsigned max_depth = 0;      ///< kdtree, octree: deepest leaf; 0: 8 + 1.3 log2 n for the kdtree, 21 for the octree
  float grid_density = 0.25f;  ///< grid: cells a triangle, 0.01 .. 64
  std::string below = "bvh8";  ///< two_level: the structure of each prototype
  /// binary to N-wide: `greedy` (largest area first) or `optimal` (dynamic programming)
  std::string collapse = "optimal";
  /// Of what a structure has of its own (own_parameters.h), by name; what is not here keeps its default. The structure
  /// finds them in its member `parameters`.
  std::map<std::string, ParameterValue, std::less<>> own = {};
  friend bool operator==(const BuilderParameters&, const BuilderParameters&) = default;
};

struct BuildSettings {
  std::string builder = "binned_sah";
  std::string leaf = "triangle4";
  Isa isa = Isa::scalar;  ///< instruction set of the builder's own kernels; the result does not depend on it, but where
                          ///< StructureInfo says so
  unsigned threads = 1;
  BuilderParameters parameters;
};

/// What a build took. `seconds` is wall time from mesh to a structure ready for rays.
struct BuildReport {
  double seconds = 0.0;
  double cpu_seconds = 0.0;    ///< of all threads, others of the program included
  std::size_t peak_bytes = 0;  ///< most memory held at once while building, the structure included, the mesh not
  /// Wall seconds of one thread within build() that are no part of the times above: a library that is made ready once
  /// for any number of builds, as Embree's device.
  double apart_seconds = 0.0;
  std::vector<std::pair<std::string, double>> phases;  ///< name, wall seconds
};

/// An inner node as a visitor sees it. `child_bounds` has one box for each child that exists.
struct NodeView {
  Bounds3f bounds;
  std::span<const Bounds3f> child_bounds;
  unsigned depth = 0;  ///< the root's is 0
  std::size_t bytes = 0;
  /// Above 0: a grid of cells, of which a random ray through `bounds` crosses so many on average. Each costs a
  /// traversal step; the child boxes then cost nothing of their own.
  double steps = 0.0;
};

/// A leaf as a visitor sees it: `primitives` may name a primitive that other leaves name too.
struct LeafView {
  Bounds3f bounds;
  std::span<const std::uint32_t> primitives;
  unsigned depth = 0;
  unsigned blocks = 0;       ///< leaf blocks
  unsigned block_width = 1;  ///< triangles that one block can hold
  std::size_t bytes = 0;
};

class StructureVisitor {
 public:
  virtual ~StructureVisitor() = default;
  virtual void node(const NodeView& node) = 0;
  virtual void leaf(const LeafView& leaf) = 0;
};

/// What a structure is called and what it takes. Names are the keys of the configuration.
struct StructureInfo {
  std::string_view name;
  std::string_view summary;                ///< one line for `list`
  std::string_view library = {};           ///< whose it is, with the version, where it is not ours
  std::vector<std::string_view> builders;  ///< the first is the default
  std::vector<std::string_view> leaves;
  bool build_depends_on_isa = false;      ///< built anew for each ISA (embree: the device is set to it)
  bool build_depends_on_threads = false;  ///< built anew for each thread count
  bool holds_motion = false;  ///< takes a mesh with key frames and rays with times; the others hold one moment
  bool needs_motion = false;  ///< measured only where the scene moves
  bool takes_below = false;   ///< stands above structures of another kind: BuilderParameters::below
  bool flat = false;          ///< no hierarchy: a ray looks at all of it, however many triangles there are
  bool root_is_node = false;  ///< above a single leaf, too: a grid of cells, a list of boxes
  bool can_refit = false;     ///< Accel::refit() fits it to moved vertices; others refuse
  /// why it has no other way of traversal, where that is so: what skipped cells say
  std::string_view only_single_rays = {};
  /// why its rays do not go as streams, or not in flight, where they go in other ways than alone: the same
  std::string_view no_streams = {}, no_queue = {};
  /// false where the builders read none of BuilderParameters: sweeping them makes no new cells
  bool uses_parameters = true;
  /// Why a builder of the structure does not make a leaf of it, empty where it does: what skipped cells and refused
  /// builds say. None: each makes every leaf.
  std::string (*why_no_build)(std::string_view builder, std::string_view leaf) = nullptr;

  [[nodiscard]] std::string why_not_built(std::string_view builder, std::string_view leaf) const {
    return why_no_build ? why_no_build(builder, leaf) : std::string();
  }
};

class Accel {
 public:
  virtual ~Accel() = default;
  [[nodiscard]] virtual const StructureInfo& info() const noexcept = 0;
  /// Builds from `mesh`, replacing what was there. The mesh must outlive the structure.
  /// Throws UserError when a setting is not one that info() names, or when the mesh is too large for the structure.
  /// Only a structure with info().holds_motion looks at key frames; build_structure() hands a moving mesh to no other.
  virtual void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) = 0;
  /// Fits the structure, as it was built, to the same triangles with moved vertices, for a moving mesh: quicker than a
  /// build, and the further they moved the worse to trace. The mesh, which takes the place of the one built from, must
  /// outlive the structure. Runs in the caller's TBB arena. Throws UserError where the structure cannot do it, for
  /// another number of triangles, for key frames, and for what check_triangles() refuses; the structure is then as it
  /// was.
  virtual void refit(const TriangleMesh& mesh);
  /// Shows every node and leaf, parents before children, depth first: what follows a node with a greater depth is below
  /// it. Returns false where the structure cannot be looked into (embree).
  [[nodiscard]] virtual bool visit(StructureVisitor& visitor) const = 0;
  /// Saves or loads, the same members in the same order: all that tracing and visit() need, but what is the mesh's. On
  /// loading the object is fresh. Throws UserError where the structure cannot be saved, as here.
  virtual void archive(Archive& archive);
  /// Bytes that tracing needs, the mesh's own arrays not counted.
  [[nodiscard]] virtual std::size_t bytes() const noexcept = 0;
};

/// One structure of an executable.
struct StructureEntry {
  StructureInfo info;
  std::unique_ptr<Accel> (*create)();
};

/// Why a structure cannot stand below another one (BuilderParameters::below); empty where it can.
[[nodiscard]] std::string why_not_below(const StructureInfo& below);
/// Every structure of this executable: those of structures/all.h in their order, then its own.
[[nodiscard]] std::span<const StructureEntry> all_structures();
/// nullptr where there is none of that name.
[[nodiscard]] const StructureEntry* find_structure(std::string_view name);
/// Accel::refit() with so many threads (0: all that there are). Returns wall seconds.
double refit_structure(Accel& accel, const TriangleMesh& mesh, unsigned threads);
/// Creates and builds, filling in the report's seconds and peak. Throws UserError for a name or setting that is not one
/// of the structure's or do not go together, for a builder parameter out of its limits (structures/parameter_limits.h),
/// for a mesh that moves where the structure holds one moment, and, before the clock starts, for what check_triangles()
/// refuses of any finite mesh, and check_instances() where the structure takes instances (core/mesh_check.h).
[[nodiscard]] std::unique_ptr<Accel> build_structure(std::string_view name, const TriangleMesh& mesh,
                                                     const BuildSettings& settings, BuildReport& report);

}  // namespace arboretum
