// What the counting pass says of single rays, packets, hybrids, streams and queues: counts of a tree small enough to
// know them by hand, and what must hold of any.
#include "experiments/result.h"
#include "structures/leaves/leaf_form.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

const KernelRow& kernel(std::string_view traversal) {
  const KernelRow* row = find_kernel("bvh2", "triangle1", "moller_trumbore", "padded", traversal, tested_isa());
  REQUIRE(row);
  return *row;
}

/// Four triangles across the x axis at x = 0, 1, 20, 21, two by two in the nodes of a binary tree: the root, two nodes,
/// four leaves. The first of each pair is half as high as the others, which reach from -1 to 1 in y and z.
struct SmallTree {
  TriangleMesh mesh;
  std::unique_ptr<Accel> accel;
  SmallTree() {
    for (const auto& [x, size] : {std::pair{0.0f, 0.5f}, {1.0f, 1.0f}, {20.0f, 0.5f}, {21.0f, 1.0f}}) {
      const auto first = std::uint32_t(mesh.vertices.size());
      mesh.vertices.insert(mesh.vertices.end(), {{x, -size, -size}, {x, size, -size}, {x, -size, size}});
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
    BuildSettings settings;
    settings.leaf = "triangle1", settings.isa = tested_isa(), settings.parameters.max_leaf_blocks = 1;
    BuildReport report;
    accel = build_structure("bvh2", mesh, settings, report);
  }
};
// Meets both nodes, then the first triangle
constexpr Ray kThroughAll{{-5, -0.25f, -0.25f}, 0, {1, 0, 0}, kInfinity};
constexpr Ray kPastAll{{-5, 0.4f, 0.4f}, 0, {1, 0, 0}, kInfinity};  // within all boxes, past all triangles
constexpr Ray kFarPair{{30, -0.75f, -0.75f}, 0, {-1, 0, 0}, 15};    // meets one node and in it one leaf
constexpr Ray kNothing{{-5, 3, 0}, 0, {1, 0, 0}, kInfinity};        // meets no box

std::vector<std::uint64_t> visits_of(const Counters& c) {
  std::vector<std::uint64_t> visits;
  for (const Counters::Depth& d : c.depths) visits.push_back(d.visits);
  return visits;
}

using Five = std::array<std::uint64_t, 5>;

}  // namespace

TEST_CASE("children hit a node visit, visits by depth: single rays of a tree known by hand") {
  const SmallTree tree;
  const KernelRow& row = kernel("single");
  struct Case {
    Ray ray;
    Five children;
    std::vector<std::uint64_t> visits;
    std::uint64_t leaves;
  };
  for (const Case& c : {Case{kThroughAll, {0, 0, 2, 0, 0}, {1, 1}, 1}, Case{kPastAll, {0, 0, 3, 0, 0}, {1, 2}, 4},
                        Case{kFarPair, {0, 2, 0, 0, 0}, {1, 1}, 1}, Case{kNothing, {1, 0, 0, 0, 0}, {1}, 0}}) {
    INFO("from " << c.ray.origin.x << ", " << c.ray.origin.y);
    Counters counters;
    (void)closest_hit(row, *tree.accel, std::span(&c.ray, 1), {}, &counters);
    CHECK(counters.children_hit == c.children);
    CHECK(visits_of(counters) == c.visits);
    CHECK(counters.leaves == c.leaves);
    for (const Counters::Depth& d : counters.depths) CHECK(d.lanes_active == 2 * d.visits);
    CHECK(counters.packets == 0);
  }
}

TEST_CASE("lanes by depth, switches and queue lengths: packets, hybrids and queues of a tree known by hand") {
  const SmallTree tree;
  // Three rays past all triangles, one that meets the far node alone, from the same side.
  const Ray far_node{{15, 0.4f, 0.4f}, 0, {1, 0, 0}, kInfinity};
  const std::vector<Ray> rays{kPastAll, kPastAll, kPastAll, far_node};
  Counters packet;
  (void)closest_hit(kernel("packet4"), *tree.accel, rays, {}, &packet);
  CHECK(packet.packets == 1);
  CHECK(packet.rays_in_packets == 4);
  CHECK(packet.switches == 0);
  CHECK(visits_of(packet) == std::vector<std::uint64_t>{1, 2});
  REQUIRE(packet.depths.size() == 2);
  CHECK(packet.depths[0].lanes == 2 * 4);  // two children, four lanes of rays each
  CHECK(packet.depths[0].lanes_active == 2 * 4);
  CHECK(packet.depths[1].lanes == 2 * 4 + 2 * 4);
  CHECK(packet.depths[1].lanes_active == 2 * 3 + 2 * 4);  // three in the near node, four in the far one
  CHECK(packet.nodes == 4 + 3 + 4);
  CHECK(packet.nodes_shared == packet.nodes - 3);
  CHECK(packet.boxes == 2 * packet.nodes);
  CHECK(packet.interval_tests == 3 * 2);
  CHECK(packet.leaves == 2 * 3 + 2 * 4);
  CHECK(packet.leaves_shared == packet.leaves - 4);
  CHECK(packet.children_hit == Five{0, 1, 3 + 3 + 4, 0, 0});  // each ray's own children, not the packet's

  Counters hybrid;
  (void)closest_hit(kernel("hybrid4"), *tree.accel, rays, {.hybrid_threshold = 3}, &hybrid);
  CHECK(hybrid.switches == 1);  // in the near node; the far one has all four again
  CHECK(hybrid.rays_alone == 3);
  CHECK(visits_of(hybrid) == std::vector<std::uint64_t>{1, 3 + 1});
  // A ray alone: two children, in the four lanes of the least register.
  CHECK(hybrid.depths[1].lanes == 3 * 4 + 2 * 4);
  CHECK(hybrid.depths[1].lanes_active == 3 * 2 + 2 * 4);
  CHECK(hybrid.nodes == packet.nodes);
  CHECK(hybrid.children_hit == packet.children_hit);

  // Roots; near nodes, and in the same round the leaves that they lead to; the hits end all.
  const std::vector<Ray> through(4, kThroughAll);
  Counters queued;
  (void)closest_hit(kernel("queued"), *tree.accel, through, {.rays_in_flight = 4}, &queued);
  CHECK(queued.queue_rounds == 2);
  CHECK(queued.nodes_queued == 8);
  CHECK(queued.leaves_queued == 4);
  Counters two_by_two;
  (void)closest_hit(kernel("queued"), *tree.accel, through, {.rays_in_flight = 2}, &two_by_two);
  CHECK(two_by_two.queue_rounds == 4);
  CHECK(two_by_two.nodes_queued == 8);

  // Four tiles of rays of one direction, as many of rays in all directions, four of one again and one tile more of all:
  // `auto` takes those of one direction for packets, and changes for no single tile.
  std::vector<Ray> tiles;
  const auto add_tile = [&](bool coherent) {
    for (unsigned i = 0; i < 64; ++i)
      tiles.push_back(
          coherent
              ? kThroughAll
              : Ray{{-5, 0, 0}, 0, {i % 2 ? 1.0f : -1.0f, i % 4 < 2 ? 1.0f : -1.0f, i % 3 ? 1.0f : -1.0f}, kInfinity});
  };
  for (int tile = 0; tile < 13; ++tile) add_tile((tile < 4 || tile >= 8) && tile != 12);
  Counters chosen;
  (void)closest_hit(kernel("auto"), *tree.accel, tiles, {}, &chosen);
  CHECK(chosen.rays == 13 * 64);
  CHECK(chosen.rays_in_packets == 9 * 64);
  CHECK(chosen.rays_in_streams == (tested_isa() == Isa::scalar ? 0 : 4 * 64));
  CHECK(chosen.rays_in_flight == 0);
  Counters none_chosen;
  (void)closest_hit(kernel("auto"), *tree.accel, std::span(tiles).subspan(4 * 64, 4 * 64), {}, &none_chosen);
  CHECK(none_chosen.rays_in_packets == 0);

  Counters sum = packet;
  sum += hybrid, sum += queued;
  CHECK(visits_of(sum) == std::vector<std::uint64_t>{1 + 1 + 4, 2 + 4 + 4});
  CHECK(sum.rays_alone == 3);
  CHECK(sum.queue_rounds == 2);

  Json facts;
  add_facts(facts, packet, 4, "packet4");
  CHECK(facts["children_hit"] == Json({0.0, 1.0 / 11, 10.0 / 11, 0.0, 0.0}));
  CHECK(facts["lane_utilization_by_depth"] == Json({1.0, 7.0 / 8}));
  CHECK(facts["simd_utilization"] == (22.0 + 14) / (24 + 14));  // of boxes and of leaves of one triangle
  CHECK(facts["boxes_per_ray"] == 22.0 / 4);
  CHECK(facts["interval_tests_per_ray"] == 6.0 / 4);
  CHECK(facts["rays_per_node_visit"] == 11.0 / 3);
  CHECK(facts["rays_per_leaf_visit"] == 14.0 / 4);
  CHECK(facts["visits_by_depth"] == Json({0.25, 0.5}));
  CHECK(facts["switches_per_packet"] == 0.0);
  CHECK(facts["packet_share"] == 1.0);
  CHECK_FALSE(facts.contains("stream_share"));
  facts = Json();
  add_facts(facts, chosen, chosen.rays, "auto");
  CHECK(facts["packet_share"] == 9.0 / 13);
  CHECK(facts["stream_share"] == (tested_isa() == Isa::scalar ? 0 : 4.0 / 13));
  CHECK(facts["queued_share"] == 0.0);
  CHECK(facts["single_share"] == (tested_isa() == Isa::scalar ? 4.0 / 13 : 0));
  facts = Json();
  add_facts(facts, none_chosen, none_chosen.rays, "auto");
  CHECK(facts["packet_share"] == 0.0);
  facts = Json();
  add_facts(facts, queued, 4, "queued");
  CHECK(facts["node_queue_length"] == 4.0);
  CHECK(facts["leaf_queue_length"] == 2.0);
  CHECK_FALSE(facts.contains("packet_share"));
  CHECK_FALSE(facts.contains("rays_per_node_visit"));
  // Rays that leave their own surface out may be traced again: work counts by the ray, shares by what was traced.
  Counters again = packet;
  again += packet;
  facts = Json();
  add_facts(facts, again, 4, "packet4");
  CHECK(facts["packet_share"] == 1.0);
  CHECK(facts["nodes_per_ray"] == 2 * 11.0 / 4);
  Counters cells;  // of a grid, whose nodes have no children that a ray meets
  cells.rays = 4, cells.nodes = 10;
  facts = Json();
  add_facts(facts, cells, 4, "single");
  CHECK(facts["nodes_per_ray"] == 2.5);
  CHECK_FALSE(facts.contains("children_hit"));
}

namespace {

/// From the origin, one into each of the octants.
std::vector<Ray> into_octants(std::initializer_list<unsigned> octants) {
  std::vector<Ray> rays;
  for (const unsigned octant : octants) {
    const auto sign = [&](unsigned a) { return octant >> a & 1u ? -1.0f : 1.0f; };
    rays.push_back({{0, 0, 0}, 0, {sign(0), 0.7f * sign(1), 0.4f * sign(2)}, kInfinity});
  }
  return rays;
}

}  // namespace

TEST_CASE("a packet whose rays go two ways uses one lane a register, and says so") {
  const TriangleMesh mesh = sphere(24);
  const std::vector<Ray> rays = into_octants({1, 6});
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : runnable_rows()) {
    if (row.structure != "bvh8" || row.traversal != "packet8" || row.box != "padded") continue;
    INFO(name_of(row));
    const std::uint64_t width = std::min<std::uint64_t>(8, std::uint64_t(native_width(row.isa)));
    for (bool any : {false, true}) {
      const Counters c = counted(row, structures.get(row), rays, any);
      CHECK(c.depths[0].visits == 2);
      CHECK(c.nodes_shared == 0);
      std::uint64_t lanes = 0, active = 0;
      for (const Counters::Depth& d : c.depths) {
        CHECK(d.lanes == width * d.lanes_active);
        lanes += d.lanes, active += d.lanes_active;
      }
      CHECK(active == c.boxes);
      CHECK(active > 0);
      CHECK(c.lanes == lanes + c.blocks * find_leaf_form(row.leaf)->width);
      Json facts;
      add_facts(facts, c, rays.size(), row.traversal);
      CHECK(facts["simd_utilization"].get<double>() < 0.75);
    }
    ++seen;
  }
  CHECK(seen > 0);
}

TEST_CASE("a small packet whose rays go eight ways goes as one: the root is visited once, its lanes are full") {
  const TriangleMesh mesh = sphere(24);
  const std::vector<Ray> rays = into_octants({0, 1, 2, 3, 4, 5, 6, 7});
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : runnable_rows()) {
    if (row.structure != "bvh8" || row.box != "padded") continue;
    if (row.traversal != "packet8" && row.traversal != "hybrid16") continue;
    INFO(name_of(row));
    const std::uint64_t width = std::min<std::uint64_t>(8, std::uint64_t(native_width(row.isa)));
    for (bool any : {false, true}) {
      const Counters c = counted(row, structures.get(row), rays, any);
      CHECK(c.depths[0].visits == 1);
      if (row.traversal == "packet8" && width == 8) CHECK(c.depths[0].lanes == c.depths[0].lanes_active);
      CHECK(c.nodes_shared > 0);
      CHECK(c.interval_tests == 0);
    }
    ++seen;
  }
  CHECK(seen > 0);
}

TEST_CASE("what is tested in packets is counted, what the interval of all rays leaves out is not") {
  const TriangleMesh mesh = random_triangles(20000, 0.02f, 3);
  const Vec3f centre = mesh.bounds().center();
  const std::vector<Ray> rays = aimed_rays(mesh, centre + mesh.bounds().extent() * 2.0f, 1, 61);
  std::vector<Ray> fan;  // from one point, close to the first of them
  for (unsigned i = 0; i < 256; ++i) {
    Ray ray = rays[0];
    ray.direction = ray.direction + Vec3f{float(i % 16), float(i / 16), 0} * (2e-4f * length(ray.direction));
    fan.push_back(ray);
  }
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : runnable_rows()) {
    if (row.box != "padded" || row.traversal != "packet64") continue;
    INFO(name_of(row));
    const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
    Counters alone, packet;
    (void)closest_hit(*single, structures.get(row), fan, {}, &alone);
    (void)closest_hit(row, structures.get(row), fan, {}, &packet);
    CHECK(alone.interval_tests == 0);
    if (row.structure.starts_with("bvh") || row.structure == "kdtree") {
      CHECK(packet.interval_tests > 0);
      CHECK(packet.boxes < alone.boxes);
    }
    ++seen;
  }
  CHECK(seen >= 5);
}

TEST_CASE("rays that are the same share every visit of a packet and of a stream") {
  const TriangleMesh mesh = sphere(24);
  const std::vector<Ray> rays(64, generic_rays(mesh, 1, 9)[0]);
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : runnable_rows()) {
    const bool packets = row.traversal == "packet64", streams = row.traversal.starts_with("stream");
    if (row.box != "padded" || !(packets || streams) || row.structure == "embree") continue;
    INFO(name_of(row));
    const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
    for (bool any : {false, true}) {
      Counters c, alone;
      const Accel& accel = structures.get(row);
      if (any) {
        (void)any_hit(row, accel, rays, {}, &c), (void)any_hit(*single, accel, std::span(rays).first(1), {}, &alone);
      } else {
        (void)closest_hit(row, accel, rays, {}, &c);
        (void)closest_hit(*single, accel, std::span(rays).first(1), {}, &alone);
      }
      if (!c.depths.empty()) CHECK(c.depths[0].visits == 1);
      // Lists have one order of children for all, and may visit more; a grid's packets look at all cells of a slice,
      // those behind a hit, too.
      const bool more = row.traversal == "stream_lists" || row.structure == "grid";
      if (!any && !more) CHECK(c.nodes == 64 * alone.nodes);
      if (!any) CHECK((c.nodes >= 64 * alone.nodes && c.nodes < 2 * 64 * alone.nodes));
      CHECK(c.rays_in_streams == (streams ? 64 : 0));
      Json facts;
      add_facts(facts, c, rays.size(), row.traversal);
      CHECK(facts["rays_per_node_visit"] == 64.0);
      if (c.leaves > 0) CHECK(facts["rays_per_leaf_visit"] == 64.0);
    }
    ++seen;
  }
  CHECK(seen > 10);
}

TEST_CASE("an any hit counts the blocks of its last leaf up to the one that is hit") {
  // Four times the same triangle: no split pays, and each has a block of its own.
  TriangleMesh mesh;
  mesh.vertices = {{0, -1, -1}, {0, 1, -1}, {0, -1, 1}};
  mesh.triangles.assign(4, {0, 1, 2});
  const std::vector<Ray> rays(64, Ray{{-5, -0.25f, -0.25f}, 0, {1, 0.01f, 0.01f}, kInfinity});
  std::size_t seen = 0;
  std::map<std::string_view, std::unique_ptr<Accel>> built;
  for (const KernelRow& row : kernel_table()) {
    if (row.isa != tested_isa() || row.leaf != "triangle1" || row.intersector != "moller_trumbore" ||
        row.box != "padded" || !row.counts())
      continue;
    INFO(name_of(row));
    std::unique_ptr<Accel>& accel = built[row.structure];
    if (!accel) {
      BuildSettings settings;
      settings.builder = find_structure(row.structure)->info.builders.front();
      settings.leaf = row.leaf, settings.isa = row.isa, settings.parameters.max_leaf_blocks = 8;
      BuildReport report;
      accel = build_structure(row.structure, mesh, settings, report);
    }
    Counters closest, any;
    (void)closest_hit(row, *accel, rays, {}, &closest);
    for (const std::uint8_t occluded : any_hit(row, *accel, rays, {}, &any)) CHECK(occluded == 1);
    CHECK(any.leaves == rays.size());
    CHECK(any.blocks == rays.size());
    CHECK(any.triangles == rays.size());
    CHECK(closest.triangles == 4 * rays.size());
    ++seen;
  }
  CHECK(seen > 20);
}

TEST_CASE("streams and the kd-tree follow their depth too") {
  const TriangleMesh mesh = sphere(24);
  const std::vector<Ray> rays = generic_rays(mesh, 300, 9);
  Structures structures(mesh);
  std::size_t seen = 0;
  for (const KernelRow& row : runnable_rows()) {
    const bool tree = row.structure.starts_with("bvh") || row.structure == "kdtree";
    if (!tree || row.box != "padded" || row.intersector != "moller_trumbore") continue;
    INFO(name_of(row));
    const Accel& accel = structures.get(row);
    struct Deepest : StructureVisitor {
      std::vector<std::size_t> nodes;
      void node(const NodeView& n) override {
        if (nodes.size() <= n.depth) nodes.resize(n.depth + 1);
        ++nodes[n.depth];
      }
      void leaf(const LeafView&) override {}
    } shown;
    REQUIRE(accel.visit(shown));
    for (bool any : {false, true}) {
      const Counters c = counted(row, accel, rays, any);
      REQUIRE(!c.depths.empty());
      CHECK(c.depths.size() <= shown.nodes.size());
      CHECK(c.depths[0].visits <= rays.size());  // the root, once a ray at most
      std::uint64_t visits = 0, children = 0, lanes = 0, active = 0;
      for (std::size_t d = 0; d < c.depths.size(); ++d) {
        CHECK(c.depths[d].visits <= shown.nodes[d] * rays.size());
        CHECK(c.depths[d].visits > 0);
        CHECK(c.depths[d].lanes_active <= c.depths[d].lanes);
        visits += c.depths[d].visits, lanes += c.depths[d].lanes, active += c.depths[d].lanes_active;
      }
      for (std::uint64_t n : c.children_hit) children += n;
      CHECK(children == c.nodes);
      CHECK(visits == c.nodes - c.nodes_shared);
      CHECK(active == c.boxes);
      CHECK(c.lanes_active == c.boxes + c.triangles);
      const bool alone = row.traversal == "single" || row.traversal.starts_with("queued");
      if (alone) CHECK(c.nodes_shared + c.leaves_shared == 0);
      CHECK(c.lanes == lanes + c.blocks * find_leaf_form(row.leaf)->width);
    }
    ++seen;
  }
  CHECK(seen > 20);
}
