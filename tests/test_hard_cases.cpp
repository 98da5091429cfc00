// tests/hard_cases.json on every row of the kernel table: each gives the exact answer, or the case stands in
// the table of known limits with its reason.
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/catch.h"
#include "tests/hard_cases.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// What is wrong with an answer; empty when it is right: a hit where there is one, of a primitive at the
/// exact nearest t, and t within 2^-12 of it, or infinite where it rounds to infinity.
std::string fault(const HardCase& c, const Hit& hit) {
  if (c.hit != hit.is_hit()) return c.hit ? "missed" : "false_hit";
  if (!c.hit) return "";
  const bool infinite = std::isinf(hit.t) && hit.t == static_cast<float>(c.t);
  if (!infinite && !(std::abs(hit.t - c.t) <= 0x1p-12 * std::abs(c.t))) return "wrong_surface";
  return std::ranges::find(c.nearest_ids, hit.primitive) == c.nearest_ids.end() ? "wrong_primitive" : "";
}

/// Which arithmetic an entry is about: kernels with fused multiply-add (AVX2, AVX-512), without, or both.
enum class Arithmetic { any, fused, unfused };

/// Which fast boxes an entry is about: those that are flat around the case's triangles (loses_flat_boxes()), or any
/// that stands around a single triangle (loses_lone_boxes()).
enum class Boxes { none, flat, lone };

/// A case that a float kernel is known to get wrong, and why. Exact: a row that an entry names and that is
/// right fails the test, as does a row that is wrong and named by none.
struct KnownLimit {
  std::string_view id, intersector, fault;  ///< intersector: empty for every one
  Arithmetic arithmetic;
  std::string_view reason;
  Boxes boxes = Boxes::none;  ///< of the box test, not of the intersector
};

using enum Arithmetic;
constexpr std::string_view kFlatBox =
    "fast boxes: plane * r - o * r is fused, so a ray in a box's face is off by the rounding of o * r and "
    "can pass beside a flat box";
constexpr std::string_view kLoneBox =
    "fast boxes, coordinates or a direction's length beyond the range that promises are for; the tree's structures "
    "have "
    "no such box around a single triangle";
constexpr std::string_view kSharedEdge =
    "the two sides of an edge are decided by different sums, and the ray meets the edge";
constexpr std::string_view kBeyondRange = "coordinates beyond 2^40, which loaders drop: products of three overflow";
constexpr std::string_view kTooSmall = "products of three coordinates underflow, t is lost";
constexpr std::string_view kTNotRepresentable = "the exact t is beyond the largest float";

constexpr std::string_view kEqualT = "layers 2^-20 apart seen from 1000: equal t in float, the lowest id wins";

constexpr KnownLimit kKnownLimits[] = {
    {"A08", "", "missed", fused, kFlatBox, Boxes::flat},
    {"A10", "", "missed", fused, kFlatBox, Boxes::flat},
    {"C06", "", "missed", fused, kFlatBox, Boxes::flat},
    {"D04", "moller_trumbore", "missed", any, "an area of 2^-161 underflows: the determinant is 0"},
    {"D06", "pluecker", "false_hit", fused,
     "nearly collinear: the edge functions are rounding noise, here of one sign"},
    {"E01", "moller_trumbore", "missed", fused, kSharedEdge},
    {"E05", "moller_trumbore", "wrong_primitive", fused, "at the apex of a fan the neighbour is hit"},
    {"E05", "pluecker", "wrong_primitive", any, "at the apex of a fan the neighbour is hit"},
    {"E05", "baldwin_weber", "missed", any, kSharedEdge},
    {"E05", "havel_herout", "wrong_primitive", any, "at the apex of a fan the neighbour is hit"},
    {"E05", "wald_projection", "missed", any, kSharedEdge},
    {"E12", "baldwin_weber", "missed", any, kSharedEdge},
    {"E12", "wald_projection", "missed", any, kSharedEdge},
    {"E12", "moller_trumbore", "wrong_surface", fused,
     "ray in the common edge's plane, through sheer triangles: t is rounding noise"},
    {"E12", "pluecker", "wrong_surface", fused,
     "ray in the common edge's plane, through sheer triangles: t is rounding noise"},
    {"E14", "baldwin_weber", "missed", any, kSharedEdge},
    {"E14", "havel_herout", "missed", any, kSharedEdge},
    {"E14", "wald_projection", "missed", any, kSharedEdge},
    {"H01", "moller_trumbore", "wrong_surface", any, kBeyondRange},
    {"H01", "pluecker", "wrong_surface", any, kBeyondRange},
    {"H02", "moller_trumbore", "missed", any, kBeyondRange},
    {"H02", "pluecker", "missed", any, kBeyondRange},
    {"H04", "moller_trumbore", "missed", any, kBeyondRange},
    {"H04", "pluecker", "missed", any, kBeyondRange},
    {"H05", "moller_trumbore", "wrong_surface", any, kTooSmall},
    {"H06", "moller_trumbore", "wrong_surface", any, kTooSmall},
    {"H10", "moller_trumbore", "missed", any, kBeyondRange},
    {"H10", "pluecker", "missed", any, kBeyondRange},
    {"H13", "baldwin_weber", "missed", any, kTNotRepresentable},
    {"H13", "wald_projection", "missed", any, kTNotRepresentable},
    {"H10", "", "missed", fused, kLoneBox, Boxes::lone},
    {"H12", "", "missed", fused, kLoneBox, Boxes::lone},
    {"H13", "", "missed", fused, kLoneBox, Boxes::lone},
    {"M04", "moller_trumbore", "wrong_primitive", any, kEqualT},
    {"M04", "moller_trumbore_double", "wrong_primitive", any, kEqualT},
    {"M04", "pluecker", "wrong_primitive", any, kEqualT},
    {"M04", "pluecker_double", "wrong_primitive", any, kEqualT},
    {"M04", "watertight", "wrong_primitive", any, kEqualT},
    {"M04", "watertight_refined", "wrong_primitive", any, kEqualT},
    {"M04", "baldwin_weber", "wrong_primitive", any, kEqualT},
    {"M04", "havel_herout", "wrong_primitive", any, kEqualT},
    {"M04", "wald_projection", "wrong_primitive", any, kEqualT},
    {"S04", "watertight", "false_hit", unfused, "collinear vertices: the shear rounds them apart"},
    {"S04", "watertight_refined", "false_hit", unfused, "collinear vertices: the shear rounds them apart"},
    {"S05", "wald_projection", "missed", fused, "a needle: u and v round by more than it is wide"},
    {"S08", "pluecker", "false_hit", unfused,
     "needle seen edge on: the edge functions are rounding noise, here of one sign"},
};

/// Whether a row tests boxes that are flat around these cases' triangles, and tests them fast: BVHs where a leaf is one
/// triangle; whatever the leaf, the bounding intervals (they end where the triangle does, on one axis) and structures
/// that have a box even around all triangles of such a case. The kd-tree's fast planes are padded along axes on which a
/// ray does not move, and cells of grid and octree are wider than a flat triangle.
bool loses_flat_boxes(const KernelRow& row) {
  if (row.box != "fast" || row.structure == "brute_force") return false;
  if (row.structure == "kdtree" || row.structure == "grid" || row.structure == "octree") return false;
  if (row.structure == "bih" || find_structure(row.structure)->info.root_is_node) return true;
  return row.leaf.starts_with("triangle1") && !row.leaf.starts_with("triangle16");
}

/// Whether a row tests a box around a single triangle, and tests it fast: no structure of the tree but the grid, whose
/// cells are wider; those of one's own that have such a box (docs/add-a-structure.md).
bool loses_lone_boxes(const KernelRow& row) {
  return row.box == "fast" && row.structure != "grid" && find_structure(row.structure)->info.root_is_node;
}

bool has_fma(Isa isa) { return isa >= Isa::avx2; }

/// The fault that the table expects of the row on the case; empty where it expects none.
std::string_view expected_fault(const HardCase& c, const KernelRow& row) {
  for (const KnownLimit& limit : kKnownLimits) {
    if (limit.id != c.id || (!limit.intersector.empty() && limit.intersector != row.intersector)) continue;
    // The triangle of S04 has no area, so it is NaN in blocks that are no indices; and the kd-tree culls with the
    // scene's bounds, which its false hit lies outside of.
    if (c.id == "S04" && (!row.leaf.ends_with('i') || (row.structure == "kdtree" && row.box == "fast"))) continue;
    if (limit.arithmetic == (has_fma(row.isa) ? unfused : fused)) continue;
    if (limit.boxes == Boxes::flat && !loses_flat_boxes(row)) continue;
    if (limit.boxes == Boxes::lone && !loses_lone_boxes(row)) continue;
    return limit.fault;
  }
  return "";
}

/// The mesh as a loader hands it on: triangles with a vertex that is not finite are dropped. `ids` are the
/// case's own.
struct Sanitised {
  TriangleMesh mesh;
  std::vector<std::uint32_t> ids;
};

Sanitised sanitised(const HardCase& c) {
  Sanitised s{{c.mesh.vertices, {}, {}}, {}};
  for (std::uint32_t i = 0; i < c.mesh.size(); ++i) {
    const auto corners = c.mesh.corners(i);
    if (!std::ranges::all_of(corners, [](Vec3f p) { return is_finite(p); })) continue;
    s.mesh.triangles.push_back(c.mesh.triangles[i]), s.ids.push_back(i);
  }
  return s;
}

/// f(case, row, fault) for every case and row; Embree's rows are left out, since it promises none of this.
template <class F>
void for_each_answer(F&& f) {
  for (const HardCase& c : load_hard_cases()) {
    const Sanitised s = sanitised(c);
    Structures structures(s.mesh);
    for (const KernelRow& row : runnable_rows()) {
      if (row.structure == "embree") continue;
      const std::span ray(&c.ray, 1);
      Hit hit = closest_hit(row, structures.get(row), ray)[0];
      const bool any = any_hit(row, structures.get(row), ray)[0] == 1;
      const std::string disagrees = any == hit.is_hit() ? "" : ", any hit says otherwise";
      if (hit.is_hit()) hit.primitive = s.ids.at(hit.primitive);
      f(c, row, fault(c, hit) + disagrees);
    }
  }
}

/// Three corners a triangle.
TriangleMesh of_corners(const std::vector<Vec3f>& corners) {
  TriangleMesh mesh;
  mesh.vertices = corners;
  for (std::uint32_t i = 0; i + 3 <= corners.size(); i += 3) mesh.triangles.push_back({i, i + 1, i + 2});
  return mesh;
}

/// With padded boxes every watertight row gives what it gives without any box.
void check_watertight_alike(const TriangleMesh& mesh, const std::vector<Ray>& rays) {
  Structures structures(mesh);
  for (const KernelRow& row : runnable_rows()) {
    if (!row.intersector.starts_with("watertight") || row.box != "padded") continue;
    const KernelRow* reference = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
    if (!reference) continue;
    INFO(name_of(row));
    CHECK(same_bits(closest_hit(row, structures.get(row), rays),
                    closest_hit(*reference, structures.get(*reference), rays)));
    CHECK(any_hit(row, structures.get(row), rays) == any_hit(*reference, structures.get(*reference), rays));
  }
}

}  // namespace

TEST_CASE("every kernel gives the exact answer of the hard cases, but for the known limits") {
  std::set<std::string> met;
  std::map<std::string, std::set<std::string>> lacking;  // rows of kKnownLimits as far as the fault; their arithmetic
  for_each_answer([&](const HardCase& c, const KernelRow& row, const std::string& f) {
    INFO(c.id << " on " << name_of(row) << ": " << c.why);
    CHECK(f == expected_fault(c, row));
    met.insert(c.id);
    if (!f.empty() && expected_fault(c, row).empty())
      lacking["{\"" + c.id + "\", \"" + std::string(row.intersector) + "\", \"" + f + "\", "].insert(
          has_fma(row.isa) ? "fused" : "unfused");
  });
  for (const auto& [row, arithmetic] : lacking)
    FAIL_CHECK("where it is a limit of the intersector, a row of kKnownLimits: "
               << row << (arithmetic.size() > 1 ? "any" : *arithmetic.begin()) << ", \"why\"},");
  CHECK(met.size() >= 96);
  for (const KnownLimit& limit : kKnownLimits) {
    INFO(limit.id);
    CHECK(met.count(std::string(limit.id)) == 1);
    CHECK_FALSE(limit.reason.empty());
  }
}

// Rays that visit a leaf together are tested together, some that doubles or exact arithmetic decide beside some that
// they need not.
TEST_CASE("a ray of the hard cases gets beside others what it gets alone, bit for bit") {
  for (const HardCase& c : load_hard_cases()) {
    const Sanitised s = sanitised(c);
    std::vector<Ray> rays{c.ray, c.ray, c.ray, c.ray, c.ray};
    rays[1].direction = c.ray.direction * 2.0f;
    rays[2].tfar = std::min(c.ray.tfar, 1.0f);
    if (s.mesh.size() != 0) {
      const auto corners = s.mesh.corners(0);
      rays[3].direction = (corners[0] + corners[1] + corners[2]) * (1.0f / 3.0f) - c.ray.origin;
    }
    Structures structures(s.mesh);
    for (const KernelRow& row : runnable_rows()) {
      if (row.structure == "embree" || row.traversal == "single") continue;
      INFO(c.id << " on " << name_of(row));
      std::vector<Hit> alone;
      std::vector<std::uint8_t> occluded;
      for (const Ray& ray : rays) {
        alone.push_back(closest_hit(row, structures.get(row), std::span(&ray, 1))[0]);
        occluded.push_back(any_hit(row, structures.get(row), std::span(&ray, 1))[0]);
      }
      CHECK(same_bits(closest_hit(row, structures.get(row), rays), alone));
      CHECK(any_hit(row, structures.get(row), rays) == occluded);
    }
  }
}

TEST_CASE("a ray through the diagonal of a quad hits it, in every watertight and Pluecker kernel") {
  // E01 of the hard cases, and others like it: with fused edge functions both triangles of every other quad
  // are missed.
  std::vector<TriangleMesh> quads;
  const auto add = [&](float a, float b) {
    TriangleMesh mesh;
    mesh.vertices = {{-a, -a, 1}, {b, b, 1}, {-a, b, 1}, {b, -a, 1}};
    mesh.triangles = {{0, 1, 2}, {1, 0, 3}};
    quads.push_back(mesh);
  };
  add(0.7f, 0.1f);
  for (std::uint64_t i = 0; i < 60; ++i) add(0.01f + random_float(1, i, 0), 0.01f + random_float(1, i, 1));
  const Ray ray{{0, 0, 0}, 0, {0, 0, 1}, kInfinity};
  for (std::size_t i = 0; i < quads.size(); ++i) {
    Structures structures(quads[i]);
    for (const KernelRow& row : runnable_rows()) {
      if (row.structure == "embree" || (row.intersector != "watertight" && row.intersector != "pluecker")) continue;
      INFO("quad " << i << ": " << name_of(row));
      const Hit hit = closest_hit(row, structures.get(row), std::span(&ray, 1))[0];
      CHECK(hit.is_hit());
      CHECK(hit.t == Approx(1.0f));
      CHECK(any_hit(row, structures.get(row), std::span(&ray, 1))[0] == 1);
    }
  }
}

// What is met only because corners are rounded has the ray in its plane, or nearly, and so its plane's distance
// anywhere; boxes must not say whether that counts.
TEST_CASE("a triangle seen edge on is met at the same distance in every structure, or in none") {
  struct Scene {
    TriangleMesh mesh;
    std::vector<Ray> rays;
  };
  const auto ray = [](Vec3f origin, Vec3f direction) { return Ray{origin, 0, direction, kInfinity}; };
  // Rays of HardRayMaker's kinds `grazing` and `far` for which boxes did.
  const Scene scenes[] = {
      {sphere(32),
       {ray({-0x1.1719a2p-2f, -0x1.320b3cp-1f, 0x1.82f08p-1f}, {0x1.a39d86p-1f, 0x1.47ec34p-2f, 0x1.e68dc6p-2f}),
        ray({0x1.6ea1bap-1f, -0x1.69b012p-2f, -0x1.3d2e66p-1f}, {-0x1.998382p+30f, -0x1.fab0a6p+28f, -0x1.17fe7p+30f}),
        ray({-0x1.a6607ap-3f, 0x1.4ea85ap-9f, 0x1.f57018p-1f}, {0x1.c2fd64p-4f, 0x1.0f7742p-6f, 0x1.03184p-6f}),
        ray({0x1.d0bc92p-2f, -0x1.9f2fa4p-3f, 0x1.c00944p-1f}, {-0x1.db75b6p-1f, -0x1.e1ee5ep-3f, 0x1.25b4d6p-2f}),
        ray({0x1.51027ep-2f, 0x1.e2fab2p-4f, -0x1.df02aap-1f}, {0x1.e0fa52p-1f, -0x1.621fd6p-3f, 0x1.2f1848p-2f}),
        ray({-0x1.5402dep-3f, -0x1.1f7802p-3f, -0x1.016144p+0f}, {-0x1.13f5e4p-2f, -0x1.47ed38p-5f, 0x1.f9bacp-4f}),
        ray({-0x1.43871p-1f, 0x1.024b1ep-1f, 0x1.47063ep-1f}, {0x1.cc3652p-40f, 0x1.2f060ap-43f, 0x1.ba5484p-41f}),
        ray({-0x1.84d624p-1f, 0x1.cbc25cp-2f, 0x1.1cdfdp-1f}, {0x1.bb59e2p+38f, 0x1.16716cp+37f, 0x1.ade3ap+37f}),
        ray({0x1.7396ap-2f, -0x1.d64a86p-6f, 0x1.e11686p-1f}, {-0x1.38ff0ep-5f, -0x1.74309p-7f, 0x1.19e4d2p-7f}),
        ray({-0x1.44c76p-2f, -0x1.98284ep-3f, 0x1.f072bep-1f}, {-0x1.34b696p-5f, -0x1.052af8p-4f, -0x1.ae51f8p-5f})}},
      {sphere(24),
       {ray({-0x1.869ce2p+16f, 0x1.46a138p+16f, 0x1.ad32a2p+13f},
            {0x1.869d98p+16f, -0x1.46a082p+16f, -0x1.ad32a2p+13f})}}};
  for (const Scene& scene : scenes) check_watertight_alike(scene.mesh, scene.rays);
}

// The mean of a long thin triangle's corners rounds by more than boxes are padded by; boxes must not say whether that
// counts.
TEST_CASE("a long thin triangle is met at the same distance in every structure, or in none") {
  struct Case {
    std::vector<Vec3f> corners;  // of triangle after triangle
    Ray ray;
  };
  const Case cases[] = {
      // an edge of a strip 2^15 times as long as wide: beyond tfar, but the mean is before it
      {{{-0x1.bbfe6p+0f, -0x1.da8dep+1f, -0x1.c883e8p+2f},
        {-0x1.bbfe6p+0f, -0x1.da8dep+1f, -0x1.c849a6p+2f},
        {-0x1.bbfe6p+0f, -0x1.da862cp+1f, -0x1.c849a6p+2f},
        {-0x1.bbfe6p+0f, -0x1.da8dep+1f, -0x1.c849a6p+2f},
        {0x1.910068p+2f, -0x1.da8dep+1f, -0x1.c80f64p+2f},
        {-0x1.bbfe6p+0f, -0x1.da8dep+1f, -0x1.c80f64p+2f}},
       {{0x1p-4f, -0x1.ecabp+1f, -0x1.d138p+2f}, 0, {0x1.28p-3f, 0x1.21d1p-3f, 0x1.2p-3f}, 0x1.fff8p-1f}},
      // the corner of a strip: the face behind is the nearer one by its mean
      {{{-1.7343502044677734f, -3.7072196006774902f, -7.133050918579102f},
        {6.265649795532227f, -3.7072196006774902f, -7.129495143890381f},
        {6.265649795532227f, -3.7072196006774902f, -7.133050918579102f},
        {-1.7343502044677734f, -3.7074546813964844f, -7.133050918579102f},
        {-1.7343502044677734f, -3.7072196006774902f, -7.133050918579102f},
        {6.265649795532227f, -3.7072196006774902f, -7.133050918579102f}},
       {{3.75f, -4.95989990234375f, -8.385717391967773f},
        0,
        {-6.71875f, 2.2864227294921875f, 2.2864227294921875f},
        kInfinity}},
      {{{1, 1, 1}, {9, 1, 1}, {9, 1.00390625f, 1}, {20, 20, 20}, {21, 20, 20}, {20, 21, 20}},
       {{6.733159065246582f, 3.5541672706604004f, 3.8142075538635254f},
        0,
        {-2.8686599731445312f, -2.553323745727539f, -2.8142075538635254f},
        0.9999542236328125f}},
      // two strips 2^-12 apart
      {{{43.5440063f, -48.9986572f, 20.3087234f},
        {43.5440063f, -48.9986572f, 84.3087234f},
        {43.6306992f, -48.9986572f, 84.3087234f},
        {43.5440063f, -48.9984665f, 20.3087234f},
        {43.5440063f, -48.9984665f, 84.3087234f},
        {43.6306992f, -48.9984665f, 84.3087234f}},
       {{28.4882812f, -32.21875f, 80.3588486f}, 0, {15.5726929f, -17.3404541f, -18.0f}, kInfinity}},
  };
  for (const Case& c : cases) check_watertight_alike(of_corners(c.corners), {c.ray});
}

// Lanes of a block that doubles have to decide must not have others decided anew, which floats had.
TEST_CASE("what a watertight test makes of a triangle does not depend on the others of its leaf block") {
  struct Case {
    std::vector<Vec3f> corners;
    Ray ray;
  };
  const Case cases[] = {
      {{{0.09719529747962952f, -0.015625f, -0.9198527336120605f},
        {0.09719531238079071f, -0.015625f, -0.9198527336120605f},
        {0.09719531238079071f, -0.015625f, -0.16074836254119873f},
        {0.09719529747962952f, -0.015625f, -0.9198527336120605f},
        {0.09719531238079071f, -0.0078125f, -0.9198527336120605f},
        {0.09719531238079071f, -0.015625f, -0.9198527336120605f}},
       {{0.09719530493021011f, -0.027740057557821274f, -0.9198522567749023f},
        1.5722084045410156f,
        {1.95862881469111e-09f, 0.007705758325755596f, -2.384185791015625e-07f},
        kInfinity}},
      {{{-358.4368896484375f, 276.1693420410156f, -262144.0f},
        {-198.9658203125f, 276.1693420410156f, -2048.0f},
        {-198.9658203125f, 276.1693420410156f, -262144.0f},
        {-358.4368896484375f, 276.1693420410156f, -262144.0f},
        {-198.9658203125f, 276.1693420410156f, -262144.0f},
        {-198.9658203125f, 276.1688232421875f, -262144.0f}},
       {{-146.5092315673828f, 276.16839599609375f, -1037367.5f},
        0.9864625334739685f,
        {-202.53404235839844f, 0.000946044921875f, 785862.0625f},
        kInfinity}},
  };
  for (const Case& c : cases) {
    const TriangleMesh mesh = of_corners(c.corners);
    Structures structures(mesh);
    const std::span ray(&c.ray, 1);
    for (const KernelRow& row : runnable_rows()) {
      if (row.structure != "brute_force" || row.box != "padded" || row.traversal != "single") continue;
      if (!row.intersector.starts_with("watertight")) continue;
      const KernelRow* alone = find_kernel("brute_force", "triangle1v", row.intersector, "padded", "single", row.isa);
      if (!alone) continue;
      INFO(name_of(row));
      CHECK(same_bits(closest_hit(row, structures.get(row), ray), closest_hit(*alone, structures.get(*alone), ray)));
      CHECK(any_hit(row, structures.get(row), ray) == any_hit(*alone, structures.get(*alone), ray));
    }
  }
}

// Doubles put these rays, which start on a vertex of a sliver, a little outside; t is the plane's all the same.
TEST_CASE("watertight_refined meets a triangle at 0 where the ray starts on its vertex") {
  struct Case {
    std::vector<Vec3f> corners;
    Vec3f direction;  // from the third
  };
  const Case cases[] = {
      {{{0.11893068253993988f, -0.10952184349298477f, 0.04923424869775772f},
        {0.11893068253993988f, -0.10952182114124298f, 0.04923423379659653f},
        {0.11504930257797241f, -0.11158735305070877f, 0.0488196536898613f}},
       {-0.00018583814380690455f, 0.000516883737873286f, -0.00029089677263982594f}},
      {{{0.0011863000690937042f, -0.0035505127161741257f, -0.0007571754977107048f},
        {185.01058959960938f, -249.56100463867188f, 152.71408081054688f},
        {-225884.953125f, 194262.640625f, -48495.953125f}},
       {144015.921875f, -123912.328125f, 30991.21484375f}},
  };
  for (const Case& c : cases) {
    const Ray ray{c.corners[2], 0, c.direction, kInfinity};
    const TriangleMesh mesh = of_corners(c.corners);
    Structures structures(mesh);
    for (const KernelRow& row : runnable_rows()) {
      if (row.intersector != "watertight_refined" || row.box != "padded") continue;
      INFO(name_of(row));
      const Hit hit = closest_hit(row, structures.get(row), std::span(&ray, 1))[0];
      CHECK(hit.is_hit());
      CHECK(hit.t == 0.0f);
    }
  }
}

// Needles, two corners an ulp apart, met near the rim: doubles cannot tell whether the rays are inside. A watertight
// test may put them on either side of an open edge.
TEST_CASE("the distance of watertight_refined is the exact one where doubles cannot tell u and v") {
  struct Case {
    std::vector<Vec3f> corners;
    Ray ray;
    float t;
  };
  const Case cases[] = {
      {{{0.92703587f, -0.9853362f, -0.040116318f},
        {0.927036f, -0.9853362f, -0.040116318f},
        {0.89554465f, -0.04935862f, -0.38466844f}},
       {{0.89662135f, -0.08011281f, -0.3733467f}, 0, {-1156096, 33022056, -12156640}, kInfinity},
       0x1p-30f},
      {{{0.5417437f, 0.0003389483f, 0.72030926f},
        {0.5417438f, 0.0003389483f, 0.72030926f},
        {0.2902671f, 0.27170044f, -0.9278951f}},
       {{0.19494823f, 0.37455595f, -1.5526235f}, 0, {0.09531888f, -0.1028555f, 0.6247284f}, kInfinity},
       1.0f},
  };
  for (const Case& c : cases) {
    const TriangleMesh mesh = of_corners(c.corners);
    Structures structures(mesh);
    int hits = 0;
    for (const KernelRow& row : runnable_rows()) {
      if (row.intersector != "watertight_refined" || row.box != "padded") continue;
      const Hit hit = closest_hit(row, structures.get(row), std::span(&c.ray, 1))[0];
      if (!hit.is_hit()) continue;
      INFO(name_of(row));
      CHECK(hit.t == c.t);
      ++hits;
    }
    CHECK(hits > 0);
  }
}

TEST_CASE("a triangle behind a ray that starts in its plane is not met") {
  TriangleMesh mesh;
  mesh.vertices = {{40, 55, -30}, {36, 61, -28}, {49, 55, -27}};
  mesh.triangles = {{0, 1, 2}};
  const Ray away{{45, 61, -25}, 0, {0x1.306c9p+3f, 0x1.6d4f14p+3f, 0x1.306c9p+3f}, kInfinity};
  Structures structures(mesh);
  for (const KernelRow& row : runnable_rows()) {
    if (!row.intersector.starts_with("watertight") || row.box != "padded") continue;
    INFO(name_of(row));
    CHECK_FALSE(closest_hit(row, structures.get(row), std::span(&away, 1))[0].is_hit());
    CHECK(any_hit(row, structures.get(row), std::span(&away, 1))[0] == 0);
  }
}
