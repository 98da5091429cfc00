// LeafTests: how one intersector tests the triangles of one kind of leaf block on one instruction set.
//
// A table beside the kernel table: an intersector is compiled once for each block and instruction set, and every
// structure and way of traversal calls it, so that a new intersector works with all of them. Kernels in which the call
// itself would count have the tests of their usual leaves compiled in instead (traversal/leaves.h); the answers are the
// same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "core/isa.h"
#include "core/ray.h"

namespace arboretum {

struct LeafForm;

/// The nearest hit so far. `primitive` is INT_MAX while there is none, so that a hit at exactly tfar still counts.
struct NearestHit {
  static constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();
  float t;
  float u = 0.0f, v = 0.0f;
  std::int32_t primitive = kNone;
};

/// Room for what an intersector keeps for one ray; LeafTests::prepare() begins it.
struct alignas(64) PreparedRay {
  static constexpr std::size_t kBytes = 256;
  std::byte bytes[kBytes];
};

/// `blocks`: the first of `count` blocks that lie one behind the other. `vertices`: the mesh's, for blocks of indices.
struct LeafTests {
  std::string_view leaf, intersector;
  Isa isa = Isa::scalar;
  const LeafForm* form = nullptr;
  void (*prepare)(const Ray& ray, PreparedRay& prepared) = nullptr;
  /// Takes the nearest hit of the blocks within [tnear, best.t] into `best`, at equal t that of the lower id. Returns
  /// whether it is a new one.
  bool (*closest_hit)(PreparedRay& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices, float tnear,
                      NearestHit& best) = nullptr;
  bool (*any_hit)(PreparedRay& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices, float tnear,
                  float tfar) = nullptr;
  /// nullptr, or what is to be done once with the nearest hit of all.
  void (*finish)(PreparedRay& ray, NearestHit& best) = nullptr;
  /// Boxes may be tight along the ray (traversal/box_test.h).
  bool depth_between_corners = false;
};

/// All of this executable whose instruction set this machine runs.
[[nodiscard]] std::span<const LeafTests> leaf_tests();
/// The same without their form; generated from intersectors/all.h (cmake/Intersectors.cmake).
[[nodiscard]] std::vector<LeafTests> registered_leaf_tests();
/// nullptr where there are none.
[[nodiscard]] const LeafTests* find_leaf_tests(std::string_view leaf, std::string_view intersector, Isa isa);

}  // namespace arboretum
