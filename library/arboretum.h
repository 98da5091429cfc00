// Arboretum as a library: a mesh, a structure built over it, and rays traced through it, one, a few together or many.
//
//   #include <arboretum/arboretum.h>
//   arboretum::Tracer tracer(arboretum::make_mesh(coordinates, indices));
//   arboretum::Hit hit = tracer.closest_hit({.origin = {0, 0, -3}, .direction = {0, 0, 1}});
//
// What a ray, a hit and a tie are: core/ray.h. Errors are UserError (core/error.h): one line that says what, and the
// mend.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/error.h"
#include "core/isa.h"
#include "core/mesh.h"
#include "core/ray.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum {

/// A mesh of `coordinates` x y z x y z ..., in any unit of length, and `indices`, three a triangle. Copies both. Throws
/// UserError where a count is no multiple of three; Tracer checks the rest.
[[nodiscard]] TriangleMesh make_mesh(std::span<const float> coordinates, std::span<const std::uint32_t> indices);
[[nodiscard]] TriangleMesh make_mesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

/// How a Tracer is built and how it traces, by the keys that `arboretum list` shows and `render` takes: `auto` (or
/// nothing) where a value follows from the others, `packet` and `hybrid` for the instruction set's own width, `avx` for
/// avx2 (traversal/kernel_keys.h). The defaults put correctness first: no hit is lost at an edge, nor between two
/// boxes.
struct TracerSettings {
  std::string structure = "bvh8";
  std::string builder = {};  ///< `auto`: the structure's first, of two_level the first of what stands below it
  std::string leaf = {};     ///< `auto`: the block that suits structure, intersector and instruction set
  std::string intersector = "watertight";
  std::string box = "padded";
  std::string traversal = "single";  ///< of batches, `auto`: the structure's way called so, else single rays; one ray
                                     ///< goes by `single`, a packet of N by `packetN` (with a hybrid chosen by
                                     ///< `hybridN`), where the structure has them
  std::string isa = {};              ///< `auto`: the best of this machine for which there is such a kernel
  unsigned threads = 0;              ///< of the build; 0: one a core. The structure is the same for any number.
  /// The builder's; `below` may be `auto`, too: bvh8.
  BuilderParameters parameters = {};
};

/// A mesh with a structure over it, ready for rays. Moves, does not copy; a Tracer that was moved from can only be
/// assigned to or destroyed. The const functions may be called from any number of threads at once; each works on the
/// calling thread.
class Tracer {
 public:
  /// Builds. Throws UserError for a key that does not exist (naming the nearest), for keys that do not go together, for
  /// an instruction set that the machine lacks, for a builder parameter out of the command line's limits
  /// (structures/parameter_limits.h), and for an invalid mesh: an index beyond the vertices, a vertex of a triangle
  /// that in some key frame is not finite or beyond kMaxCoordinate (2^40), key frames of different lengths, instances
  /// that do not lay out their prototypes one after the other or whose maps are not finite, flatten, or put a corner
  /// elsewhere than the mesh has it (core/mesh_check.h); of two_level also a map that takes its prototype's box beyond
  /// float. An empty mesh is none of these: every ray misses it. Nor is an instance without triangles, which takes no
  /// part.
  explicit Tracer(TriangleMesh mesh, TracerSettings settings = {});

  /// As built from `mesh` with `settings`, but the structure comes from a file that save() wrote. Throws UserError as
  /// the constructor does, and where the file is missing, none of ours, of another version, truncated, damaged, or
  /// holds another structure, builder, leaf, parameters or mesh (structures/structure_file.h). Leaves follow from the
  /// instruction set where they are left to it: name one for a file that goes to other machines.
  [[nodiscard]] static Tracer load(TriangleMesh mesh, const std::filesystem::path& file, TracerSettings settings = {});
  /// Writes the structure, not the mesh: whole, or not at all. Throws UserError where the file cannot be written, and
  /// for structures that cannot be saved (`embree`).
  void save(const std::filesystem::path& file) const;
  /// Fits the structure to the same triangles with moved vertices, in `settings().threads` threads: quicker than a
  /// build, and the further the vertices moved the worse to trace. Answers are those of a structure built anew wherever
  /// those do not depend on the structure (docs/numerics.md). Wide BVHs alone can do it (StructureInfo::can_refit).
  /// Throws UserError for others, for another number of triangles, for key frames, and for
  /// what the constructor refuses; the tracer is then as it was. No other call may run meanwhile.
  void refit(TriangleMesh mesh);

  /// The nearest hit within the closed interval [tnear, tfar], t in units of the direction's length. A miss has t =
  /// infinity. The caller sees to 0 <= tnear, which nothing checks: behind a ray's origin some structures look and
  /// others do not. Any other invalid ray misses (core/ray.h).
  [[nodiscard]] Hit closest_hit(const Ray& ray) const {
    Hit hit;
    one_->closest_hit(*accel_, RayBatch({&ray, 1}), {&hit, 1}, nullptr);
    return hit;
  }
  /// Whether anything lies within [tnear, tfar].
  [[nodiscard]] bool any_hit(const Ray& ray) const {
    std::uint8_t occluded = 0;
    one_->any_hit(*accel_, RayBatch({&ray, 1}), {&occluded, 1}, nullptr);
    return occluded != 0;
  }

  /// N rays that go together, answered in order: by the kernel `packetN` where there is one, with a hybrid chosen by
  /// `hybridN`; else as a batch of N.
  template <std::size_t N>
  [[nodiscard]] std::array<Hit, N> closest_hit(const std::array<Ray, N>& packet) const {
    std::array<Hit, N> hits;
    kernel_of_packet(N).closest_hit(*accel_, std::span<const Ray>(packet), hits, nullptr);
    return hits;
  }
  /// As above; 1 for a ray that meets something, else 0.
  template <std::size_t N>
  [[nodiscard]] std::array<std::uint8_t, N> any_hit(const std::array<Ray, N>& packet) const {
    std::array<std::uint8_t, N> occluded;
    kernel_of_packet(N).any_hit(*accel_, std::span<const Ray>(packet), occluded, nullptr);
    return occluded;
  }
  /// As above with some rays switched off: bit i of `active` is ray i's, bits beyond N mean nothing. A ray that is
  /// switched off is not read, may hold anything, and is answered with a miss.
  template <std::size_t N>
  requires(N <= 64)
      [[nodiscard]] std::array<Hit, N> closest_hit(const std::array<Ray, N>& packet, std::uint64_t active) const {
    return closest_hit(only(packet, active));
  }
  /// As above; 0 for a ray that is switched off.
  template <std::size_t N>
  requires(N <= 64)
      [[nodiscard]] std::array<std::uint8_t, N> any_hit(const std::array<Ray, N>& packet, std::uint64_t active) const {
    return any_hit(only(packet, active));
  }

  /// hits[i] answers rays[i]. Throws UserError when the two, or times that are given, are not equally many, and for
  /// settings of the batch out of the command line's limits: rays_in_flight from 1 to 64, hybrid_threshold from 0 to 16
  /// and of a hybridN to N (structures/parameter_limits.h).
  void closest_hit(RayBatch rays, std::span<Hit> hits) const;
  /// occluded[i] becomes 1 when rays[i] meets something, else 0. Throws as above.
  void any_hit(RayBatch rays, std::span<std::uint8_t> occluded) const;

  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return *mesh_; }
  /// The structure itself: its bytes, and its nodes and leaves by visit().
  [[nodiscard]] const Accel& structure() const noexcept { return *accel_; }
  /// Seconds, peak memory and phases of the build; all zero where the structure was loaded. cpu_seconds and peak_bytes
  /// are of the process: where other threads work or build meanwhile, cpu_seconds has their time as well, and
  /// peak_bytes says no more than that it is not below structure().bytes().
  [[nodiscard]] const BuildReport& report() const noexcept { return report_; }
  /// The settings with every key filled in that was left to the others.
  [[nodiscard]] const TracerSettings& settings() const noexcept { return settings_; }
  /// The row of the kernel table that traces batches.
  [[nodiscard]] const KernelRow& kernel() const noexcept { return *batch_; }
  /// The row that traces packets of `rays` rays.
  [[nodiscard]] const KernelRow& kernel_of_packet(std::size_t rays) const noexcept {
    for (std::size_t i = 0; i < kPacketSizes.size(); ++i)
      if (kPacketSizes[i] == rays) return *packet_[i];
    return *batch_;
  }

 private:
  static constexpr std::array<std::size_t, 5> kPacketSizes{4, 8, 16, 32, 64};

  enum class NotBuiltYet {};
  /// All but the structure.
  Tracer(TriangleMesh mesh, TracerSettings settings, NotBuiltYet);
  [[nodiscard]] BuildSettings build_settings() const;

  /// The packet with rays in place of those switched off that every kernel leaves out (is_valid() of core/ray.h).
  template <std::size_t N>
  [[nodiscard]] static std::array<Ray, N> only(const std::array<Ray, N>& packet, std::uint64_t active) noexcept {
    std::array<Ray, N> rays;
    for (std::size_t i = 0; i < N; ++i)
      if (active >> i & 1) rays[i] = packet[i];
    return rays;
  }
  void check(const RayBatch& rays, std::size_t answers) const;

  std::unique_ptr<const TriangleMesh> mesh_;  ///< on the heap: the structure points at it
  TracerSettings settings_;
  BuildReport report_;
  std::unique_ptr<Accel> accel_;
  const KernelRow* one_ = nullptr;
  const KernelRow* batch_ = nullptr;
  std::array<const KernelRow*, kPacketSizes.size()> packet_{};
};

}  // namespace arboretum
