#include "structures/embree/embree.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/error.h"
#include "core/memory_meter.h"
#include "core/names.h"
#include "core/timer.h"
#include "structures/embree/rtcore.h"

namespace arboretum::embree {
namespace {

template <class Names>
void require_name(std::string_view kind, std::string_view name, const Names& names) {
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  const std::vector<std::string> list(names.begin(), names.end());
  throw UserError(unknown_name_message(kind, name, list));
}

RTCBuildQuality quality_of(std::string_view builder) {
  if (builder == "low") return RTC_BUILD_QUALITY_LOW;
  return builder == "high" ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM;
}

/// Embree's spatial splits divide by the difference of two corners on an axis, with subnormal numbers flushed to zero:
/// a build with assertions, such as Debian's, aborts, another divides by 0. Coordinates that are subnormal
/// themselves are 0 to it, and not split between.
void require_normal_edges(const TriangleMesh& mesh) {
  constexpr float kLeast = std::numeric_limits<float>::min();
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto corners = mesh.corners(i);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f &a = corners[k], &b = corners[(k + 1) % 3];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float difference = std::fabs(a[axis] - b[axis]);
        if (difference == 0.0f || difference >= kLeast) continue;
        if (std::max(std::fabs(a[axis]), std::fabs(b[axis])) < kLeast) continue;
        throw UserError("embree: triangle " + std::to_string(i) +
                        " has corners less than 1.2e-38 apart on an axis, which builder high divides by as by 0; scale "
                        "the mesh, or take medium");
      }
    }
  }
}

/// Packet widths that a device runs natively: they tell SSE, AVX and AVX-512 apart after the fact. Embree
/// falls back to SSE2 without a word when it is asked for a name that it does not know or was not built with.
bool device_runs(RTCDevice device, Isa isa) {
  const bool ray8 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  const bool ray16 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  return ray8 == (isa >= Isa::avx2) && ray16 == (isa == Isa::avx512);
}

/// In Form's order.
constexpr std::string_view kLeaves[] = {"triangle4", "triangle4v", "triangle4i"};
constexpr RTCSceneFlags kSceneFlags[] = {RTC_SCENE_FLAG_NONE, RTC_SCENE_FLAG_ROBUST, RTC_SCENE_FLAG_COMPACT};

}  // namespace

const StructureInfo& EmbreeAccel::static_info() {
  static const StructureInfo info{
      .name = kName,
      .summary = "Intel Embree " RTC_VERSION_STRING ": its own builders and kernels, beside ours",
      .library = "Intel Embree " RTC_VERSION_STRING,
      .builders = {"medium", "low", "high"},
      .leaves = {std::begin(kLeaves), std::end(kLeaves)},
      .build_depends_on_isa = true,
      .build_depends_on_threads = true,
      .uses_parameters = false,
      .why_no_build = [](std::string_view builder, std::string_view leaf) -> std::string {
        if (builder != "high" || std::ranges::find(kLeaves + 1, std::end(kLeaves), leaf) == std::end(kLeaves))
          return {};
        return "embree builds " + std::string(leaf) + " scenes as with medium where high is asked for: take triangle4";
      },
  };
  return info;
}

void EmbreeAccel::DeviceRelease::operator()(RTCDeviceTy* device) const noexcept { rtcReleaseDevice(device); }
void EmbreeAccel::SceneRelease::operator()(RTCSceneTy* scene) const noexcept { rtcReleaseScene(scene); }

EmbreeAccel::~EmbreeAccel() { release(); }

void EmbreeAccel::release() noexcept {
  scene_.reset();
  device_.reset();
}

bool EmbreeAccel::on_memory(void* self, std::ptrdiff_t bytes, bool) {
  auto& total = static_cast<EmbreeAccel*>(self)->bytes_;
  if (bytes >= 0) {
    total.fetch_add(static_cast<std::size_t>(bytes), std::memory_order_relaxed);
    MemoryMeter::add(static_cast<std::size_t>(bytes));
  } else {
    total.fetch_sub(static_cast<std::size_t>(-bytes), std::memory_order_relaxed);
    MemoryMeter::remove(static_cast<std::size_t>(-bytes));
  }
  return true;
}

void EmbreeAccel::check(std::string_view what) const {
  const RTCError error = rtcGetDeviceError(device_.get());
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    throw UserError("embree: out of memory in " + std::string(what) + "; take a smaller scene");
  throw std::runtime_error("embree: error " + std::to_string(int(error)) + " in " + std::string(what));
}

void EmbreeAccel::open_device(Isa isa) {
  if (isa == Isa::scalar) throw UserError("embree has no scalar kernels; use isa sse, avx2 or avx512");
  if (!cpu_supports(isa)) throw UserError("embree: this machine has no " + std::string(to_string(isa)));
  const std::string name = isa == Isa::sse ? "sse4.2" : std::string(to_string(isa));
  // No threads=N: Embree makes that a limit of the whole process while the device lives
  // (tbb::global_control), so our builders would run on its threads too. The build runs in an arena of N
  // threads instead; see build().
  device_.reset(rtcNewDevice(("isa=" + name + ",set_affinity=0").c_str()));
  if (!device_) throw std::runtime_error("embree: no device, error " + std::to_string(int(rtcGetDeviceError(nullptr))));
  if (!device_runs(device_.get(), isa)) {
    throw UserError("embree: this libembree was built without " + name + "; leave out isa " +
                    std::string(to_string(isa)));
  }
  // Behind a function pointer type: the API names it ssize_t, which is ptrdiff_t here.
  rtcSetDeviceMemoryMonitorFunction(device_.get(), &EmbreeAccel::on_memory, this);
  isa_ = isa;
}

void EmbreeAccel::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  require_name("builder of embree", settings.builder, info().builders);
  require_name("leaf of embree", settings.leaf, info().leaves);
  release();
  // Some 40 us, a fifth of a `low` build of a small scene: a program opens one device for all its scenes. What we check
  // first is no work of Embree's either.
  const double begin = wall_seconds();
  if (settings.builder == "high") require_normal_edges(mesh);
  open_device(settings.isa);
  report.apart_seconds = wall_seconds() - begin;
  form_ = Form(std::ranges::find(kLeaves, settings.leaf) - std::begin(kLeaves));
  const RTCBuildQuality quality = quality_of(settings.builder);
  scene_.reset(rtcNewScene(device_.get()));
  check("rtcNewScene");
  rtcSetSceneFlags(scene_.get(), kSceneFlags[int(form_)]);
  rtcSetSceneBuildQuality(scene_.get(), quality);

  if (!mesh.triangles.empty()) {
    const RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::unique_ptr<RTCGeometryTy, void (*)(RTCGeometry)> owner(geometry, &rtcReleaseGeometry);
    // `low` builds each geometry by itself, with the geometry's own quality: only both together give the
    // Morton builder.
    rtcSetGeometryBuildQuality(geometry, quality);
    rtcSetGeometryMask(geometry, ~0u);
    const std::size_t vertices = mesh.vertices.size();
    if (mesh.vertices.capacity() > vertices) {
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.vertices.data(), 0,
                                 sizeof(Vec3f), vertices);
    } else if (void* copy = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                    sizeof(Vec3f), vertices)) {
      std::copy(mesh.vertices.begin(), mesh.vertices.end(), static_cast<Vec3f*>(copy));
    }
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                               sizeof(Triangle), mesh.triangles.size());
    check("setting the buffers");
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_.get(), geometry, 0);
    check("rtcCommitGeometry");
  }
  // rtcCommitScene works in the caller's arena; TaskScheduler::threadCount() is then the arena's concurrency.
  tbb::task_arena arena(std::max(1, int(settings.threads)));
  arena.execute([&] { rtcCommitScene(scene_.get()); });
  check("rtcCommitScene");
}

const EmbreeAccel& EmbreeAccel::expect(Isa isa, Form form) const {
  if (isa_ == isa && form_ == form) return *this;
  const auto name = [](Isa i, Form f) { return std::string(to_string(i)).append(", ").append(kLeaves[int(f)]); };
  throw std::logic_error("embree: a kernel of " + name(isa, form) + " was called on a scene built for " +
                         name(isa_, form_));
}

}  // namespace arboretum::embree
