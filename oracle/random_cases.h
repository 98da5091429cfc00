// Random small meshes with hard rays, for a search by properties: coordinates distributed exponentially, surfaces of
// every kind of badness, and mutations of given cases. Subject number i of a seed is the same on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh.h"
#include "oracle/hard_rays.h"

namespace arboretum {

struct RandomSubject {
  TriangleMesh mesh;
  HardRays rays;
};

/// Up to a hundred triangles: a soup, a closed bipyramid, a height field, a strip of slivers, a tangle over few
/// vertices, shells one in the other; moved by up to 2^17 and scaled by 2^-30 .. 2^10, so that all stays within
/// what intersectors promise.
[[nodiscard]] RandomSubject random_subject(std::uint64_t seed, std::uint64_t index, std::size_t rays);

/// A copy of a mesh and ray with some numbers moved by ulps, negated, made equal to others, or all scaled by a power of
/// two, or with a vertex left out of its place; the ray itself is the first of the rays.
[[nodiscard]] RandomSubject mutated_subject(const TriangleMesh& mesh, const Ray& ray, std::uint64_t seed,
                                            std::uint64_t index, std::size_t rays);

/// `count` rays, the given one at `place`: the others are copies with numbers moved by ulps, negated or scaled, one in
/// four of them invalid, so that it shares a packet with rays of other signs and with no rays at all.
[[nodiscard]] std::vector<Ray> in_company(const Ray& ray, std::uint64_t seed, std::size_t count, std::size_t place);

}  // namespace arboretum
