// Bsdf: how a surface scatters light at one hit, in a frame whose z axis is the normal on the viewer's side.
//
// GGX (Walter et al. 2007) with height-correlated Smith shadowing (Heitz, JCGT 3(2), 2014), its visible normals sampled
// as spherical caps (Dupuy and Benyoub, 2023). Beside a glossy lobe, and a mirror with Fresnel, the diffuse one gets
// what neither way through the coat reflects.
#pragma once

#include <array>
#include <optional>

#include "rendering/surface.h"
#include "scenes/vec3d.h"

namespace arboretum {

/// Lobes that a path goes on by.
struct Lobes {
  bool diffuse = true, glossy = true, perfect = true;  ///< perfect: mirror and dielectric
};

enum class ScatterKind : unsigned char { diffuse, glossy, mirror, dielectric };

struct Scatter {
  Vec3d direction;   ///< away from the surface, of unit length; z < 0: through it
  Vec3f weight;      ///< value times cosine over density
  double pdf = 0.0;  ///< of the direction, by solid angle; 0 for perfect lobes
  ScatterKind kind = ScatterKind::diffuse;
};

class Bsdf {
 public:
  /// `diffuse`: the surface's at this point. `out`: towards the viewer, z >= 0. `front`: the viewer is on the side that
  /// sees the corners counter-clockwise: outside of glass.
  Bsdf(const Surface& surface, Vec3f diffuse, Vec3d out, bool front) noexcept;

  /// Value times the cosine for light from `in`, of the lobes that are no perfect ones.
  struct Value {
    Vec3f diffuse, glossy;
  };
  [[nodiscard]] Value evaluate(Vec3d in) const noexcept;
  /// Density by which scatter() with the same lobes chooses `in`.
  [[nodiscard]] double pdf(Vec3d in, Lobes lobes) const noexcept;
  /// One direction from three numbers in [0, 1); nothing where all light is swallowed.
  [[nodiscard]] std::optional<Scatter> scatter(Lobes lobes, double choice, double u, double v) const noexcept;
  /// The directions of the perfect lobe, each with its whole share: none, a mirror's, or glass's reflected and
  /// refracted one.
  struct Branches {
    std::array<Scatter, 2> directions;
    unsigned count = 0;
  };
  [[nodiscard]] Branches branches() const noexcept;
  [[nodiscard]] bool is_perfect_only() const noexcept { return !has_diffuse_ && !glossy(); }

 private:
  [[nodiscard]] bool glossy() const noexcept { return surface_.lobe == SpecularLobe::glossy; }
  /// Light passes it on the way to the diffuse lobe and back.
  [[nodiscard]] bool has_coat() const noexcept { return glossy() || surface_.fresnel; }
  [[nodiscard]] Vec3f mirror_reflects() const noexcept;
  [[nodiscard]] double share_of_diffuse(Lobes lobes) const noexcept;
  [[nodiscard]] Vec3f coat_lets_through(double cosine) const noexcept;
  [[nodiscard]] double glossy_pdf(Vec3d half) const noexcept;
  [[nodiscard]] Vec3d glossy_direction(double u, double v) const noexcept;
  [[nodiscard]] std::optional<Scatter> smooth(Vec3d in, Lobes lobes, ScatterKind kind) const noexcept;
  [[nodiscard]] Scatter mirrored() const noexcept;
  struct Glass {
    double reflected;  ///< Fresnel's share
    Vec3d refracted;   ///< where that is below 1
  };
  [[nodiscard]] Glass glass() const noexcept;

  const Surface& surface_;
  Vec3f diffuse_;
  Vec3d out_;
  bool front_, has_diffuse_;
};

}  // namespace arboretum
