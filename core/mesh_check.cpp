#include "core/mesh_check.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/instances.h"

namespace arboretum {
namespace {

std::string number(std::size_t n) { return std::to_string(n); }

void check_frames(const TriangleMesh& mesh) {
  for (std::size_t k = 1; k < mesh.frames(); ++k) {
    if (mesh.frame(k).size() == mesh.vertices.size()) continue;
    throw UserError("key frame " + number(k) + " has " + number(mesh.frame(k).size()) + " vertices, the first " +
                    number(mesh.vertices.size()) + "; all key frames have the same");
  }
}

bool is_allowed(Vec3f p, Largest largest) { return largest == Largest::finite ? is_finite(p) : is_in_range(p); }

/// `of`: what the mesh is, for messages.
void check_triangles_of(const TriangleMesh& mesh, const std::string& of, Largest largest) {
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle t = mesh.triangles[i];
    for (std::uint32_t vertex : {t.a, t.b, t.c}) {
      if (vertex >= mesh.vertices.size()) {
        throw UserError(of + "triangle " + number(i) + " names vertex " + number(vertex) + " of " +
                        number(mesh.vertices.size()) + "; indices count from 0");
      }
      for (std::size_t k = 0; k < mesh.frames(); ++k) {
        if (is_allowed(mesh.frame(k)[vertex], largest)) continue;
        throw UserError(of + "triangle " + number(i) + ": vertex " + number(vertex) +
                        (k == 0 ? "" : " of key frame " + number(k)) +
                        (largest == Largest::finite ? " is not finite; drop such triangles"
                                                    : " is not finite or beyond 2^40; drop such triangles or scale "
                                                      "the mesh"));
      }
    }
  }
}

bool has_finite_numbers(const AffineMap& map) {
  for (const auto& row : map.m)
    for (const double x : row)
      if (!std::isfinite(x)) return false;
  return true;
}

/// What rounding may move an image by, for each unit of the magnitudes that were added up.
constexpr double kRounding = 0x1p-20;

/// Whether `flat` is the image of `object`, rounded in whatever order in float or better.
bool is_image(const AffineMap& map, Vec3f object, Vec3f flat) {
  for (std::size_t i = 0; i < 3; ++i) {
    const double(&r)[4] = map.m[i];
    const double x = r[0] * object.x, y = r[1] * object.y, z = r[2] * object.z;
    const double magnitude = std::fabs(x) + std::fabs(y) + std::fabs(z) + std::fabs(r[3]);
    if (!(std::fabs(x + y + z + r[3] - flat[i]) <= kRounding * magnitude + 0x1p-126)) return false;
  }
  return true;
}

void check_prototypes(const std::vector<TriangleMesh>& prototypes, Largest largest) {
  for (std::size_t k = 0; k < prototypes.size(); ++k) {
    if (prototypes[k].moves() || prototypes[k].instancing)
      throw UserError("prototype " + number(k) + " moves or has instances itself; it can do neither");
    check_triangles_of(prototypes[k], "prototype " + number(k) + ": ", largest);
  }
}

void check_map(const AffineMap& map, const std::string& of) {
  if (!has_finite_numbers(map)) throw UserError(of + "has a map with a number that is not finite; give it finite ones");
  if (const double d = determinant(map); !std::isfinite(d) || d == 0.0)
    throw UserError(of + "has a map whose determinant is 0 or not finite; it flattens what it places");
}

/// Both meshes' indices have been looked at.
void check_place(const TriangleMesh& mesh, const TriangleMesh& prototype, const Instance& instance,
                 const std::string& of) {
  for (std::size_t i = 0; i < prototype.size(); ++i) {
    const std::array<Vec3f, 3> object = prototype.corners(i), flat = mesh.corners(instance.first_primitive + i);
    for (std::size_t corner = 0; corner < 3; ++corner) {
      if (is_image(instance.to_world, object[corner], flat[corner])) continue;
      throw UserError(of + "does not lie where its map puts it: triangle " + number(instance.first_primitive + i) +
                      " of the mesh is not the image of triangle " + number(i) + " of prototype " +
                      number(instance.prototype) + "; lay the mesh out with transform_point()");
    }
  }
}

}  // namespace

void check_triangles(const TriangleMesh& mesh, Largest largest) {
  check_frames(mesh);
  check_triangles_of(mesh, "", largest);
}

void check_one_moment(const TriangleMesh& mesh, std::string_view structure) {
  if (!mesh.moves()) return;
  throw UserError(std::string(structure) + " holds one moment, and the mesh has " + number(mesh.frames()) +
                  " key frames: take bvh4_motion, or pose(mesh, time)");
}

void check_instances(const TriangleMesh& mesh, Largest largest) {
  if (!mesh.instancing) return;
  const Instancing& instancing = *mesh.instancing;
  check_prototypes(instancing.prototypes, largest);
  const auto name = [](std::size_t k) { return "instance " + number(k) + " "; };
  std::size_t next = 0;
  for (std::size_t k = 0; k < instancing.instances.size(); ++k) {
    const Instance& instance = instancing.instances[k];
    if (instance.prototype >= instancing.prototypes.size())
      throw UserError(name(k) + "names prototype " + number(instance.prototype) + " of " +
                      number(instancing.prototypes.size()) + "; they count from 0");
    check_map(instance.to_world, name(k));
    if (instance.first_primitive != next)
      throw UserError(name(k) + "begins at triangle " + number(instance.first_primitive) + ", the one before ends at " +
                      number(next) + "; they follow each other");
    next += instancing.prototypes[instance.prototype].size();
  }
  if (next != mesh.size())
    throw UserError("the instances have " + number(next) + " triangles, the mesh they make up " + number(mesh.size()));
  for (std::size_t k = 0; k < instancing.instances.size(); ++k) {
    const Instance& instance = instancing.instances[k];
    check_place(mesh, instancing.prototypes[instance.prototype], instance, name(k));
  }
}

}  // namespace arboretum
