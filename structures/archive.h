// Archive: what a structure hands its members to, one function for both directions: a saving archive writes them, a
// loading one reads them back. Nothing in an archive is a pointer: arenas hold offsets, and what points into the mesh
// is taken from mesh() again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iosfwd>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/arena.h"
#include "core/mesh.h"

namespace arboretum {

/// Used as `archive(arena_, root_, bounds_, leaf_)`, in the same order in both directions. Takes trivially copyable
/// values, strings, Arena, and vectors (any allocator) of trivially copyable values.
class Archive {
 public:
  /// Saves to `out`, whose errors the caller looks at.
  Archive(std::ostream& out, const TriangleMesh& mesh) : out_(&out), mesh_(&mesh) {}
  /// Loads from `bytes`, which were checked to be as they were saved.
  Archive(std::span<const std::byte> bytes, const TriangleMesh& mesh) : rest_(bytes), mesh_(&mesh) {}

  [[nodiscard]] bool is_loading() const noexcept { return out_ == nullptr; }
  /// The mesh that the structure is of, for what points into it: `vertices_ = archive.mesh().vertices.data()`.
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return *mesh_; }
  /// Calls part(*this) while mesh() is another one: for what is built over a part of the mesh.
  template <class Part>
  void of_mesh(const TriangleMesh& mesh, Part&& part) {
    const TriangleMesh* whole = mesh_;
    mesh_ = &mesh;
    part(*this);
    mesh_ = whole;
  }

  template <class... Values>
  void operator()(Values&... values) {
    (value(values), ...);
  }

  /// Stands for what the saved bytes mean and C++ does not say: the size of a node, a number that goes up when its
  /// layout changes. Throws UserError when the file has another.
  void expect(std::uint64_t meaning);
  /// Bytes of the archive that were not read yet.
  [[nodiscard]] std::size_t rest() const noexcept { return rest_.size(); }

 private:
  template <class T>
  void value(T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>, "archives hold plain values, no pointers");
    bytes(&value, sizeof(T));
  }
  template <class T, class Allocator>
  void value(std::vector<T, Allocator>& values) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>, "archives hold plain values, no pointers");
    const std::size_t count = length(values.size(), sizeof(T));
    if (is_loading()) values = std::vector<T, Allocator>(count);
    bytes(values.data(), count * sizeof(T));
  }
  void value(std::string& text);
  void value(Arena& arena);

  /// Writes, or reads and checks against the bytes that are left, the number of elements of that size.
  [[nodiscard]] std::size_t length(std::size_t count, std::size_t element_bytes);
  void bytes(void* data, std::size_t count);

  std::ostream* out_ = nullptr;
  std::span<const std::byte> rest_;
  const TriangleMesh* mesh_;
};

}  // namespace arboretum
