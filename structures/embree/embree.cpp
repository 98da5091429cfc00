#include "structures/embree/embree.h"

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/error.h"
#include "core/memory_meter.h"
#include "core/names.h"

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

/// Packet widths that a device runs natively: they tell SSE, AVX and AVX-512 apart after the fact. Embree
/// falls back to SSE2 without a word when it is asked for a name that it does not know or was not built with.
bool device_runs(RTCDevice device, Isa isa) {
  const bool ray8 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  const bool ray16 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  return ray8 == (isa >= Isa::avx2) && ray16 == (isa == Isa::avx512);
}

/// Embree's own bound on the numbers of a ray (its FLT_LARGE). A build with assertions, such as Debian's,
/// aborts on anything beyond it, NaN and infinities included.
constexpr float kLargest = 1.844e18f;

/// Whether the ray may be handed to Embree: is_valid() in one pass, the bound, and some t >= 0, since a build
/// with assertions aborts on tnear < 0 (to_embree() raises it to 0). False with a NaN anywhere.
inline bool accepts(const Ray& ray) noexcept {
  const auto in_range = [](Vec3f a) {
    return (std::abs(a.x) <= kLargest) & (std::abs(a.y) <= kLargest) & (std::abs(a.z) <= kLargest);
  };
  const Vec3f d = ray.direction;
  return in_range(ray.origin) & in_range(d) & ((d.x != 0.0f) | (d.y != 0.0f) | (d.z != 0.0f)) &
         (ray.tnear <= ray.tfar) & (ray.tfar >= 0.0f);
}

inline RTCRay to_embree(const Ray& ray) noexcept {
  RTCRay r;
  r.org_x = ray.origin.x, r.org_y = ray.origin.y, r.org_z = ray.origin.z;
  r.tnear = std::max(ray.tnear, 0.0f);
  r.dir_x = ray.direction.x, r.dir_y = ray.direction.y, r.dir_z = ray.direction.z, r.time = 0.0f;
  r.tfar = ray.tfar, r.mask = ~0u, r.id = 0, r.flags = 0;
  return r;
}

}  // namespace

const StructureInfo& EmbreeAccel::static_info() {
  static const StructureInfo info{
      .name = kName,
      .summary = "Intel Embree " RTC_VERSION_STRING ": its own builders and kernels, beside ours",
      .builders = {"medium", "low", "high"},
      .leaves = {"triangle4", "triangle4v"},
      .build_depends_on_isa = true,
      .build_depends_on_threads = true,
      .uses_parameters = false,
  };
  return info;
}

void EmbreeAccel::DeviceRelease::operator()(RTCDeviceTy* device) const noexcept {
  rtcReleaseDevice(device);
}
void EmbreeAccel::SceneRelease::operator()(RTCSceneTy* scene) const noexcept {
  rtcReleaseScene(scene);
}

EmbreeAccel::~EmbreeAccel() {
  release();
}

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
  if (!device_)
    throw std::runtime_error("embree: no device, error " + std::to_string(int(rtcGetDeviceError(nullptr))));
  if (!device_runs(device_.get(), isa)) {
    throw UserError("embree: this libembree was built without " + name + "; leave out isa " +
                    std::string(to_string(isa)));
  }
  // Behind a function pointer type: the API names it ssize_t, which is ptrdiff_t here.
  rtcSetDeviceMemoryMonitorFunction(device_.get(), &EmbreeAccel::on_memory, this);
  isa_ = isa;
}

void EmbreeAccel::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport&) {
  require_name("builder of embree", settings.builder, info().builders);
  require_name("leaf of embree", settings.leaf, info().leaves);
  release();
  open_device(settings.isa);
  robust_ = settings.leaf == "triangle4v";
  const RTCBuildQuality quality = quality_of(settings.builder);
  scene_.reset(rtcNewScene(device_.get()));
  check("rtcNewScene");
  rtcSetSceneFlags(scene_.get(), robust_ ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
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
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.vertices.data(),
                                 0, sizeof(Vec3f), vertices);
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

const EmbreeAccel& EmbreeAccel::expect(Isa isa, bool robust) const {
  if (isa_ == isa && robust_ == robust) return *this;
  throw std::logic_error("embree: a kernel of " + std::string(to_string(isa)) + (robust ? ", robust" : "") +
                         " was called on a scene built for " + std::string(to_string(isa_)) +
                         (robust_ ? ", robust" : ""));
}

void EmbreeAccel::intersect_single(std::span<const Ray> rays, std::span<Hit> hits) const {
  const RTCScene scene = scene_.get();
#if RTC_VERSION_MAJOR < 4
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);  // RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT: single rays know no other
#endif
  for (std::size_t i = 0; i < rays.size(); ++i) {
    hits[i] = Hit{};
    if (!accepts(rays[i])) continue;
    RTCRayHit query;
    query.ray = to_embree(rays[i]);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR < 4
    rtcIntersect1(scene, &context, &query);
#else
    rtcIntersect1(scene, &query, nullptr);
#endif
    if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID)
      hits[i] = {query.ray.tfar, query.hit.u, query.hit.v, query.hit.primID};
  }
}

void EmbreeAccel::occluded_single(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const {
  const RTCScene scene = scene_.get();
#if RTC_VERSION_MAJOR < 4
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
#endif
  for (std::size_t i = 0; i < rays.size(); ++i) {
    occluded[i] = 0;
    if (!accepts(rays[i])) continue;
    RTCRay ray = to_embree(rays[i]);
#if RTC_VERSION_MAJOR < 4
    rtcOccluded1(scene, &context, &ray);
#else
    rtcOccluded1(scene, &ray, nullptr);
#endif
    occluded[i] = ray.tfar < 0.0f;  // -infinity when something is hit; accepts() saw it >= 0
  }
}

}  // namespace arboretum::embree
