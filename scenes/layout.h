// Layout: parts of a scene, each placed once or many times, laid out in one flat mesh; what a structure of two levels
// needs is kept beside it (core/instances.h).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/instances.h"

namespace arboretum {

class Layout {
 public:
  /// A part may have key frames; its materials are its own, counted from 0. Returns the part's number.
  std::uint32_t add_part(TriangleMesh part);
  /// Puts a part into the scene, its material m as `first_material` + m. Throws UserError beyond 2^32 - 2 triangles or
  /// vertices.
  void place(std::uint32_t part, const AffineMap& to_world, std::size_t first_material);
  /// The flat mesh. Its key frames are those of the part with most; parts with fewer get interpolated ones. Instances
  /// are kept where `keep_instances` and nothing moves, each part as a prototype, wherever its coordinates lie:
  /// rescale() and sanitise() see to those.
  [[nodiscard]] TriangleMesh take(bool keep_instances);

 private:
  struct Placed {
    std::uint32_t part;
    AffineMap to_world;
    std::size_t first_material;
  };
  void append(TriangleMesh& mesh, const TriangleMesh& part, const Placed& placed) const;

  std::vector<TriangleMesh> parts_;
  std::vector<Placed> placed_;
  std::size_t triangles_ = 0, vertices_ = 0;
};

/// The mesh with `frames` key frames, a count that its own divides evenly (frames - 1 is a multiple of its frames - 1).
[[nodiscard]] TriangleMesh with_frames(const TriangleMesh& mesh, std::size_t frames);

/// What becomes of the instances when the triangles with kept[i] false are taken out of the flat mesh (`mesh` still has
/// them): equal instances go on sharing a prototype, one that lost other triangles than the rest gets its own. An
/// instance whose object space cannot be traced (coordinates beyond kMaxCoordinate, a map that magnifies rounding by
/// more than kWorstCondition) gets a prototype in world space and the identity.
[[nodiscard]] std::shared_ptr<const Instancing> kept_instances(const TriangleMesh& mesh, const std::vector<bool>& kept);

inline constexpr double kWorstCondition = 256.0;

}  // namespace arboretum
