// Embree (Intel's ray-tracing kernels, API 3.13; 4.x where that is installed) as a structure like the others:
// its own builders and its own kernels behind Accel, so that a sweep holds our columns against it in the same
// run.
//
// What differs from our own structures: ties at an equal t are not broken by the lowest id, nothing can be
// looked into (visit() is false), the instruction set belongs to the built scene, not to the kernel that
// is called, and packets and streams need not give a ray the bits that it gets alone: which arithmetic it
// meets depends on the rays beside it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/ray.h"
#include "core/type_list.h"
#include "structures/accel.h"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace arboretum::embree {

/// What the leaf names mean here. `triangle4` is Embree's default scene (Moeller-Trumbore on precomputed edges),
/// `triangle4v` its robust one (RTC_SCENE_FLAG_ROBUST: Pluecker test, widened boxes), `triangle4i` its compact one
/// (RTC_SCENE_FLAG_COMPACT: leaves hold indices, four-wide nodes on every instruction set).
enum class Form { triangle4, triangle4v, triangle4i };

/// How a batch is traced: rtcIntersect1 / rtcOccluded1 for each ray, packets, or rtcIntersect1M / rtcOccluded1M.
enum class Mode { single, packet4, packet8, packet16, stream };

/// Version 4 of Embree has no streams.
[[nodiscard]] bool has_streams() noexcept;

class EmbreeAccel final : public Accel {
 public:
  static constexpr std::string_view kName = "embree";

  EmbreeAccel() = default;
  EmbreeAccel(const EmbreeAccel&) = delete;
  EmbreeAccel& operator=(const EmbreeAccel&) = delete;
  ~EmbreeAccel() override;

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// Builders `low` (Morton codes), `medium` (binned SAH), `high` (spatial splits): RTC_BUILD_QUALITY_*. Leaves: Form.
  /// Builds and traces with settings.isa (scalar: UserError, Embree has no such kernels) on settings.threads.
  /// BuilderParameters are ours and do not concern Embree.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  [[nodiscard]] bool visit(StructureVisitor&) const override { return false; }
  /// What Embree's memory monitor counts for the scene: nodes, leaves, and a copy of the vertices where the
  /// mesh's own array leaves too little room behind the last one (Embree reads 16 bytes a vertex).
  [[nodiscard]] std::size_t bytes() const noexcept override { return bytes_.load(std::memory_order_relaxed); }

  /// The instruction set of the device that was built for.
  [[nodiscard]] Isa isa() const noexcept { return isa_; }
  [[nodiscard]] Form form() const noexcept { return form_; }

  /// This scene. Throws std::logic_error when it was built for another instruction set or leaf: its numbers
  /// would then stand under a wrong name.
  [[nodiscard]] const EmbreeAccel& expect(Isa isa, Form form) const;

  /// hits[i] answers rays[i], occluded[i] is 1 or 0; the conversion from Ray and to Hit is inside. A ray that is
  /// not valid, or has an origin or direction beyond 1.8e18, which Embree does not take, misses without a
  /// call. Packets and streams carry Embree's coherent flag where the batch does; single rays know none.
  /// A stream goes in tiles, whatever the batch. Throws std::logic_error for a stream where has_streams() is false.
  void closest_hit(Mode mode, RayBatch rays, std::span<Hit> hits) const;
  void any_hit(Mode mode, RayBatch rays, std::span<std::uint8_t> occluded) const;

 private:
  struct DeviceRelease {
    void operator()(RTCDeviceTy* device) const noexcept;
  };
  struct SceneRelease {
    void operator()(RTCSceneTy* scene) const noexcept;
  };

  void release() noexcept;
  void open_device(Isa isa);
  void check(std::string_view what) const;
  static bool on_memory(void* self, std::ptrdiff_t bytes, bool post);

  std::atomic<std::size_t> bytes_{0};
  Isa isa_ = Isa::scalar;
  Form form_ = Form::triangle4;
  // The scene goes before the device, and both before bytes_, which the memory monitor still writes to then.
  std::unique_ptr<RTCDeviceTy, DeviceRelease> device_;
  std::unique_ptr<RTCSceneTy, SceneRelease> scene_;
};

using Structures = TypeList<EmbreeAccel>;

}  // namespace arboretum::embree
