#include "library/mesh_check.h"

#include <cmath>
#include <string>
#include <vector>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/instances.h"

namespace arboretum {
namespace {

std::string number(std::size_t n) { return std::to_string(n); }

/// `of`: what the mesh is, for messages.
void check_triangles(const TriangleMesh& mesh, const std::string& of) {
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle t = mesh.triangles[i];
    for (std::uint32_t vertex : {t.a, t.b, t.c}) {
      if (vertex >= mesh.vertices.size()) {
        throw UserError(of + "triangle " + number(i) + " names vertex " + number(vertex) + " of " +
                        number(mesh.vertices.size()) + "; indices count from 0");
      }
      for (std::size_t k = 0; k < mesh.frames(); ++k) {
        if (is_in_range(mesh.frame(k)[vertex])) continue;
        throw UserError(of + "triangle " + number(i) + ": vertex " + number(vertex) +
                        (k == 0 ? "" : " of key frame " + number(k)) +
                        " is not finite or beyond 2^40; drop such triangles or scale the mesh");
      }
    }
  }
}

void check_frames(const TriangleMesh& mesh) {
  for (std::size_t k = 1; k < mesh.frames(); ++k) {
    if (mesh.frame(k).size() == mesh.vertices.size()) continue;
    throw UserError("key frame " + number(k) + " has " + number(mesh.frame(k).size()) + " vertices, the first " +
                    number(mesh.vertices.size()) + "; all key frames have the same");
  }
}

void check_instances(const TriangleMesh& mesh) {
  if (!mesh.instancing) return;
  const Instancing& instancing = *mesh.instancing;
  for (std::size_t k = 0; k < instancing.prototypes.size(); ++k) {
    const TriangleMesh& prototype = instancing.prototypes[k];
    if (prototype.moves() || prototype.instancing)
      throw UserError("prototype " + number(k) + " moves or has instances itself; it can do neither");
    check_triangles(prototype, "prototype " + number(k) + ": ");
  }
  std::size_t next = 0;
  for (std::size_t k = 0; k < instancing.instances.size(); ++k) {
    const Instance& instance = instancing.instances[k];
    const std::string of = "instance " + number(k) + " ";
    if (instance.prototype >= instancing.prototypes.size())
      throw UserError(of + "names prototype " + number(instance.prototype) + " of " +
                      number(instancing.prototypes.size()) + "; they count from 0");
    if (const double d = determinant(instance.to_world); !std::isfinite(d) || d == 0.0)
      throw UserError(of + "has a map whose determinant is 0 or not finite; it flattens what it places");
    if (instance.first_primitive != next)
      throw UserError(of + "begins at triangle " + number(instance.first_primitive) + ", the one before ends at " +
                      number(next) + "; they follow each other");
    next += instancing.prototypes[instance.prototype].size();
  }
  if (next != mesh.size())
    throw UserError("the instances have " + number(next) + " triangles, the mesh they make up " + number(mesh.size()));
}

}  // namespace

void check_mesh(const TriangleMesh& mesh) {
  check_frames(mesh);
  check_triangles(mesh, "");
  check_instances(mesh);
}

}  // namespace arboretum
