// The kernel table: every way of tracing rays that this build can do, one row a combination.
//
// Rows are made in one translation unit for each structure and instruction set (traversal/kernel_rows.h) from its ways
// of traversal and the table of leaf tests (intersectors/leaf_tests.h). A function pointer takes a whole batch of rays:
// below it all is templates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/isa.h"
#include "core/ray.h"

namespace arboretum {

class Accel;
struct LeafTests;

/// Work done by a batch; filled by the counting kernels alone (the timed ones carry no counters). What rays visit
/// together, as packets and streams do, counts once for each of them.
struct Counters {
  std::uint64_t rays = 0;
  std::uint64_t nodes = 0;         ///< inner nodes visited
  std::uint64_t boxes = 0;         ///< ray/box tests against children that exist
  std::uint64_t boxes_hit = 0;     ///< children that rays met, by their own test or by their packet's
  std::uint64_t leaves = 0;        ///< leaves visited
  std::uint64_t blocks = 0;        ///< leaf blocks tested
  std::uint64_t triangles = 0;     ///< ray/triangle tests, empty lanes not counted
  std::uint64_t lanes = 0;         ///< SIMD lanes of these tests of rays against boxes and triangles
  std::uint64_t lanes_active = 0;  ///< of them, those that held a ray and a box or triangle: boxes + triangles

  /// Where n rays of a packet or of a stream's group visit a node together, n - 1: `nodes` less these is how often
  /// nodes are read. The same of leaves.
  std::uint64_t nodes_shared = 0, leaves_shared = 0;
  std::uint64_t interval_tests = 0;  ///< boxes tested against the interval of a packet, once for all of its rays

  std::array<std::uint64_t, 5> children_hit{};  ///< node visits in which the ray met 0, 1, 2, 3, 4 or more children
  /// Of nodes at one depth, the root's 0, the ray/box tests: a ray's children in lanes, or a child's rays (packets).
  struct Depth {
    std::uint64_t visits = 0;  ///< that of rays which go together is one
    std::uint64_t lanes = 0, lanes_active = 0;
    Depth& operator+=(const Depth& o) noexcept;
  };
  std::vector<Depth> depths;  ///< of trees whose kernels follow their depth (the BVHs, the kd-tree), else empty

  std::uint64_t packets = 0;  ///< what of one goes into an instance counts as one of its own
  std::uint64_t rays_in_packets = 0, rays_in_streams = 0, rays_in_flight = 0;  ///< of `rays`; the others went singly
  std::uint64_t switches = 0;      ///< times that a packet had its rays go on alone in a node
  std::uint64_t rays_alone = 0;    ///< the rays that did, at all switches
  std::uint64_t queue_rounds = 0;  ///< of rays in flight: once through the queue of nodes and that of leaves
  std::uint64_t nodes_queued = 0;  ///< lengths of the queues when their turn comes, added up
  std::uint64_t leaves_queued = 0;
  Counters& operator+=(const Counters& o);
};

struct KernelRow;
/// hits[i] answers rays[i]; both spans have the same size. The structure must be of the row's structure and leaf.
using ClosestHitFunction = void (*)(const Accel&, const KernelRow&, RayBatch rays, std::span<Hit> hits, Counters*);
/// occluded[i] becomes 1 when anything lies within [tnear, tfar] of rays[i], else 0.
using AnyHitFunction = void (*)(const Accel&, const KernelRow&, RayBatch rays, std::span<std::uint8_t> occluded,
                                Counters*);

struct RowFunctions {
  ClosestHitFunction closest_hit = nullptr;
  AnyHitFunction any_hit = nullptr;
};

struct KernelRow {
  std::string_view structure, leaf, intersector, box, traversal;
  Isa isa = Isa::scalar;
  const LeafTests* tests = nullptr;  ///< nullptr where the structure has its own (embree)
  RowFunctions timed{};              ///< ignore their Counters*
  RowFunctions counting{};           ///< same answers, add to the Counters; nullptr where there are none
  /// `timed` has its leaf tests compiled in; else it calls `tests`, which costs a few per cent
  bool leaves_compiled_in = false;

  /// With `counters`, by the counting functions, which must be there.
  void closest_hit(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters = nullptr) const {
    (counters ? counting : timed).closest_hit(accel, *this, rays, hits, counters);
  }
  void any_hit(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded,
               Counters* counters = nullptr) const {
    (counters ? counting : timed).any_hit(accel, *this, rays, occluded, counters);
  }
  [[nodiscard]] bool counts() const noexcept { return counting.closest_hit != nullptr; }
};

/// Where a kernel unit puts its rows.
using KernelRows = std::vector<KernelRow>;

/// Every row of this executable whose instruction set this machine runs, those that ARBORETUM_ISA leaves out included.
[[nodiscard]] std::span<const KernelRow> kernel_table();
/// nullptr where there is none.
[[nodiscard]] const KernelRow* find_kernel(std::string_view structure, std::string_view leaf,
                                           std::string_view intersector, std::string_view box,
                                           std::string_view traversal, Isa isa);
/// The leaf that a cell uses when the configuration names none; empty when the structure has no kernel for the rest.
[[nodiscard]] std::string_view default_leaf(std::string_view structure, std::string_view intersector, Isa isa);
/// One line: why there is no such row ("pluecker needs vertices: leaf triangle4v", ...). Empty when there is one.
[[nodiscard]] std::string why_no_kernel(std::string_view structure, std::string_view leaf, std::string_view intersector,
                                        std::string_view box, std::string_view traversal, Isa isa);

/// Every value that an axis has in the table, in the order of first appearance.
struct AxisValues {
  std::vector<std::string_view> structures, leaves, intersectors, boxes, traversals;
};
[[nodiscard]] const AxisValues& axis_values();

}  // namespace arboretum
