// Embree's ways of tracing a batch: one ray a call, packets, streams.
//
// The rays come as an array of ours and go back as an array of hits, whatever Embree wants in between: every conversion
// is made here, within the time that is measured. Packets are structures of arrays: rays are transposed into them four
// at a time. A stream is an array of Embree's own rays (rtcIntersect1M), filled a tile at a time.
#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "structures/embree/embree.h"
#include "structures/embree/rtcore.h"

namespace arboretum::embree {
namespace {

/// Rays of a tile handed to a stream: what was fastest (docs/performance.md). Any hit without the coherent flag sorts a
/// tile by octant and gains from a longer one, all else from a tile that stays in the first cache.
constexpr std::size_t kStreamTile = 64, kSortedTile = 1024;

/// Embree's own bound on the numbers of a ray (its FLT_LARGE). A build with assertions, such as Debian's, aborts on
/// anything beyond it, NaN and infinities included.
constexpr float kLargest = 1.844e18f;

/// Whether the ray may be handed to Embree: is_valid() in one pass, the bound, and some t >= 0, since a build with
/// assertions aborts on tnear < 0 (what hands it over raises it to 0). False with a NaN anywhere.
inline bool accepts(const Ray& ray) noexcept {
  const auto in_range = [](Vec3f a) {
    return unsigned(std::abs(a.x) <= kLargest) & unsigned(std::abs(a.y) <= kLargest) &
           unsigned(std::abs(a.z) <= kLargest);
  };
  const Vec3f d = ray.direction;
  const unsigned some_direction = unsigned(d.x != 0.0f) | unsigned(d.y != 0.0f) | unsigned(d.z != 0.0f);
  return (in_range(ray.origin) & in_range(d) & some_direction & unsigned(ray.tnear <= ray.tfar) &
          unsigned(ray.tfar >= 0.0f)) != 0;
}

/// What Embree is told beside scene and rays, in either version of its API.
class Context {
 public:
#if RTC_VERSION_MAJOR < 4
  explicit Context(bool coherent) {
    rtcInitIntersectContext(&context_);
    context_.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  }
  template <class Function, class Rays>
  void call(Function function, RTCScene scene, Rays* rays) {
    function(scene, &context_, rays);
  }
  template <class Function, class Rays>
  void call(Function function, const int* valid, RTCScene scene, Rays* rays) {
    function(valid, scene, &context_, rays);
  }
  template <class Function, class Rays>
  void call_stream(Function function, RTCScene scene, Rays* rays, std::size_t count) {
    function(scene, &context_, rays, unsigned(count), sizeof(Rays));
  }

 private:
  RTCIntersectContext context_;
#else
  explicit Context(bool coherent) {
    rtcInitIntersectArguments(&closest_);
    rtcInitOccludedArguments(&any_);
    closest_.flags = any_.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  }
  template <class Function, class Rays>
  void call(Function function, RTCScene scene, Rays* rays) {
    if constexpr (std::is_invocable_v<Function, RTCScene, Rays*, RTCIntersectArguments*>) {
      function(scene, rays, &closest_);
    } else {
      function(scene, rays, &any_);
    }
  }
  template <class Function, class Rays>
  void call(Function function, const int* valid, RTCScene scene, Rays* rays) {
    if constexpr (std::is_invocable_v<Function, const int*, RTCScene, Rays*, RTCIntersectArguments*>) {
      function(valid, scene, rays, &closest_);
    } else {
      function(valid, scene, rays, &any_);
    }
  }

 private:
  RTCIntersectArguments closest_;
  RTCOccludedArguments any_;
#endif
};

inline RTCRay to_embree(const Ray& ray) noexcept {
  RTCRay r;
  r.org_x = ray.origin.x, r.org_y = ray.origin.y, r.org_z = ray.origin.z;
  r.tnear = std::max(ray.tnear, 0.0f);
  r.dir_x = ray.direction.x, r.dir_y = ray.direction.y, r.dir_z = ray.direction.z, r.time = 0.0f;
  r.tfar = ray.tfar, r.mask = ~0u, r.id = 0, r.flags = 0;
  return r;
}

inline RTCRayHit to_query(const Ray& ray) noexcept {
  RTCRayHit query;
  query.ray = to_embree(ray);
  query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return query;
}

inline Hit to_hit(const RTCRayHit& query) noexcept {
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {query.ray.tfar, query.hit.u, query.hit.v, query.hit.primID};
}

/// -infinity where something was hit; accepts() saw it >= 0.
inline std::uint8_t is_occluded(float tfar) noexcept { return tfar < 0.0f; }

/// Calls trace(the indices of N rays that Embree takes) again and again, the last time with what remains; miss(index)
/// for the others.
template <std::size_t N, class Miss, class Trace>
void in_groups(std::span<const Ray> rays, Miss&& miss, Trace&& trace) {
  std::size_t index[N], count = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    index[count] = i;
    if (!accepts(rays[i])) {
      miss(i);
    } else if (++count == N) {
      trace(std::span<const std::size_t>(index, count));
      count = 0;
    }
  }
  if (count != 0) trace(std::span<const std::size_t>(index, count));
}

template <int K>
struct PacketOf;
template <>
struct PacketOf<4> {
  using Query = RTCRayHit4;
  static constexpr auto closest_hit = &rtcIntersect4;
  static constexpr auto any_hit = &rtcOccluded4;
};
template <>
struct PacketOf<8> {
  using Query = RTCRayHit8;
  static constexpr auto closest_hit = &rtcIntersect8;
  static constexpr auto any_hit = &rtcOccluded8;
};
template <>
struct PacketOf<16> {
  using Query = RTCRayHit16;
  static constexpr auto closest_hit = &rtcIntersect16;
  static constexpr auto any_hit = &rtcOccluded16;
};

/// K rays side by side; lanes without a ray are switched off.
template <int K>
class Packet {
 public:
  typename PacketOf<K>::Query query;
  alignas(64) int valid[K];

  Packet() {
    for (int lane = 0; lane < K; ++lane) {
      query.ray.time[lane] = 0.0f, query.ray.mask[lane] = ~0u, query.ray.id[lane] = query.ray.flags[lane] = 0;
      query.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
  }

  void load(std::span<const Ray> rays, std::span<const std::size_t> index) noexcept {
    auto& ray = query.ray;
    for (int lane = 0; lane < K; lane += 4) {
      const Ray* r[4];
      for (int k = 0; k < 4; ++k) r[k] = &rays[index[std::min(std::size_t(lane + k), index.size() - 1)]];
      transpose({&r[0]->origin.x, &r[1]->origin.x, &r[2]->origin.x, &r[3]->origin.x},
                {ray.org_x + lane, ray.org_y + lane, ray.org_z + lane, ray.tnear + lane});
      transpose({&r[0]->direction.x, &r[1]->direction.x, &r[2]->direction.x, &r[3]->direction.x},
                {ray.dir_x + lane, ray.dir_y + lane, ray.dir_z + lane, ray.tfar + lane});
    }
    for (int lane = 0; lane < K; ++lane) {
      ray.tnear[lane] = std::max(ray.tnear[lane], 0.0f);
      query.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
      valid[lane] = std::size_t(lane) < index.size() ? -1 : 0;
    }
  }

  [[nodiscard]] Hit hit(std::size_t lane) const noexcept {
    if (query.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID) return {};
    return {query.ray.tfar[lane], query.hit.u[lane], query.hit.v[lane], query.hit.primID[lane]};
  }

 private:
  struct Four {
    const float* at[4];
  };
  struct FourTo {
    float* at[4];
  };
  /// The k-th of each `from` side by side in the k-th `to`.
  static void transpose(const Four& from, const FourTo& to) noexcept {
    __m128 a = _mm_load_ps(from.at[0]), b = _mm_load_ps(from.at[1]), c = _mm_load_ps(from.at[2]),
           d = _mm_load_ps(from.at[3]);
    _MM_TRANSPOSE4_PS(a, b, c, d);
    _mm_store_ps(to.at[0], a), _mm_store_ps(to.at[1], b), _mm_store_ps(to.at[2], c), _mm_store_ps(to.at[3], d);
  }
};

void closest_single(RTCScene scene, RayBatch batch, std::span<Hit> hits) {
  Context context(false);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    hits[i] = {};
    if (!accepts(batch[i])) continue;
    RTCRayHit query = to_query(batch[i]);
    context.call(&rtcIntersect1, scene, &query);
    hits[i] = to_hit(query);
  }
}

void any_single(RTCScene scene, RayBatch batch, std::span<std::uint8_t> occluded) {
  Context context(false);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    occluded[i] = 0;
    if (!accepts(batch[i])) continue;
    RTCRay ray = to_embree(batch[i]);
    context.call(&rtcOccluded1, scene, &ray);
    occluded[i] = is_occluded(ray.tfar);
  }
}

template <int K>
void closest_packets(RTCScene scene, RayBatch batch, std::span<Hit> hits) {
  Context context(batch.coherent);
  Packet<K> packet;
  in_groups<K>(
      batch.rays, [&](std::size_t i) { hits[i] = {}; },
      [&](std::span<const std::size_t> index) {
        packet.load(batch.rays, index);
        context.call(PacketOf<K>::closest_hit, packet.valid, scene, &packet.query);
        for (std::size_t lane = 0; lane < index.size(); ++lane) hits[index[lane]] = packet.hit(lane);
      });
}

template <int K>
void any_packets(RTCScene scene, RayBatch batch, std::span<std::uint8_t> occluded) {
  Context context(batch.coherent);
  Packet<K> packet;
  in_groups<K>(
      batch.rays, [&](std::size_t i) { occluded[i] = 0; },
      [&](std::span<const std::size_t> index) {
        packet.load(batch.rays, index);
        context.call(PacketOf<K>::any_hit, packet.valid, scene, &packet.query.ray);
        for (std::size_t lane = 0; lane < index.size(); ++lane)
          occluded[index[lane]] = is_occluded(packet.query.ray.tfar[lane]);
      });
}

#if RTC_VERSION_MAJOR < 4
void closest_stream(RTCScene scene, RayBatch batch, std::span<Hit> hits) {
  Context context(batch.coherent);
  RTCRayHit tile[kStreamTile];
  in_groups<kStreamTile>(
      batch.rays, [&](std::size_t i) { hits[i] = {}; },
      [&](std::span<const std::size_t> index) {
        for (std::size_t k = 0; k < index.size(); ++k) tile[k] = to_query(batch[index[k]]);
        context.call_stream(&rtcIntersect1M, scene, tile, index.size());
        for (std::size_t k = 0; k < index.size(); ++k) hits[index[k]] = to_hit(tile[k]);
      });
}

template <std::size_t N>
void any_stream(RTCScene scene, RayBatch batch, std::span<std::uint8_t> occluded) {
  Context context(batch.coherent);
  RTCRay tile[N];
  in_groups<N>(
      batch.rays, [&](std::size_t i) { occluded[i] = 0; },
      [&](std::span<const std::size_t> index) {
        for (std::size_t k = 0; k < index.size(); ++k) tile[k] = to_embree(batch[index[k]]);
        context.call_stream(&rtcOccluded1M, scene, tile, index.size());
        for (std::size_t k = 0; k < index.size(); ++k) occluded[index[k]] = is_occluded(tile[k].tfar);
      });
}
#endif

}  // namespace

bool has_streams() noexcept { return RTC_VERSION_MAJOR < 4; }

void EmbreeAccel::closest_hit(Mode mode, RayBatch rays, std::span<Hit> hits) const {
  switch (mode) {
    case Mode::single: return closest_single(scene_.get(), rays, hits);
    case Mode::packet4: return closest_packets<4>(scene_.get(), rays, hits);
    case Mode::packet8: return closest_packets<8>(scene_.get(), rays, hits);
    case Mode::packet16: return closest_packets<16>(scene_.get(), rays, hits);
    case Mode::stream:
#if RTC_VERSION_MAJOR < 4
      return closest_stream(scene_.get(), rays, hits);
#else
      break;
#endif
  }
  throw std::logic_error("embree: this version has no ray streams");
}

void EmbreeAccel::any_hit(Mode mode, RayBatch rays, std::span<std::uint8_t> occluded) const {
  switch (mode) {
    case Mode::single: return any_single(scene_.get(), rays, occluded);
    case Mode::packet4: return any_packets<4>(scene_.get(), rays, occluded);
    case Mode::packet8: return any_packets<8>(scene_.get(), rays, occluded);
    case Mode::packet16: return any_packets<16>(scene_.get(), rays, occluded);
    case Mode::stream:
#if RTC_VERSION_MAJOR < 4
      return (rays.coherent ? any_stream<kStreamTile> : any_stream<kSortedTile>)(scene_.get(), rays, occluded);
#else
      break;
#endif
  }
  throw std::logic_error("embree: this version has no ray streams");
}

}  // namespace arboretum::embree
