// Settings of the ways of traversal, from the configuration to the kernel: answers that no setting changes, settings
// that do what they say; and what auto chooses.
#include <filesystem>
#include <fstream>
#include <set>

#include "experiments/config.h"
#include "experiments/effective.h"
#include "experiments/parameters.h"
#include "experiments/plan.h"
#include "experiments/result.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/folder.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Rows of `traversals` with padded boxes and the two usual intersectors, on each ISA of this machine, once a kernel.
std::vector<KernelRow> rows_of(std::string_view prefix) {
  std::vector<KernelRow> rows;
  for (const KernelRow& row : runnable_rows())
    if (row.box == "padded" && row.traversal.starts_with(prefix) && row.structure != "embree") rows.push_back(row);
  return rows;
}

/// Coherent rays, incoherent ones and some invalid ones.
std::vector<Ray> mixed_rays(const TriangleMesh& mesh) {
  const Vec3f centre = mesh.bounds().center();
  std::vector<Ray> rays = aimed_rays(mesh, centre + mesh.bounds().extent() * 2.0f, 40, 61);
  const std::vector<Ray> generic = generic_rays(mesh, 30, 62);
  rays.insert(rays.end(), generic.begin(), generic.end());
  std::size_t place = 3;
  for (const Ray& ray : invalid_rays())
    rays.insert(rays.begin() + std::ptrdiff_t(place % rays.size()), ray), place += 9;
  return rays;
}

}  // namespace

TEST_CASE("no threshold of a hybrid and no number of rays in flight changes a bit of an answer") {
  const TriangleMesh mesh = random_triangles(400, 0.2f, 3);
  const std::vector<Ray> rays = mixed_rays(mesh);
  Structures structures(mesh);
  std::size_t compared = 0;
  const auto compare = [&](const KernelRow& row, TraversalSettings settings, std::size_t size,
                           std::span<const Hit> alone, std::span<const std::uint8_t> occluded) {
    INFO(name_of(row) << ", threshold " << int(settings.hybrid_threshold) << ", in flight "
                      << int(settings.rays_in_flight) << ", batch of " << size);
    const std::span<const Ray> batch = std::span(rays).first(size);
    REQUIRE(same_bits(closest_hit(row, structures.get(row), batch, settings), alone.first(size)));
    REQUIRE(std::ranges::equal(any_hit(row, structures.get(row), batch, settings), occluded.first(size)));
    ++compared;
  };
  for (std::string_view way : {"hybrid", "queued"}) {
    for (const KernelRow& row : rows_of(way)) {
      if (way == "queued" && row.traversal != "queued") continue;
      if (way == "hybrid" && row.structure != "bvh8" && row.structure != "bvh4_aos" && row.structure != "bvh2" &&
          row.structure != "kdtree")
        continue;
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const std::vector<Hit> alone = closest_hit(*single, structures.get(row), rays);
      const std::vector<std::uint8_t> occluded = any_hit(*single, structures.get(row), rays);
      if (way == "hybrid") {
        const unsigned width = rays_of(row);
        for (unsigned threshold = 0; threshold <= width; ++threshold)
          for (std::size_t size = 1; size <= 2 * width + 1; ++size)
            compare(row, {.hybrid_threshold = threshold}, size, alone, occluded);
      } else {
        for (unsigned flight : {1u, 2u, 3u, 7u, 33u, 64u})
          for (std::size_t size : {std::size_t(1), std::size_t(flight), 2 * std::size_t(flight) + 1, rays.size()})
            compare(row, {.rays_in_flight = flight}, std::min(size, rays.size()), alone, occluded);
      }
    }
  }
  CHECK(compared > 1000);
}

TEST_CASE("a hybrid's threshold and the rays in flight do what they say") {
  const TriangleMesh mesh = sphere(24);
  const std::vector<Ray> rays = generic_rays(mesh, 256, 9);
  Structures structures(mesh);
  for (const KernelRow& row : rows_of("hybrid")) {
    if (row.structure != "bvh8") continue;
    INFO(name_of(row));
    const unsigned width = rays_of(row);
    double last = -1;
    for (unsigned threshold = 0; threshold <= width; ++threshold) {
      INFO("threshold " << threshold);
      Counters c;
      (void)closest_hit(row, structures.get(row), rays, {.hybrid_threshold = threshold}, &c);
      CHECK(c.rays_alone <= c.switches * threshold);
      CHECK(c.packets == (rays.size() + width - 1) / width);
      CHECK(c.rays_in_packets == rays.size());
      if (threshold == 0) CHECK(c.switches == 0);
      if (threshold == width) CHECK(c.rays_alone == rays.size());  // each at the root, and once
      const double of_packets = c.depths.empty() ? 0 : double(c.depths[0].lanes_active) / double(c.depths[0].lanes);
      CHECK(of_packets > 0);
      const double mean = c.switches ? double(c.rays_alone) / double(c.switches) : 0;
      CHECK(mean >= last);  // the higher the threshold, the more rays go on alone at once
      last = mean;
    }
    Counters own, same;
    (void)closest_hit(row, structures.get(row), rays, {}, &own);
    (void)closest_hit(row, structures.get(row), rays, {.rays_in_flight = 5}, &same);
    CHECK(own.switches > 0);
    CHECK(own.switches == same.switches);
  }
  std::size_t queues = 0;
  for (const KernelRow& row : rows_of("queued")) {
    if (row.intersector != "moller_trumbore") continue;
    INFO(name_of(row));
    ++queues;
    const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
    Counters alone;
    (void)closest_hit(*single, structures.get(row), rays, {}, &alone);
    double last = 0;
    for (unsigned flight : {1u, 4u, 16u, 64u}) {
      Counters c;
      (void)closest_hit(row, structures.get(row), rays, {.rays_in_flight = flight}, &c);
      const bool set = row.traversal == "queued";
      const double most = set ? flight : rays_of(row);
      CHECK(c.nodes == alone.nodes);
      // An empty cell of the kd-tree is no leaf to the counters, but the queue passes none either. In the bounding
      // interval hierarchy a turn goes on to the ray's next leaf: one at first, and one after each leaf while something
      // waits.
      if (row.structure == "bih") {
        CHECK(c.nodes_queued > c.leaves);
        CHECK(c.nodes_queued <= c.leaves + rays.size());
        CHECK(c.nodes_queued < c.nodes);
      } else {
        CHECK(c.nodes_queued == c.nodes);
      }
      CHECK(c.leaves_queued == c.leaves);
      const double mean = double(c.nodes_queued) / double(c.queue_rounds);
      CHECK(mean <= most);
      CHECK(double(c.leaves_queued) / double(c.queue_rounds) <= most);
      if (set) CHECK(mean > last);
      last = set ? mean : 0;
    }
  }
  CHECK(queues >= 5);
  std::set<std::string_view> of;
  for (const KernelRow& row : rows_of("queued")) of.insert(row.structure);
  for (std::string_view structure :
       {"bvh2", "bvh4", "bvh8", "bvh16", "bvh4_aos", "bvh4_quantised", "bvh8_quantised", "kdtree", "bih", "octree"}) {
    INFO(structure);
    if (tested_isa() != Isa::scalar || structure == "bvh8") CHECK(of.contains(structure));
  }
}

TEST_CASE("rays that are not valid do not count in what auto sees of a batch") {
  // So coarse that packets hold together, also where half their rays are missing: what is sampled decides alone.
  const TriangleMesh mesh = sphere(4);
  // A camera's rays, tile by tile, then as many that share nothing.
  std::vector<Ray> together, apart = generic_rays(mesh, 128 * 128, 8);
  for (unsigned tile = 0; tile < 256; ++tile) {
    for (unsigned i = 0; i < 64; ++i) {
      const float x = float(tile % 16 * 8 + i % 8) / 64 - 1, y = float(tile / 16 * 8 + i / 8) / 64 - 1;
      together.push_back({{0, 0, 4}, 0, {0.3f * x, 0.3f * y, -1}, kInfinity});
    }
  }
  std::vector<Ray> both = together;
  both.insert(both.end(), apart.begin(), apart.end());
  const std::vector<Ray> invalid = invalid_rays();
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : rows_of("auto")) {
    if (row.isa == Isa::scalar || row.intersector != "moller_trumbore") continue;
    INFO(name_of(row));
    const Accel& accel = structures.get(row);
    const auto share = [&](std::span<const Ray> rays, bool any) {
      Counters counters;
      if (any) {
        (void)any_hit(row, accel, rays, {}, &counters);
      } else {
        (void)closest_hit(row, accel, rays, {}, &counters);
      }
      return double(counters.rays_in_packets) / double(rays.size());
    };
    for (const bool any : {false, true}) {
      CHECK(share(together, any) == 1.0);
      CHECK(share(both, any) < 0.75);
      for (const std::vector<Ray>* rays : {&together, &both}) {
        const double of_valid = share(*rays, any);
        // Percent at random places; 1: at one place of each 64, that of the first ray of a sample. Of every kind; 0:
        // Ray{} alone.
        for (const unsigned percent : {1u, 12u, 50u}) {
          for (const bool every_kind : {false, true}) {
            std::vector<Ray> some = *rays;
            for (std::size_t i = 0; i < some.size(); ++i)
              if (percent == 1 ? i % 64 == 0 : random_bits(21, i, 0) % 100 < percent)
                some[i] = every_kind ? invalid[random_bits(21, i, 1) % invalid.size()] : Ray{};
            INFO(percent << " %, of every kind: " << every_kind << ", any hit: " << any
                         << ", with others: " << (rays == &both));
            CHECK(share(some, any) == Approx(of_valid).margin(0.01));
          }
        }
      }
      // Tiles of such rays alone go as those beside them do.
      std::vector<Ray> gaps = apart;
      for (std::size_t i = 0; i < gaps.size(); ++i)
        if (i / 512 % 2 == 0) gaps[i] = Ray{};
      CHECK(share(gaps, any) == share(apart, any));
    }
    ++seen;
  }
  CHECK(seen >= 9);
}

TEST_CASE("auto tries packets with rays that start near each other, and leaves them where they fall apart") {
  const TriangleMesh fine = random_triangles(60'000, 0.01f, 5), coarse = random_triangles(40, 0.5f, 6);
  for (const TriangleMesh* mesh : {&fine, &coarse}) {
    Structures structures(*mesh);
    // Each at a place of its own; 64 at a time at one place among the triangles, in all directions.
    const std::vector<Ray> anywhere = generic_rays(*mesh, 20'001, 7);
    std::vector<Ray> near;
    for (std::size_t i = 0; i < anywhere.size(); ++i) {
      const Ray& place = anywhere[i / 64];
      near.push_back({place.origin + place.direction, 0.0f, anywhere[i].direction, kInfinity});
    }
    for (std::string_view structure : {"kdtree", "octree", "bih", "grid"}) {
      for (const Isa isa : {Isa::scalar, Isa::sse}) {
        const KernelRow* row = find_kernel(structure, "triangle4", "moller_trumbore", "padded", "auto", isa);
        if (!row) continue;
        const KernelRow& single = *find_kernel(structure, "triangle4", "moller_trumbore", "padded", "single", isa);
        INFO(name_of(*row) << ", " << mesh->size() << " triangles");
        const Accel& accel = structures.get(*row);
        const auto counted = [&](std::span<const Ray> rays) {
          Counters counters;
          CHECK(same_bits(closest_hit(*row, accel, rays, {}, &counters), closest_hit(single, accel, rays, {})));
          CHECK(same_bits(closest_hit(*row, accel, rays, {}), closest_hit(single, accel, rays, {})));
          CHECK(counters.rays == rays.size());
          return counters;
        };
        const bool has_near = structure != "grid", in_flight = isa == Isa::sse && structure != "bih" && has_near;
        const Counters apart = counted(anywhere), together = counted(near);
        CHECK(apart.rays_in_packets == 0);
        CHECK(apart.rays_in_flight == (in_flight ? anywhere.size() : 0));
        if (!has_near) {
          CHECK(together.rays_in_packets == 0);
        } else if (structure == "kdtree" && in_flight && mesh == &fine) {
          CHECK(together.rays_in_packets > 0);
          CHECK(together.rays_in_packets < near.size() / 2);
          CHECK(together.rays_in_flight > near.size() / 2);
        } else {
          CHECK(together.rays_in_packets > near.size() - 64);
        }
      }
    }
  }
}

TEST_CASE("auto on SSE leaves streams for rays in flight where rays share little, and only there") {
  if (!is_available(Isa::sse)) return;
  const TriangleMesh fine = random_triangles(60'000, 0.01f, 5), coarse = random_triangles(40, 0.5f, 6);
  for (const TriangleMesh* mesh : {&fine, &coarse}) {
    Structures structures(*mesh);
    // More than are taken the one way or the other before it is asked again, and no whole number of these.
    const std::vector<Ray> rays = generic_rays(*mesh, 45'001, 7);
    for (std::string_view structure : {"bvh4", "bvh8", "bvh16"}) {
      const auto row = [&](std::string_view traversal) {
        return *find_kernel(structure, "triangle4", "moller_trumbore", "padded", traversal, Isa::sse);
      };
      const Accel& accel = structures.get(row("auto"));
      INFO(structure << ", " << mesh->size() << " triangles");
      Counters closest, any;
      const std::vector<Hit> hits = closest_hit(row("auto"), accel, rays, {}, &closest);
      const std::vector<std::uint8_t> occluded = any_hit(row("auto"), accel, rays, {}, &any);
      CHECK(closest.rays == rays.size());
      CHECK(any.rays == rays.size());
      const bool in_flight = mesh == &fine && structure != "bvh16";
      CHECK((closest.queue_rounds > 0) == in_flight);
      CHECK((any.queue_rounds > 0) == in_flight);
      const std::vector<Hit> alone = closest_hit(row("single"), accel, rays, {});
      CHECK(std::memcmp(hits.data(), alone.data(), hits.size() * sizeof(Hit)) == 0);
      CHECK(occluded == any_hit(row("single"), accel, rays, {}));
      CHECK(std::memcmp(closest_hit(row("auto"), accel, rays, {}).data(), alone.data(), hits.size() * sizeof(Hit)) ==
            0);
      CHECK(any_hit(row("auto"), accel, rays, {}) == occluded);
    }
  }
}

TEST_CASE("settings of a way of traversal name those that read them") {
  std::set<std::string_view> ways;
  for (const KernelRow& row : kernel_table()) ways.insert(row.traversal);
  for (std::string_view way : ways) {
    INFO(way);
    CHECK(concerns("hybrid_threshold", way) == way.starts_with("hybrid"));
    CHECK(concerns("rays_in_flight", way) == (way == "queued"));
    CHECK_FALSE(concerns("bins", way));
  }
  for (const std::string& name : parameter_names())
    for (std::string_view way : traversals_reading(name)) {
      INFO(name << " names " << way);
      CHECK(ways.contains(way));
    }
}

TEST_CASE(
    "settings of a way of traversal: in the plan, in the cell's name and in effective.yaml where they mean something, "
    "refused elsewhere") {
  const Folder folder;
  const fs::path file = folder / "modes.yaml";
  const Registry registry = this_registry();
  const auto experiment = [&](const std::string& axes, const std::string& parameters) {
    std::ofstream(file) << "scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [bvh8, kdtree], "
                           "intersector: [moller_trumbore], isa: ["
                        << to_string(tested_isa()) << "], " << axes << "}\nparameters: {" << parameters
                        << "}\nmetrics: [trace]\n";
    return read_experiment(file, registry);
  };
  const auto message = [&](const std::string& axes, const std::string& parameters) {
    return error_of([&] { (void)make_plan(experiment(axes, parameters), registry); });
  };

  const Experiment swept =
      experiment("traversal: [single, hybrid8, queued, queued8]", "hybrid_threshold: [auto, 0, 3], rays_in_flight: 24");
  const Plan plan = make_plan(swept, registry);
  std::vector<std::string> ways;
  for (const Cell& cell : plan.cells) {
    if (cell.structure != "bvh8") continue;
    ways.push_back(cell.traversal_name());
    const bool hybrid = cell.traversal == "hybrid8", queued = cell.traversal == "queued";
    CHECK((cell.settings.rays_in_flight == 24) == queued);
    if (!hybrid) CHECK(cell.settings.hybrid_threshold == TraversalSettings::kOwn);
    Json axes;
    add_axes(axes, cell);
    CHECK(axes["traversal"] == ways.back());
    CHECK(cell.name().find("/" + ways.back() + "/") != std::string::npos);
  }
  std::ranges::sort(ways);
  CHECK(ways == std::vector<std::string>{"hybrid8:hybrid_threshold=0", "hybrid8:hybrid_threshold=3",
                                         "hybrid8:hybrid_threshold=auto", "queued", "queued8", "single"});
  CHECK(effective_yaml(swept).find("hybrid_threshold: [auto, 0, 3]") != std::string::npos);
  CHECK(effective_yaml(swept).find("rays_in_flight: [24]") != std::string::npos);
  CHECK(effective_yaml(experiment("traversal: [single]", "bins: 16")).find("hybrid_threshold: [auto]") !=
        std::string::npos);
  CHECK(configuration_hash(swept) !=
        configuration_hash(experiment("traversal: [single, hybrid8, queued, queued8]",
                                      "hybrid_threshold: [auto, 0, 3], rays_in_flight: 25")));

  CHECK(message("traversal: [hybrid8]", "hybrid_threshold: 17")
            .find(":3: hybrid_threshold must be auto or an integer from 0 to 16, not '17'") != std::string::npos);
  CHECK(message("traversal: [queued]", "rays_in_flight: 0")
            .find("rays_in_flight must be auto or an integer from 1 to 64") != std::string::npos);
  CHECK(message("traversal: [single]", "hybrid_threshold: 2")
            .find(":3: hybrid_threshold has no effect: no cell's traversal is hybrid4 or hybrid8 or hybrid16; add") !=
        std::string::npos);
  CHECK(message("traversal: [queued8]", "rays_in_flight: 2").find(":3: rays_in_flight has no effect") !=
        std::string::npos);
  CHECK(message("traversal: [queued8]", "hybrid_treshold: 2").find("did you mean 'hybrid_threshold'") !=
        std::string::npos);
  CHECK(message("traversal: [hybrid8]", "hybrid_threshold: 8").empty());
  const Plan wide = make_plan(experiment("traversal: [hybrid4]", "hybrid_threshold: [4, 5]"), registry);
  CHECK(std::ranges::any_of(wide.skipped, [](const SkippedCell& c) {
    return c.reason == "hybrid4 has packets of 4 rays: no threshold of 5";
  }));
}
