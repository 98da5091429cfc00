// Embree behind Accel: the same rays as a double-precision brute force, on every ISA, build quality and
// robustness.
#include <cmath>
#include <iostream>
#include <limits>

#include <tbb/global_control.h>

#include "core/error.h"
#include "core/memory_meter.h"
#include "core/random.h"
#include "core/timer.h"
#include "structures/embree/embree.h"
#include "tests/catch.h"

using namespace arboretum;
using arboretum::embree::EmbreeAccel;
using arboretum::embree::Form;
using arboretum::embree::Mode;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

float number(std::uint64_t seed, std::uint64_t i, std::uint64_t dimension, float low, float high) {
  return low + (high - low) * random_float(seed, i, dimension);
}

TriangleMesh random_triangles(std::size_t count, std::uint64_t seed) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f center{number(seed, i, 0, -1, 1), number(seed, i, 1, -1, 1), number(seed, i, 2, -1, 1)};
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t d = 3 + 3 * std::uint64_t(k);
      mesh.vertices.push_back(center + 0.2f * Vec3f{number(seed, i, d, -1, 1), number(seed, i, d + 1, -1, 1),
                                                    number(seed, i, d + 2, -1, 1)});
    }
    const auto first = std::uint32_t(3 * i);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

std::vector<Ray> random_rays(std::size_t count, std::uint64_t seed) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f from{number(seed, i, 0, -2, 2), number(seed, i, 1, -2, 2), number(seed, i, 2, -2, 2)};
    const Vec3f to{number(seed, i, 3, -1, 1), number(seed, i, 4, -1, 1), number(seed, i, 5, -1, 1)};
    rays.push_back({from, 0.0f, to - from, i % 3 == 0 ? 1.0f : kInfinity});
  }
  return rays;
}

/// Moeller-Trumbore in double. `near_edge`: some triangle's decision is within 1e-5 of a boundary, so a float
/// kernel may differ.
struct Truth {
  bool hit = false, near_edge = false;
  double t = 0, u = 0, v = 0;
  std::uint32_t primitive = kNoPrimitive;
};

Truth brute_force(const TriangleMesh& mesh, const Ray& ray) {
  struct D3 {
    double x, y, z;
  };
  const auto d3 = [](Vec3f p) { return D3{p.x, p.y, p.z}; };
  const auto sub = [](D3 a, D3 b) { return D3{a.x - b.x, a.y - b.y, a.z - b.z}; };
  const auto cross = [](D3 a, D3 b) { return D3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; };
  const auto dot = [](D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  Truth truth;
  truth.t = ray.tfar;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto [a, b, c] = mesh.corners(i);
    const D3 e1 = sub(d3(b), d3(a)), e2 = sub(d3(c), d3(a)), d = d3(ray.direction), s = sub(d3(ray.origin), d3(a));
    const D3 p = cross(d, e2), q = cross(s, e1);
    const double det = dot(e1, p), u = dot(s, p) / det, v = dot(d, q) / det, t = dot(e2, q) / det;
    const double margin = std::min({u, v, 1 - u - v});
    const bool inside_interval = t >= ray.tnear - 1e-5 && t <= double(ray.tfar) + 1e-5;
    if (inside_interval && (std::abs(margin) < 1e-5 || std::abs(t - ray.tnear) < 1e-5 || std::abs(t - ray.tfar) < 1e-5))
      truth.near_edge = true;
    if (!(margin >= 0 && t >= ray.tnear && t <= truth.t)) continue;
    if (truth.hit && t == truth.t) continue;
    truth = {true, truth.near_edge, t, u, v, std::uint32_t(i)};
  }
  return truth;
}

EmbreeAccel& build(EmbreeAccel& accel, const TriangleMesh& mesh, Isa isa, std::string_view builder,
                   std::string_view leaf, unsigned threads = 1) {
  BuildSettings settings;
  settings.builder = builder, settings.leaf = leaf, settings.isa = isa, settings.threads = threads;
  BuildReport report;
  accel.build(mesh, settings, report);
  return accel;
}

/// A way of tracing, and whether the batch is marked coherent.
struct Way {
  const char* name;
  Mode mode;
  bool coherent;
};
constexpr Way kSingle{"single", Mode::single, false};

/// Those that the instruction set has.
std::vector<Way> ways_of(Isa isa) {
  std::vector<Way> ways{kSingle, {"packet4", Mode::packet4, false}, {"packet4, coherent", Mode::packet4, true}};
  if (isa >= Isa::avx2) {
    ways.push_back({"packet8", Mode::packet8, false});
    ways.push_back({"packet8, coherent", Mode::packet8, true});
  }
  if (isa >= Isa::avx512) {
    ways.push_back({"packet16", Mode::packet16, false});
    ways.push_back({"packet16, coherent", Mode::packet16, true});
  }
  if (arboretum::embree::has_streams()) {
    ways.push_back({"stream", Mode::stream, false});
    ways.push_back({"stream, coherent", Mode::stream, true});
  }
  return ways;
}

std::vector<Hit> closest(const EmbreeAccel& accel, std::span<const Ray> rays, const Way& way = kSingle) {
  std::vector<Hit> hits(rays.size(), Hit{std::numeric_limits<float>::quiet_NaN(), 0, 0, 0xdeadbeefu});
  RayBatch batch(rays);
  batch.coherent = way.coherent;
  accel.closest_hit(way.mode, batch, hits);
  return hits;
}

std::vector<std::uint8_t> any(const EmbreeAccel& accel, std::span<const Ray> rays, const Way& way = kSingle) {
  std::vector<std::uint8_t> occluded(rays.size(), 2);
  RayBatch batch(rays);
  batch.coherent = way.coherent;
  accel.any_hit(way.mode, batch, occluded);
  return occluded;
}

}  // namespace

TEST_CASE("embree finds what a double-precision brute force finds") {
  for (std::size_t triangles : {1u, 2u, 7u, 300u, 2000u}) {
    const TriangleMesh mesh = random_triangles(triangles, 11 + triangles);
    const std::vector<Ray> rays = random_rays(triangles > 1000 ? 400 : 1000, 5);
    std::vector<Truth> truth;
    for (const Ray& ray : rays) truth.push_back(brute_force(mesh, ray));
    for (Isa isa : kAllIsas) {
      if (isa == Isa::scalar) continue;
      if (!is_available(isa)) {
        std::cout << "skipped: " << to_string(isa) << ", not available here\n";
        continue;
      }
      for (std::string_view builder : EmbreeAccel::static_info().builders) {
        for (std::string_view leaf : EmbreeAccel::static_info().leaves) {
          INFO("triangles " << triangles << ", isa " << to_string(isa) << ", " << builder << ", " << leaf);
          EmbreeAccel accel;
          build(accel, mesh, isa, builder, leaf);
          CHECK(accel.isa() == isa);
          CHECK(accel.bytes() > 0);
          for (const Way& way : ways_of(isa)) {
            INFO(way.name);
            const std::vector<Hit> hits = closest(accel, rays, way);
            const std::vector<std::uint8_t> occluded = any(accel, rays, way);
            std::size_t compared = 0, found = 0;
            for (std::size_t i = 0; i < rays.size(); ++i) {
              CHECK((occluded[i] == 0 || occluded[i] == 1));
              if (truth[i].near_edge) continue;
              ++compared, found += truth[i].hit;
              INFO("ray " << i);
              REQUIRE(hits[i].is_hit() == truth[i].hit);
              REQUIRE(occluded[i] == std::uint8_t(truth[i].hit));
              if (!truth[i].hit) {
                REQUIRE(hits[i].t == kInfinity);
                continue;
              }
              REQUIRE(std::abs(hits[i].t - truth[i].t) <= 1e-4 * truth[i].t + 1e-5);
              if (hits[i].primitive != truth[i].primitive) {  // two surfaces closer than the tolerance
                const Truth other = truth[i];
                REQUIRE(std::abs(hits[i].t - other.t) <= 1e-5);
                continue;
              }
              REQUIRE(std::abs(hits[i].u - truth[i].u) <= 2e-3);
              REQUIRE(std::abs(hits[i].v - truth[i].v) <= 2e-3);
            }
            CHECK(compared > rays.size() * 9 / 10);
            if (triangles >= 300) CHECK(found > rays.size() / 10);
          }
        }
      }
    }
  }
}

TEST_CASE("u weighs the second vertex and v the third") {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  mesh.triangles = {{0, 1, 2}};
  for (std::string_view leaf : EmbreeAccel::static_info().leaves) {
    EmbreeAccel accel;
    build(accel, mesh, Isa::sse, "medium", leaf);
    const Ray ray{{1, 0.5f, -2}, 0, {0, 0, 2}, 1};
    const Hit hit = closest(accel, {&ray, 1})[0];  // t == tfar: a closed interval
    CHECK(hit.primitive == 0);
    CHECK(hit.t == Approx(1.0f));
    CHECK(hit.u == Approx(0.25f));
    CHECK(hit.v == Approx(0.125f));
  }
}

TEST_CASE("invalid rays hit nothing in embree") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Ray> rays{
      {{nan, 0, 0}, 0, {0, 0, 1}, kInfinity},        {{0, 0, -3}, 0, {0, nan, 1}, kInfinity},
      {{0, 0, -3}, nan, {0, 0, 1}, kInfinity},       {{0, 0, -3}, 0, {0, 0, 1}, nan},
      {{kInfinity, 0, 0}, 0, {-1, 0, 0}, kInfinity}, {{0, 0, -3}, 0, {0, 0, kInfinity}, kInfinity},
      {{0, 0, 0}, 0, {0, 0, 0}, kInfinity},          {{0, 0, -3}, 9, {0, 0, 1}, 1},
      {{0, 0, -3}, 0, {0, 0, 1}, -kInfinity},        {{0, 0, -3}, 0, {0, 0, 1}, -1},
  };
  const TriangleMesh mesh = random_triangles(500, 3);
  for (Isa isa : available_isas()) {
    if (isa == Isa::scalar) continue;
    for (std::string_view leaf : EmbreeAccel::static_info().leaves) {
      EmbreeAccel accel;
      build(accel, mesh, isa, "medium", leaf);
      for (const Way& way : ways_of(isa)) {
        const std::vector<Hit> hits = closest(accel, rays, way);
        const std::vector<std::uint8_t> occluded = any(accel, rays, way);
        for (std::size_t i = 0; i < rays.size(); ++i) {
          INFO(to_string(isa) << " " << leaf << " " << way.name << " ray " << i);
          CHECK_FALSE(hits[i].is_hit());
          CHECK(hits[i].t == kInfinity);
          CHECK(occluded[i] == 0);
        }
      }
    }
  }
}

// Lanes and places of a stream without a ray, and rays that Embree does not get, between those that it gets.
TEST_CASE("packets and streams of embree answer as its single rays do, whatever the batch") {
  const TriangleMesh mesh = random_triangles(2000, 17);
  const Bounds3f bounds = mesh.bounds();
  std::vector<Ray> rays = random_rays(600, 23);
  for (std::size_t i = 0; i < 600; ++i) {  // seen from a point, as a camera's
    const Vec3f to{number(29, i, 0, -1, 1), number(29, i, 1, -1, 1), bounds.lower.z};
    rays.push_back({{0, 0, 4}, 0.0f, to - Vec3f{0, 0, 4}, kInfinity});
  }
  for (std::size_t i = 0; i < rays.size(); i += 7) rays[i].direction = {0, 0, 0};
  for (std::size_t i = 3; i < rays.size(); i += 31) rays[i].tnear = -1.0f;  // Embree takes 0
  for (Isa isa : available_isas()) {
    if (isa == Isa::scalar) continue;
    for (std::string_view leaf : EmbreeAccel::static_info().leaves) {
      EmbreeAccel accel;
      build(accel, mesh, isa, "medium", leaf);
      const std::vector<Hit> want = closest(accel, rays);
      const std::vector<std::uint8_t> want_any = any(accel, rays);
      std::size_t found = 0;
      for (const Hit& hit : want) found += hit.is_hit();
      CHECK(found > 100);
      for (const Way& way : ways_of(isa)) {
        for (std::size_t size : {0u, 1u, 2u, 3u, 4u, 5u, 7u, 8u, 9u, 15u, 16u, 17u, 31u, 32u, 33u, 65u, 1200u}) {
          for (std::size_t begin : {0u, 599u}) {
            const std::size_t count = std::min(size, rays.size() - begin);
            const std::vector<Hit> hits = closest(accel, std::span(rays).subspan(begin, count), way);
            const std::vector<std::uint8_t> occluded = any(accel, std::span(rays).subspan(begin, count), way);
            for (std::size_t i = 0; i < count; ++i) {
              INFO(to_string(isa) << " " << leaf << " " << way.name << " of " << count << " from " << begin << ", ray "
                                  << i);
              const Hit& single = want[begin + i];
              REQUIRE(hits[i].is_hit() == single.is_hit());
              REQUIRE(occluded[i] == want_any[begin + i]);
              if (!single.is_hit()) {
                REQUIRE(hits[i].t == kInfinity);
                continue;
              }
              REQUIRE(hits[i].primitive == single.primitive);
              REQUIRE(std::abs(hits[i].t - single.t) <= 1e-5f * single.t);
              REQUIRE(std::abs(hits[i].u - single.u) <= 1e-3f);
              REQUIRE(std::abs(hits[i].v - single.v) <= 1e-3f);
            }
          }
        }
      }
    }
  }
}

TEST_CASE("the time of an embree build is without opening the device") {
  const TriangleMesh mesh = random_triangles(1, 1);
  BuildSettings settings;
  settings.builder = "low", settings.leaf = "triangle4", settings.isa = Isa::sse;
  double device = kInfinity, whole = kInfinity, reported = kInfinity;
  for (int i = 0; i < 30; ++i) {
    BuildReport direct, report;
    EmbreeAccel accel;
    const double begin = wall_seconds();
    accel.build(mesh, settings, direct);
    whole = std::min(whole, wall_seconds() - begin);
    CHECK(direct.phases.empty());
    device = std::min(device, direct.apart_seconds);
    (void)build_structure("embree", mesh, settings, report);
    reported = std::min(reported, report.seconds);
    CHECK(report.phases.empty());
    CHECK(report.cpu_seconds >= 0.0);
  }
  CHECK(device > 0.0);
  CHECK(reported > 0.0);
  CHECK(reported < whole - 0.5 * device);
}

TEST_CASE("embree's compact scene takes less memory than its default one") {
  TriangleMesh mesh = random_triangles(20000, 1);
  mesh.vertices.reserve(mesh.vertices.size() + 1);  // no copy of the vertices in either
  EmbreeAccel accel;
  const std::size_t plain = build(accel, mesh, Isa::sse, "medium", "triangle4").bytes();
  CHECK(accel.form() == Form::triangle4);
  const std::size_t compact = build(accel, mesh, Isa::sse, "medium", "triangle4i").bytes();
  CHECK(accel.form() == Form::triangle4i);
  CHECK(compact < plain * 3 / 4);
}

TEST_CASE("embree gives its memory back, and can build again") {
  const std::size_t before = MemoryMeter::current();
  {
    TriangleMesh mesh = random_triangles(4000, 1);
    mesh.vertices.shrink_to_fit();  // no room behind the last vertex: Embree gets a copy
    EmbreeAccel accel;
    build(accel, mesh, Isa::sse, "high", "triangle4");
    const std::size_t copied = accel.bytes();
    CHECK(copied >= mesh.vertices.size() * sizeof(Vec3f) + 4000 * 36);
    CHECK(MemoryMeter::current() == before + copied);
    mesh.vertices.reserve(mesh.vertices.size() + 1);
    build(accel, mesh, Isa::sse, "high", "triangle4");
    CHECK(accel.bytes() < copied);
    const TriangleMesh empty;
    build(accel, empty, Isa::sse, "medium", "triangle4v");
    CHECK_FALSE(closest(accel, random_rays(3, 1))[1].is_hit());
    CHECK(closest(accel, {}).empty());
  }
  CHECK(MemoryMeter::current() == before);
}

TEST_CASE("embree says what it cannot do") {
  const TriangleMesh mesh = random_triangles(3, 1);
  EmbreeAccel accel;
  CHECK_THROWS_WITH(build(accel, mesh, Isa::scalar, "medium", "triangle4"), Catch::Contains("no scalar kernels"));
  CHECK_THROWS_WITH(build(accel, mesh, Isa::sse, "mediun", "triangle4"), Catch::Contains("did you mean 'medium'?"));
  CHECK_THROWS_AS(build(accel, mesh, Isa::sse, "medium", "triangle8"), UserError);
  for (const char* leaf : {"triangle4v", "triangle4i"}) {  // quality that Embree would leave out
    BuildSettings settings{.builder = "high", .leaf = leaf, .isa = Isa::sse, .parameters = {}};
    BuildReport report;
    CHECK_THROWS_WITH(build_structure("embree", mesh, settings, report), Catch::Contains("scenes as with medium"));
    settings.builder = "low";
    CHECK_NOTHROW(build_structure("embree", mesh, settings, report));
  }
  build(accel, mesh, Isa::sse, "medium", "triangle4");
  CHECK_NOTHROW(accel.expect(Isa::sse, Form::triangle4));
  CHECK_THROWS_AS(accel.expect(Isa::avx2, Form::triangle4), std::logic_error);
  CHECK_THROWS_AS(accel.expect(Isa::sse, Form::triangle4v), std::logic_error);
  CHECK_THROWS_AS(accel.expect(Isa::sse, Form::triangle4i), std::logic_error);
  struct : StructureVisitor {
    void node(const NodeView&) override { FAIL(); }
    void leaf(const LeafView&) override { FAIL(); }
  } visitor;
  CHECK_FALSE(accel.visit(visitor));
}

TEST_CASE("a mesh so small that embree's spatial splits divide by 0 is refused, and does not end the program") {
  std::size_t refused = 0;
  for (const int exponent : {-100, -110, -115, -118, -120, -122, -124, -126, -130, -140}) {
    INFO("2^" << exponent);
    TriangleMesh mesh = random_triangles(300, 3);
    for (Vec3f& v : mesh.vertices) v = v * std::ldexp(1.0f, exponent);
    EmbreeAccel accel;
    CHECK_NOTHROW(build(accel, mesh, Isa::sse, "medium", "triangle4"));
    try {
      build(accel, mesh, Isa::sse, "high", "triangle4");
    } catch (const UserError& e) {
      CHECK_THAT(e.what(), Catch::Contains("take medium"));
      ++refused;
    }
  }
  CHECK(refused > 0);
  CHECK(refused < 10);
}

TEST_CASE("an embree device does not limit the threads of others") {
  const TriangleMesh mesh = random_triangles(100, 1);
  const std::size_t before = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  EmbreeAccel accel;
  build(accel, mesh, Isa::sse, "medium", "triangle4", 1);
  CHECK(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) == before);
}
