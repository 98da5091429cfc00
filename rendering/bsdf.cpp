#include "rendering/bsdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rendering/directions.h"

namespace arboretum {
namespace {

/// Schlick's approximation: reflectance at F0 = `normal` seen at `cosine`.
Vec3f schlick(Vec3f normal, double cosine) noexcept {
  const double c = std::clamp(1.0 - cosine, 0.0, 1.0);
  const auto grazing = float(c * c * c * c * c);
  return normal + (Vec3f{1, 1, 1} - normal) * grazing;
}

/// Smith's lambda of GGX.
double lambda(Vec3d w, double alpha) noexcept {
  return 0.5 * (std::sqrt(1.0 + alpha * alpha * (w.x * w.x + w.y * w.y) / (w.z * w.z)) - 1.0);
}

/// Density of microfacet normals; written so that narrow lobes lose no digits.
double ggx(Vec3d half, double alpha) noexcept {
  const double a2 = alpha * alpha, s = (half.x * half.x + half.y * half.y) / a2 + half.z * half.z;
  return 1.0 / (std::numbers::pi * a2 * s * s);
}

}  // namespace

Bsdf::Bsdf(const Surface& surface, Vec3f diffuse, Vec3d out, bool front) noexcept
    : surface_(surface), diffuse_(diffuse), out_(out), front_(front), has_diffuse_(is_bright(diffuse)) {
  constexpr double kLeast = 0x1p-30;
  if (out_.z < kLeast) out_ = normalize(Vec3d{out.x, out.y, kLeast});
}

Vec3f Bsdf::coat_lets_through(double cosine) const noexcept {
  return Vec3f{1, 1, 1} - schlick(surface_.specular, cosine);
}

Vec3f Bsdf::mirror_reflects() const noexcept {
  return surface_.fresnel ? schlick(surface_.specular, out_.z) : surface_.specular;
}

Bsdf::Value Bsdf::evaluate(Vec3d in) const noexcept {
  Value value;
  if (!(in.z > 0.0)) return value;
  if (has_diffuse_) {
    value.diffuse = diffuse_ * float(in.z / std::numbers::pi);
    if (has_coat()) value.diffuse = value.diffuse * coat_lets_through(out_.z) * coat_lets_through(in.z);
  }
  if (glossy()) {
    const Vec3d half = normalize(out_ + in);
    const double shadowing = 1.0 / (1.0 + lambda(out_, surface_.alpha) + lambda(in, surface_.alpha));
    value.glossy =
        schlick(surface_.specular, dot(out_, half)) * float(ggx(half, surface_.alpha) * shadowing / (4.0 * out_.z));
  }
  return value;
}

/// How often scatter() takes the diffuse lobe: by how much light either lobe gives back.
double Bsdf::share_of_diffuse(Lobes lobes) const noexcept {
  const double diffuse = lobes.diffuse && has_diffuse_ ? luminance(diffuse_) : 0.0;
  double specular = 0.0;
  if (glossy() && lobes.glossy) specular = luminance(schlick(surface_.specular, out_.z));
  if (surface_.lobe == SpecularLobe::mirror && lobes.perfect) specular = luminance(mirror_reflects());
  return diffuse + specular > 0.0 ? diffuse / (diffuse + specular) : -1.0;
}

double Bsdf::glossy_pdf(Vec3d half) const noexcept {
  return ggx(half, surface_.alpha) / ((1.0 + lambda(out_, surface_.alpha)) * 4.0 * out_.z);
}

double Bsdf::pdf(Vec3d in, Lobes lobes) const noexcept {
  const double share = share_of_diffuse(lobes);
  if (!(in.z > 0.0) || share < 0.0) return 0.0;
  double pdf = share * in.z / std::numbers::pi;
  if (glossy() && share < 1.0) pdf += (1.0 - share) * glossy_pdf(normalize(out_ + in));
  return pdf;
}

std::optional<Scatter> Bsdf::smooth(Vec3d in, Lobes lobes, ScatterKind kind) const noexcept {
  if (!(in.z > 0.0)) return std::nullopt;
  const double density = pdf(in, lobes);
  const Value value = evaluate(in);
  Vec3f f{};
  if (lobes.diffuse) f = f + value.diffuse;
  if (lobes.glossy) f = f + value.glossy;
  if (!(density > 0.0) || !is_bright(f)) return std::nullopt;
  return Scatter{in, f * float(1.0 / density), density, kind};
}

/// The viewer's direction mirrored at a microfacet that it sees.
Vec3d Bsdf::glossy_direction(double u, double v) const noexcept {
  const double a = surface_.alpha;
  const Vec3d out = normalize(Vec3d{a * out_.x, a * out_.y, out_.z});
  const UnitCircle circle(u);
  const double z = (1.0 - v) * (1.0 + out.z) - out.z, r = std::sqrt(std::max(0.0, 1.0 - z * z));
  const Vec3d half = Vec3d{r * circle.cosine, r * circle.sine, z} + out;
  const Vec3d normal = normalize(Vec3d{a * half.x, a * half.y, std::max(half.z, 1e-12)});
  return normalize(normal * (2.0 * dot(out_, normal)) - out_);
}

Scatter Bsdf::mirrored() const noexcept {
  return {{-out_.x, -out_.y, out_.z}, mirror_reflects(), 0.0, ScatterKind::mirror};
}

Bsdf::Glass Bsdf::glass() const noexcept {
  const double n = front_ ? surface_.ior : 1.0 / surface_.ior;  // beyond over here
  const double sine2 = (1.0 - out_.z * out_.z) / (n * n);
  if (sine2 >= 1.0) return {1.0, {}};
  const double beyond = std::sqrt(1.0 - sine2);
  const double s = (out_.z - n * beyond) / (out_.z + n * beyond), p = (n * out_.z - beyond) / (n * out_.z + beyond);
  return {0.5 * (s * s + p * p), normalize(Vec3d{-out_.x / n, -out_.y / n, -beyond})};
}

std::optional<Scatter> Bsdf::scatter(Lobes lobes, double choice, double u, double v) const noexcept {
  if (surface_.lobe == SpecularLobe::dielectric) {
    if (!lobes.perfect) return std::nullopt;
    const Glass g = glass();
    Scatter scatter = mirrored();
    if (choice >= g.reflected) scatter.direction = g.refracted, scatter.weight = surface_.transmission;
    scatter.kind = ScatterKind::dielectric;
    return scatter;
  }
  const double share = share_of_diffuse(lobes);
  if (share < 0.0) return std::nullopt;
  if (choice < share) {
    const Vec3d in = cosine_direction(u, UnitCircle(v));
    if (has_coat()) return smooth(in, lobes, ScatterKind::diffuse);
    if (!(in.z > 0.0)) return std::nullopt;
    return Scatter{in, share == 1.0 ? diffuse_ : diffuse_ * float(1.0 / share), share * in.z / std::numbers::pi,
                   ScatterKind::diffuse};
  }
  if (glossy()) return smooth(glossy_direction(u, v), lobes, ScatterKind::glossy);
  Scatter scatter = mirrored();
  scatter.weight = scatter.weight * float(1.0 / (1.0 - share));
  return scatter;
}

Bsdf::Branches Bsdf::branches() const noexcept {
  Branches result;
  if (surface_.lobe == SpecularLobe::mirror) result.directions[result.count++] = mirrored();
  if (surface_.lobe != SpecularLobe::dielectric) return result;
  const Glass g = glass();
  Scatter reflected = mirrored();
  reflected.weight = reflected.weight * float(g.reflected), reflected.kind = ScatterKind::dielectric;
  if (g.reflected > 0.0) result.directions[result.count++] = reflected;
  if (g.reflected < 1.0)
    result.directions[result.count++] = {g.refracted, surface_.transmission * float(1.0 - g.reflected), 0.0,
                                         ScatterKind::dielectric};
  return result;
}

}  // namespace arboretum
