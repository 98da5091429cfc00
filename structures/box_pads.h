// Where a few triangles of a scene are far larger than the others, as a ground is that reaches to a horizon: what then
// becomes of the pads of `padded` boxes.
//
// Such a test widens a box by shares of M + |o|, M the largest |coordinate| of what is in the box, o the ray's origin
// (traversal/box_test.h). As part of a ray's constants that costs nothing, but M is then one number for all boxes: with
// the largest coordinate of the scene a few triangles make the pads larger than the boxes of all others, and rays meet
// ever more of those. So the constants are made for a coordinate that common triangles have, common(), and a box whose
// content has a larger one, M, is itself wider, by kShare (M - common()) on each side. Where the largest coordinate is
// a common one, as in most scenes, no box is.
//
// Proof that no touched box is lost: those of box_test.h, of packets and of instances are about a box by itself. They
// use that no coordinate of its content is larger than M, and that it is widened by s (M + |o|), s <= kShare. Here it
// is widened by s (common() + |o|) + kShare (M - common()), which is no less. M is of whole triangles: a box that holds
// them tells it, one that holds parts of split ones does not. Only along axes on which a ray does as good as not move
// is the scene as a whole spoken of: there 2^39 common() has to be larger than twice its largest coordinate, of which
// common() is 2^-32 at least. (Where that underflows, boxes are wider by more than the rays' constants would have.)
//
// In a kd-tree cells share their planes, so a triangle with a coordinate of M > common() is thicker instead: it stands
// in every cell that is within kShare (M - common()) of it. A plane at s is met with an error of 8 u |s| at most (u =
// 2^-24; packets included), of which the constants make good 8 u (common() + |o|). Where |s| is no more than common()
// that is all. Else what a ray meets at a point x is either further than 8 u |s| from the plane, and its side is told
// rightly, or its largest coordinate is as good as |s| or more, and it stands on both sides: 32 u (M - common()) > 8 u
// (|s| - common()). By as much x may lie outside of a cell that the ray is taken to be in, and what is so close to the
// cell stands in it.
#pragma once

#include <cstdint>
#include <span>

#include "core/bounds.h"
#include "core/mesh.h"

namespace arboretum {

/// The largest |coordinate| of the triangles with these ids.
[[nodiscard]] float largest_coordinate(const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept;

class BoxPads {
 public:
  BoxPads() = default;  ///< of no triangles
  /// Of a mesh and the bounds of its triangles, at any time.
  BoxPads(const TriangleMesh& mesh, const Bounds3f& bounds);

  /// What rays' constants are made for: a |coordinate| that has room for most triangles, the scene's largest at most.
  [[nodiscard]] float common() const noexcept { return common_; }
  /// Whether any box is wider.
  [[nodiscard]] bool any() const noexcept { return common_ < largest_; }
  /// By how much a box is wider, on each side, whose content has that largest |coordinate|.
  [[nodiscard]] double pad(float largest) const noexcept;
  /// A box of whole triangles as a node has it.
  [[nodiscard]] Bounds3f widened(const Bounds3f& box) const noexcept;
  /// The box wider by that on each side, rounded outwards.
  [[nodiscard]] static Bounds3f widened(const Bounds3f& box, double pad) noexcept;

 private:
  /// The most that a test takes: of packets of rays with a common end (structures/bvh/bvh_packet.h).
  static constexpr double kShare = 0x1p-19;
  /// What is common is kWithin times the coordinate that one triangle in kOneIn does not exceed: then no pad of
  /// common() is more than 2^-13 of that, and scenes as they mostly are have no larger one.
  static constexpr std::size_t kMostSamples = 1024, kOneIn = 16;
  static constexpr float kWithin = 64.0f, kLeast = 0x1p-32f;

  float largest_ = 0.0f, common_ = 0.0f;
};

}  // namespace arboretum
