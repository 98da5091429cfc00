// The table of leaf tests: which intersector has which blocks on which instruction set, and what kernels do with it.
#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

#include "intersectors/leaf_tests.h"
#include "intersectors/promises.h"
#include "structures/leaves/leaf_form.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// The row of kReads, below, that an intersector has as it is compiled.
std::string row_of(std::string_view intersector) {
  std::string forms;
  bool every_width = false;
  for (const LeafTests& t : leaf_tests()) {
    if (t.intersector != intersector) continue;
    const char form = std::isdigit(t.leaf.back()) ? 'e' : t.leaf.back();
    if (forms.find(form) == std::string::npos) forms += form;
    every_width |= form != 'v' && t.leaf != "triangle4i";
  }
  return "{\"" + std::string(intersector) + "\", \"" + forms + "\", " + (every_width ? "true" : "false") + "},";
}

}  // namespace

TEST_CASE(
    "the table of leaf tests has every intersector with all blocks that it reads, once, on every instruction set, and "
    "no others") {
  struct Reads {
    std::string_view intersector;
    std::string_view forms;  ///< last letters of the blocks' names, e: none
    bool every_width;        ///< else those that the usual leaves have
  };
  constexpr Reads kReads[] = {
      {"moller_trumbore", "evia", true}, {"pluecker", "vi", false},
      {"watertight", "vi", true},        {"exact", "vi", true},
      {"baldwin_weber", "w", true},      {"havel_herout", "h", true},
      {"wald_projection", "p", true},    {"moller_trumbore_double", "vi", false},
      {"pluecker_double", "vi", false},  {"watertight_refined", "vi", false},
  };
  for (const IntersectorPromise& promise : kIntersectorPromises) {
    INFO("a row of kReads, as it is compiled: " << row_of(promise.intersector));
    CHECK(std::ranges::count(kReads, promise.intersector, &Reads::intersector) == 1);
  }
  REQUIRE(std::size(kReads) == std::size(kIntersectorPromises));
  for (Isa isa : kAllIsas) {
    if (!cpu_supports(isa)) continue;
    std::vector<std::string> expected, found;
    for (const Reads& r : kReads) {
      for (const char form : r.forms) {
        for (const int width : {1, 4, 8, 16}) {
          const bool wide = isa == Isa::avx2 || isa == Isa::avx512;
          const bool fits = width <= 4 || (width == 8 && isa != Isa::scalar) || isa == Isa::avx512;
          if (form == 'a' && width != 4) continue;
          const bool usual = form == 'i' ? width == 4 : width <= 4 || (width == 8 && wide);
          if (!(r.every_width ? fits : usual)) continue;
          const std::string leaf = "triangle" + std::to_string(width) + (form == 'e' ? "" : std::string(1, form));
          REQUIRE(find_leaf_form(leaf));
          expected.push_back(std::string(r.intersector) + "/" + leaf);
        }
      }
    }
    for (const LeafTests& t : leaf_tests()) {
      if (t.isa != isa) continue;
      found.push_back(std::string(t.intersector) + "/" + std::string(t.leaf));
      CHECK(find_leaf_tests(t.leaf, t.intersector, isa) == &t);
      REQUIRE(t.form);
      CHECK(t.form->name == t.leaf);
      REQUIRE((t.prepare && t.closest_hit && t.any_hit));
    }
    std::ranges::sort(expected), std::ranges::sort(found);
    INFO(to_string(isa));
    CHECK(found == expected);
  }
}

namespace {

/// Leaf tests that find nothing and count their calls.
struct CountedTests : LeafTests {
  static inline unsigned calls = 0;
  explicit CountedTests(const LeafTests& tests) : LeafTests(tests) {
    closest_hit = [](PreparedRay&, const std::byte*, unsigned, const Vec3f*, float, NearestHit&) {
      return ++calls, false;
    };
    any_hit = [](PreparedRay&, const std::byte*, unsigned, const Vec3f*, float, float) { return ++calls, false; };
  }
};

}  // namespace

TEST_CASE("a row calls the leaf tests that it names, unless it says that they are compiled in") {
  const TriangleMesh mesh = sphere(4);
  const std::vector<Ray> rays = generic_rays(mesh, 48, 3);
  Structures structures(mesh);
  std::size_t compiled_in = 0, called = 0;
  for (KernelRow row : kernel_table()) {
    if (!is_available(row.isa) || row.tests == nullptr) continue;
    INFO(name_of(row));
    // These look up tests of blocks of their own.
    if (row.structure == "two_level" || row.structure == "bvh4_motion") {
      CHECK_FALSE(row.leaves_compiled_in);
      continue;
    }
    const Accel& accel = structures.get(row);
    const std::vector<Hit> right = closest_hit(row, accel, rays);
    const auto occluded = any_hit(row, accel, rays);
    REQUIRE(std::ranges::count_if(right, &Hit::is_hit) > 8);
    const CountedTests spy(*row.tests);
    row.tests = &spy;
    CountedTests::calls = 0;
    const std::vector<Hit> hits = closest_hit(row, accel, rays);
    CHECK((CountedTests::calls == 0) == row.leaves_compiled_in);
    CHECK(std::ranges::count_if(hits, &Hit::is_hit) ==
          (row.leaves_compiled_in ? std::ranges::count_if(right, &Hit::is_hit) : 0));
    CountedTests::calls = 0;
    CHECK((any_hit(row, accel, rays) == occluded) == row.leaves_compiled_in);
    CHECK((CountedTests::calls == 0) == row.leaves_compiled_in);
    ++(row.leaves_compiled_in ? compiled_in : called);
  }
  CHECK(called > 0);
  // What races are run with.
  for (Isa isa : kAllIsas) {
    if (!is_available(isa)) continue;
    for (const char* traversal : {"single", "queued", "packet64"}) {
      for (const char* intersector : {"moller_trumbore", "watertight", "exact", "pluecker"}) {
        const bool race = isa != Isa::scalar &&
                          (std::string_view(traversal) == "single" || std::string_view(intersector) != "pluecker");
        const KernelRow* row =
            find_kernel("bvh8", default_leaf("bvh8", intersector, isa), intersector, "padded", traversal, isa);
        INFO(intersector << " " << traversal << " " << to_string(isa));
        if (isa != Isa::scalar) REQUIRE(row);
        if (row) CHECK(row->leaves_compiled_in == race);
      }
    }
  }
  CHECK((compiled_in > 0 || best_isa() == Isa::scalar));
}
