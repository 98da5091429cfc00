// Arboretum as a library: one ray, a packet and a batch give the kernel's own answers, bit for bit, defaults are what
// the header says, and every misuse is one line.
#include "library/arboretum.h"

#include <algorithm>
#include <future>
#include <tuple>
#include <type_traits>

#include "core/instances.h"
#include "oracle/oracle.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/folder.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

static_assert(std::is_nothrow_move_constructible_v<Tracer> && std::is_nothrow_move_assignable_v<Tracer>);
static_assert(!std::is_copy_constructible_v<Tracer>);

constexpr std::size_t kGeneric = 203;

std::vector<Ray> test_rays(const TriangleMesh& mesh) {
  std::vector<Ray> rays = generic_rays(mesh, kGeneric, 5);
  for (const Ray& ray : aimed_rays(mesh, {0.3f, 0.2f, 2.5f}, 200, 6)) rays.push_back(ray);
  for (const Ray& ray : invalid_rays()) rays.push_back(ray);
  return rays;
}

template <std::size_t N>
void check_packets(const Tracer& tracer, const std::vector<Ray>& rays, const std::vector<Hit>& hits,
                   const std::vector<std::uint8_t>& occluded) {
  for (std::size_t first = 0; first + N <= rays.size(); first += N) {
    std::array<Ray, N> packet;
    std::copy_n(rays.begin() + std::ptrdiff_t(first), N, packet.begin());
    REQUIRE(same_bits(tracer.closest_hit(packet), std::span(hits).subspan(first, N)));
    const std::array<std::uint8_t, N> any = tracer.any_hit(packet);
    REQUIRE(std::equal(any.begin(), any.end(), occluded.begin() + std::ptrdiff_t(first)));
  }
}

/// One ray, packets and the batch agree bit for bit; returns the batch's hits.
std::vector<Hit> check_three_ways(const Tracer& tracer, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  std::vector<std::uint8_t> occluded(rays.size(), 7);
  tracer.closest_hit(rays, hits);
  tracer.any_hit(rays, occluded);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit hit = tracer.closest_hit(rays[i]);
    REQUIRE(same_bits({&hit, 1}, {&hits[i], 1}));
    REQUIRE(tracer.any_hit(rays[i]) == (occluded[i] == 1));
    REQUIRE(occluded[i] == std::uint8_t(hit.is_hit()));
  }
  check_packets<1>(tracer, rays, hits, occluded);
  check_packets<4>(tracer, rays, hits, occluded);
  check_packets<7>(tracer, rays, hits, occluded);
  check_packets<8>(tracer, rays, hits, occluded);
  check_packets<16>(tracer, rays, hits, occluded);
  check_packets<64>(tracer, rays, hits, occluded);
  return hits;
}

std::string message_of(const TracerSettings& settings, TriangleMesh mesh = sphere(4)) {
  return error_of([&] { const Tracer tracer(std::move(mesh), settings); });
}

TracerSettings with(std::string TracerSettings::*key, std::string value) {
  TracerSettings settings;
  settings.*key = std::move(value);
  return settings;
}

}  // namespace

TEST_CASE("one ray, a packet and a batch agree on every structure and ISA, and with the exact answers by default") {
  const TriangleMesh mesh = sphere(16);
  const std::vector<Ray> rays = test_rays(mesh);
  const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays);
  for (const StructureEntry& entry : all_structures()) {
    for (Isa isa : available_isas()) {
      INFO(entry.info.name << " " << to_string(isa));
      TracerSettings settings;
      settings.structure = entry.info.name, settings.isa = to_string(isa);
      if (entry.info.name == "embree") settings.intersector = "pluecker";
      if (default_leaf(settings.structure, settings.intersector, isa).empty()) continue;  // not compiled in
      const Tracer tracer(mesh, settings);
      CHECK(tracer.settings().isa == to_string(isa));
      CHECK(tracer.settings().builder == entry.info.builders.front());
      CHECK(tracer.structure().info().name == entry.info.name);
      CHECK(tracer.kernel().leaf == tracer.settings().leaf);
      const std::vector<Hit> hits = check_three_ways(tracer, rays);
      if (entry.info.name == "embree") continue;
      std::size_t found = 0;
      for (std::size_t i = 0; i < kGeneric; ++i) {  // at the silhouette rounding decides
        found += truth[i].hit.is_hit();
        REQUIRE(hits[i].is_hit() == truth[i].hit.is_hit());
      }
      CHECK(found > 100);
    }
  }
}

TEST_CASE("the defaults: watertight, padded, the best instruction set") {
  const Tracer tracer(sphere(8));
  CHECK(tracer.settings().structure == "bvh8");
  CHECK(tracer.kernel().intersector == "watertight");
  CHECK(tracer.kernel().box == "padded");
  CHECK(tracer.settings().threads >= 1);
  CHECK(tracer.report().seconds > 0);
  CHECK(tracer.structure().bytes() > 0);
  const Isa best = tracer.kernel().isa;
  for (Isa isa : available_isas()) CHECK((isa <= best || default_leaf("bvh8", "watertight", isa).empty()));
}

TEST_CASE("keys that stand for others mean what they mean on the command line") {
  const TriangleMesh mesh = random_triangles(200, 0.3f, 3);
  const auto settled = [&](const TracerSettings& settings) { return Tracer(mesh, settings).settings(); };
  const TracerSettings plain = settled({});
  const TracerSettings all_auto = settled(
      {.structure = "auto", .builder = "auto", .leaf = "auto", .intersector = "auto", .box = "auto", .isa = "auto"});
  CHECK(
      std::tie(all_auto.structure, all_auto.builder, all_auto.leaf, all_auto.intersector, all_auto.box, all_auto.isa) ==
      std::tie(plain.structure, plain.builder, plain.leaf, plain.intersector, plain.box, plain.isa));
  CHECK(settled({.intersector = "moller_trumbore", .box = "auto"}).box == "fast");
  CHECK(settled({.structure = "bvh8", .traversal = "auto"}).traversal == "auto");
  CHECK(settled({.structure = "grid", .traversal = "auto"}).traversal == "auto");
  CHECK(settled({.structure = "brute_force", .traversal = "auto"}).traversal == "single");
  CHECK(settled({.structure = "bvh8", .traversal = ""}).traversal == "auto");
  CHECK(settled({.structure = "brute_force", .traversal = ""}).traversal == "single");
  for (Isa isa : available_isas()) {
    const std::string width = std::to_string(native_width(isa)), name(to_string(isa));
    CHECK(settled({.traversal = "packet", .isa = name}).traversal == "packet" + width);
    CHECK(settled({.traversal = "hybrid", .isa = name}).traversal == "hybrid" + width);
  }
  if (is_available(Isa::avx2)) CHECK(settled({.isa = "avx"}).isa == "avx2");
}

namespace {

/// Every other lane, none, all, one and two of them: what is switched off misses whatever it holds, the others have the
/// answers that they have without a mask.
template <std::size_t N>
void check_masks(const Tracer& tracer, std::span<const Ray> rays) {
  const std::vector<Ray> invalid = invalid_rays();
  for (const std::uint64_t active : {0x5555555555555555u, 0xaaaaaaaaaaaaaaaau, std::uint64_t{0}, ~std::uint64_t{0},
                                     std::uint64_t{1}, std::uint64_t{1} << (N - 1)}) {
    for (std::size_t first = 0; first + N <= rays.size(); first += N) {
      std::array<Ray, N> packet;
      std::copy_n(rays.begin() + std::ptrdiff_t(first), N, packet.begin());
      const std::array<Hit, N> hits = tracer.closest_hit(packet);
      const std::array<std::uint8_t, N> occluded = tracer.any_hit(packet);
      for (const bool garbage : {false, true}) {
        std::array<Ray, N> given = packet;
        for (std::size_t i = 0; i < N; ++i)
          if (garbage && !(active >> i & 1)) given[i] = invalid[(first + i) % invalid.size()];
        const std::array<Hit, N> masked = tracer.closest_hit(given, active);
        const std::array<std::uint8_t, N> any = tracer.any_hit(given, active);
        for (std::size_t i = 0; i < N; ++i) {
          const bool on = (active >> i & 1) != 0;
          const Hit expected = on ? hits[i] : Hit{};
          REQUIRE(same_bits({&masked[i], 1}, {&expected, 1}));
          REQUIRE(any[i] == (on ? occluded[i] : 0));
        }
      }
    }
  }
}

}  // namespace

TEST_CASE("a packet with a mask: rays that are switched off are not traced") {
  const TriangleMesh mesh = sphere(12);
  const std::vector<Ray> rays = test_rays(mesh);
  for (const char* structure : {"bvh8", "kdtree", "grid"}) {
    for (const char* traversal : {"single", "auto", "hybrid"}) {
      TracerSettings settings = with(&TracerSettings::structure, structure);
      settings.traversal = traversal;
      INFO(structure << ", " << traversal);
      const Tracer tracer(mesh, settings);
      check_masks<1>(tracer, rays);
      check_masks<7>(tracer, rays);
      check_masks<8>(tracer, rays);
      check_masks<16>(tracer, rays);
      check_masks<64>(tracer, rays);
    }
  }
}

TEST_CASE("a packet goes by the way of its own number of rays, of the kind that was chosen") {
  const TriangleMesh mesh = sphere(8);
  const auto way = [&](const char* structure, const char* traversal, std::size_t rays) {
    TracerSettings settings = with(&TracerSettings::structure, structure);
    settings.traversal = traversal;
    return std::string(Tracer(mesh, settings).kernel_of_packet(rays).traversal);
  };
  for (const std::string rays : {"4", "8", "16"}) {
    CHECK(way("bvh8", "hybrid8", std::stoul(rays)) == "hybrid" + rays);
    CHECK(way("bvh8", "single", std::stoul(rays)) == "packet" + rays);
    CHECK(way("bvh8", "queued", std::stoul(rays)) == "packet" + rays);
  }
  CHECK(way("bvh8", "hybrid8", 7) == "hybrid8");
  CHECK(way("bvh8", "hybrid8", 64) == "hybrid8");
  CHECK(way("bvh8", "packet8", 64) == "packet64");
  CHECK(way("bvh8", "stream", 7) == "stream");
  CHECK(way("grid", "single", 8) == "packet8");
  CHECK(way("brute_force", "single", 8) == "single");
}

TEST_CASE("settings of a batch have the command line's limits") {
  const auto message = [](const char* traversal, TraversalSettings settings) -> std::string {
    const Tracer tracer(sphere(4), with(&TracerSettings::traversal, traversal));
    const std::vector<Ray> rays(3);
    std::vector<Hit> hits(3);
    std::vector<std::uint8_t> occluded(3);
    RayBatch batch(rays);
    batch.settings = settings;
    const std::string closest = error_of([&] { tracer.closest_hit(batch, hits); });
    CHECK(closest == error_of([&] { tracer.any_hit(batch, occluded); }));
    return closest;
  };
  for (const unsigned rays : {0u, 65u, 100000u}) {
    CHECK(message("queued", {.rays_in_flight = rays}) ==
          "rays_in_flight: " + std::to_string(rays) + " is not within 1 .. 64");
    CHECK(message("single", {.rays_in_flight = rays}) != "");  // whether or not the way reads it
  }
  CHECK(message("hybrid16", {.hybrid_threshold = 1000}) == "hybrid_threshold: 1000 is not within 0 .. 16");
  CHECK(message("hybrid4", {.hybrid_threshold = 5}) == "hybrid4 has packets of 4 rays: no threshold of 5");
  for (const unsigned rays : {1u, 64u, TraversalSettings::kOwn})
    CHECK(message("queued", {.rays_in_flight = rays}) == "");
  for (const unsigned threshold : {0u, 4u, TraversalSettings::kOwn})
    CHECK(message("hybrid4", {.hybrid_threshold = threshold}) == "");
  CHECK(message("hybrid16", {.hybrid_threshold = 16}) == "");
}

TEST_CASE("a tracer moves with its mesh") {
  TracerSettings settings;
  settings.leaf = "triangle4i";  // reads the mesh's vertices while it traces
  Tracer first(sphere(8), settings);
  const Ray ray{{0.1f, 0.2f, -3}, 0, {0, 0, 1}, kInfinity};
  const Hit before = first.closest_hit(ray);
  CHECK(before.is_hit());
  Tracer second(std::move(first));
  first = Tracer(sphere(3));
  const Hit after = second.closest_hit(ray);
  CHECK(same_bits({&before, 1}, {&after, 1}));
  CHECK(second.mesh().size() == sphere(8).size());
}

TEST_CASE("a saved tracer answers as the one that was built, and a file says what it does not hold") {
  const Folder folder;
  const fs::path file = folder / "sphere.arbotree";
  TracerSettings settings;
  settings.builder = "spatial_sah", settings.leaf = "triangle4v";
  const Tracer built(sphere(40), settings);
  built.save(file);
  const Tracer loaded = Tracer::load(sphere(40), file, settings);
  const std::vector<Ray> rays = test_rays(built.mesh());
  const std::vector<Hit> hits = check_three_ways(built, rays);
  CHECK(same_bits(check_three_ways(loaded, rays), hits));
  CHECK(loaded.structure().bytes() == built.structure().bytes());
  CHECK(loaded.report().phases.empty());
  CHECK(loaded.settings().isa == built.settings().isa);

  const auto refused = [&](TriangleMesh mesh, const TracerSettings& other) {
    return error_of([&] { (void)Tracer::load(std::move(mesh), file, other); });
  };
  CHECK_THAT(refused(sphere(41), settings), Catch::Contains("another mesh"));
  CHECK_THAT(refused(sphere(40), {}), Catch::Contains("holds builder 'spatial_sah', not 'binned_sah'"));
  TracerSettings otherwise = settings;
  otherwise.parameters.bins = 8, otherwise.parameters.spatial_gain = 0.5f, otherwise.parameters.max_depth = 9;
  CHECK_THAT(refused(sphere(40), otherwise),
             Catch::EndsWith("holds other parameters (bins 32, here 8; spatial_gain 0.8, here 0.5); ask for what it "
                             "holds, or build anew"));
  TracerSettings beyond = settings;
  beyond.parameters.bins = 1000;
  CHECK_THAT(refused(sphere(40), beyond), Catch::Contains("bins: 1000 is not within 4 .. 64"));
  CHECK_THAT(error_of([&] { built.save(""); }), Catch::StartsWith("a path without a name: cannot be written"));
  CHECK_THAT(error_of([&] { built.save(folder / "none" / "sphere.arbotree"); }), Catch::Contains("cannot be written"));
}

TEST_CASE("a refitted tracer answers as one built over the moved mesh, and refuses what it cannot do as it was") {
  const TriangleMesh mesh = sphere(40);
  TriangleMesh moved = mesh;
  for (Vec3f& v : moved.vertices) v = {1.5f * v.x + 0.3f * v.y, v.y, v.z * (1.0f + 0.2f * v.x)};
  const std::vector<Ray> rays = test_rays(moved);
  Tracer tracer(mesh);
  tracer.refit(moved);
  const std::vector<Hit> hits = check_three_ways(tracer, rays);
  CHECK(same_bits(hits, check_three_ways(Tracer(moved), rays)));
  CHECK(tracer.mesh().vertices == moved.vertices);

  CHECK_THAT(error_of([&] { tracer.refit(sphere(41)); }), Catch::Contains("cannot be refitted to"));
  TriangleMesh moving = mesh;
  moving.later_frames.push_back(moved.vertices);
  CHECK_THAT(error_of([&] { tracer.refit(moving); }), Catch::Contains("holds one moment"));
  TriangleMesh infinite = mesh;
  infinite.vertices[0].y = kInfinity;
  CHECK_THAT(error_of([&] { tracer.refit(infinite); }), Catch::Contains("is not finite"));
  TriangleMesh placed = mesh;  // instances whose flat mesh names a vertex that there is not
  placed.instancing = std::make_shared<Instancing>(Instancing{{mesh}, {Instance{}}});
  placed.triangles[5].b = 1u << 30;
  CHECK_THAT(error_of([&] { tracer.refit(placed); }), Catch::Contains("names vertex 1073741824"));
  CHECK(same_bits(hits, check_three_ways(tracer, rays)));
  Tracer grid(mesh, with(&TracerSettings::structure, "grid"));
  CHECK(error_of([&] { grid.refit(moved); }) == "grid cannot be refitted; build it anew");
}

TEST_CASE("an empty mesh is missed, an empty batch is nothing") {
  const Tracer tracer(TriangleMesh{});
  CHECK_FALSE(tracer.closest_hit({{0, 0, -3}, 0, {0, 0, 1}, kInfinity}).is_hit());
  CHECK_FALSE(tracer.any_hit(Ray{{0, 0, -3}, 0, {0, 0, 1}, kInfinity}));
  tracer.closest_hit(RayBatch{}, {});
}

TEST_CASE("make_mesh takes flat arrays and vectors of points alike") {
  const float xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::uint32_t abc[] = {0, 1, 2};
  const TriangleMesh flat = make_mesh(std::span(xyz), std::span(abc));
  const TriangleMesh points =
      make_mesh(std::span<const Vec3f>(flat.vertices), std::span<const Triangle>(flat.triangles));
  CHECK(flat.vertices == points.vertices);
  CHECK(flat.triangles == points.triangles);
  CHECK(flat.triangles.front() == Triangle{0, 1, 2});
  CHECK_THROWS_AS(make_mesh(std::span(xyz).first(8), std::span(abc)), UserError);
  CHECK_THROWS_AS(make_mesh(std::span(xyz), std::span(abc).first(2)), UserError);
}

TEST_CASE("more threads than there are do no harm") {
  TracerSettings settings;
  settings.threads = 100000;
  const Tracer many(sphere(100), settings), one(sphere(100), with(&TracerSettings::isa, "scalar"));
  const Ray ray{{0, 0, -5}, 0, {0, 0, 1}, kInfinity};
  const Hit hit = many.closest_hit(ray);
  CHECK(hit.is_hit());
  CHECK(hit.primitive == one.closest_hit(ray).primitive);
}

TEST_CASE("builds at once report no less memory than the structure takes, and none that there is not") {
  const TriangleMesh small = sphere(12), large = sphere(40);
  const auto build_many = [](const TriangleMesh& mesh) {
    TracerSettings settings;
    settings.threads = 1;
    bool holds = true;
    for (int i = 0; i < 150; ++i) {
      const Tracer tracer(mesh, settings);
      const std::size_t peak = tracer.report().peak_bytes;
      holds = holds && peak >= tracer.structure().bytes() && peak < std::size_t{1} << 30;
    }
    return holds;
  };
  std::future<bool> other = std::async(std::launch::async, build_many, std::cref(small));
  CHECK(build_many(large));
  CHECK(other.get());
}

TEST_CASE("misuse is told in one line that names the mend") {
  struct Case {
    TracerSettings settings;
    const char* says;
  };
  TracerSettings unreadable = with(&TracerSettings::leaf, "triangle4");
  const Case cases[] = {
      {with(&TracerSettings::structure, "bhv8"), "did you mean 'bvh8'"},
      {with(&TracerSettings::builder, "binned_sha"), "did you mean 'binned_sah'"},
      {with(&TracerSettings::leaf, "triangel4v"), "did you mean 'triangle4v'"},
      {with(&TracerSettings::intersector, "watretight"), "did you mean 'watertight'"},
      {with(&TracerSettings::box, "paded"), "did you mean 'padded'"},
      {with(&TracerSettings::traversal, "singel"), "did you mean 'single'"},
      {with(&TracerSettings::isa, "avx3"), "unknown isa 'avx3'"},
      {unreadable, "watertight cannot read leaf triangle4 in bvh8: use"},
  };
  for (const Case& c : cases) {
    INFO(c.says);
    CHECK_THAT(message_of(c.settings), Catch::Contains(c.says));
  }

  TriangleMesh beyond = sphere(4);
  beyond.triangles[3].b = 4000;
  CHECK_THAT(message_of({}, beyond), Catch::Contains("triangle 3 names vertex 4000 of"));
  TriangleMesh infinite = sphere(4);
  infinite.vertices[0].y = kInfinity;
  CHECK_THAT(message_of({}, infinite), Catch::Contains("vertex 0 is not finite"));
  infinite.vertices[0].y = 3e12f;
  CHECK_THAT(message_of({}, infinite), Catch::Contains("beyond 2^40"));

  TriangleMesh moving = sphere(4);
  moving.later_frames.push_back(moving.vertices);
  CHECK(message_of(with(&TracerSettings::structure, "bvh4_motion"), moving).empty());
  moving.later_frames[0][0].z = kInfinity;
  CHECK_THAT(message_of({}, moving), Catch::Contains("of key frame 1 is not finite"));
  moving.later_frames[0].resize(1);
  CHECK_THAT(message_of({}, moving), Catch::Contains("key frame 1 has 1 vertices, the first"));

  const auto placed = [](const Instancing& instancing) {
    TriangleMesh mesh = sphere(4);
    mesh.instancing = std::make_shared<const Instancing>(instancing);
    return message_of(with(&TracerSettings::structure, "two_level"), mesh);
  };
  Instancing one;
  one.prototypes = {sphere(4)}, one.instances = {{}};
  CHECK(placed(one).empty());
  Instancing wrong = one;
  wrong.instances[0].prototype = 1;
  CHECK_THAT(placed(wrong), Catch::Contains("instance 0 names prototype 1 of 1"));
  wrong = one, wrong.prototypes[0].triangles[2].c = 4000;
  CHECK_THAT(placed(wrong), Catch::Contains("prototype 0: triangle 2 names vertex 4000 of"));
  wrong = one, wrong.instances.push_back({});
  CHECK_THAT(placed(wrong), Catch::Contains("instance 1 begins at triangle 0"));
  wrong = one, wrong.instances.clear();
  CHECK_THAT(placed(wrong), Catch::Contains("the instances have 0 triangles"));
  wrong = one, wrong.instances[0].to_world.m[0][0] = 0.0;
  CHECK_THAT(placed(wrong), Catch::Contains("determinant"));
  for (const double x : {double(kInfinity), -double(kInfinity), std::numeric_limits<double>::quiet_NaN()}) {
    wrong = one, wrong.instances[0].to_world.m[1][3] = x;
    CHECK_THAT(placed(wrong), Catch::Contains("instance 0 has a map with a number that is not finite"));
  }
  for (const double shift : {1e-3, 100.0, 1e300}) {
    wrong = one, wrong.instances[0].to_world.m[2][3] = shift;
    CHECK_THAT(placed(wrong), Catch::Contains("instance 0 does not lie where its map puts it: triangle 0"));
  }
  wrong = one, wrong.prototypes[0].vertices.back().x += 0.01f;
  CHECK_THAT(placed(wrong), Catch::Contains("does not lie where its map puts it"));

  // Of a build: whether or not the structure reads it, and what `auto` chooses
  const auto tuned = [](const char* structure, const auto& set) {
    TracerSettings settings = with(&TracerSettings::structure, structure);
    set(settings.parameters);
    return message_of(settings);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float cost : {0.0f, -1.0f, nan, kInfinity, 1e-30f}) {
    CHECK_THAT(tuned("bvh8", [=](BuilderParameters& p) { p.traversal_cost = cost; }),
               Catch::Contains("is not within 0.001 .. 1000"));
    CHECK_THAT(tuned("kdtree", [=](BuilderParameters& p) { p.intersection_cost = cost; }),
               Catch::Contains("intersection_cost: "));
  }
  CHECK_THAT(tuned("bvh8", [=](BuilderParameters& p) { p.spatial_overlap = nan; }),
             Catch::Contains("spatial_overlap: nan is not within 0 .. 1"));
  CHECK_THAT(tuned("bvh8", [](BuilderParameters& p) { p.spatial_gain = 0; }), Catch::Contains("spatial_gain: 0 is"));
  CHECK_THAT(tuned("kdtree", [](BuilderParameters& p) { p.max_leaf_blocks = 9; }),
             Catch::Contains("max_leaf_blocks: 9 is not within 1 .. 8"));
  CHECK_THAT(tuned("grid", [](BuilderParameters& p) { p.morton_bits = 31; }), Catch::Contains("neither 30 nor 63"));
  CHECK(tuned("bvh8", [](BuilderParameters& p) { p.spatial_gain = 0.01f, p.grid_density = 0.01f; }).empty());
  CHECK(tuned("two_level", [](BuilderParameters& p) { p.below = "grid"; }).empty());
  TracerSettings over_grid = with(&TracerSettings::structure, "two_level");
  over_grid.parameters.below = "grid";
  CHECK(Tracer(sphere(4), over_grid).settings().traversal == "single");
  over_grid.traversal = "packet8";
  CHECK(Tracer(sphere(4), over_grid).settings().traversal == "packet8");
  over_grid.parameters.below = "brute_force";
  CHECK_THAT(message_of(over_grid), Catch::Contains("two_level over brute_force: brute_force has no packet8"));

  // What stands below, whether or not the structure takes one
  const auto below = [&](const char* structure, const char* name) {
    return tuned(structure, [=](BuilderParameters& p) { p.below = name; });
  };
  for (const char* structure : {"bvh8", "two_level"}) {
    CHECK_THAT(below(structure, "xx"),
               Catch::StartsWith("below: unknown structure 'xx' (valid: ") && !Catch::Contains("two_level"));
    CHECK_THAT(below(structure, "bvh88"), Catch::Contains("did you mean 'bvh8'?"));
    for (const char* name : {"", "auto"}) CHECK(below(structure, name).empty());
  }
  TracerSettings over_auto = with(&TracerSettings::structure, "two_level");
  over_auto.parameters.below = "auto";
  CHECK(Tracer(sphere(4), over_auto).settings().parameters.below == "bvh8");
  for (const StructureEntry& entry : all_structures()) {
    const std::string why = why_not_below(entry.info);
    if (why.empty()) continue;
    const std::string name(entry.info.name);
    CHECK(below("two_level", name.c_str()) == "two_level over " + name + ": " + why);
    CHECK(below("bvh8", name.c_str()).empty());
  }

  if (find_structure("embree")) {
    CHECK_THAT(message_of(with(&TracerSettings::structure, "embree")),
               Catch::Contains("embree has no watertight kernels for single: it has") &&
                   Catch::Contains("; intersector auto takes pluecker"));
    TracerSettings embree = with(&TracerSettings::structure, "embree");
    embree.intersector = "auto";
    CHECK(message_of(embree).empty());
  }

  const std::string line = message_of(with(&TracerSettings::structure, "bvh8\n\x1b[2J" + std::string(100000, 'x')));
  CHECK_THAT(line, Catch::Contains("unknown structure 'bvh8\\n\\x1b[2Jxxx") && Catch::Contains("(100009 characters)"));
  CHECK(line.size() < 2000);

  const Tracer tracer(sphere(4));
  const std::vector<Ray> rays(3);
  std::vector<Hit> hits(2);
  CHECK_THROWS_WITH(tracer.closest_hit(rays, hits), "a batch of 3 rays with room for 2 answers");
  hits.resize(3);
  const float times[] = {0.0f, 0.5f};
  CHECK_THROWS_WITH(tracer.closest_hit(RayBatch(rays, times), hits), "a batch of 3 rays with 2 times");
}
