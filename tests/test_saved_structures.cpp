// Saving and loading built structures: equal answers and equal statistics after a round trip, for every structure that
// can be saved, and the same bytes of every build.
#include <malloc.h>
#include <tbb/global_control.h>

#include <sstream>
#include <string>
#include <vector>

#include "structures/archive.h"
#include "structures/statistics.h"
#include "structures/structure_file.h"
#include "tests/catch.h"
#include "tests/folder.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

BuildSettings settings_for(const StructureInfo& info, std::string_view leaf) {
  BuildSettings settings;
  settings.builder = info.builders.front(), settings.leaf = leaf, settings.isa = best_isa();
  return settings;
}

/// What a file holds of a structure, built while fresh memory is full of `filling`.
std::string saved_bytes(const StructureInfo& info, const TriangleMesh& mesh, BuildSettings settings, int filling,
                        unsigned threads) {
  settings.threads = threads;
  ::mallopt(M_PERTURB, filling);
  BuildReport report;
  const auto built = build_structure(info.name, mesh, settings, report);
  ::mallopt(M_PERTURB, 0);
  std::ostringstream stream;
  Archive archive(stream, mesh);
  built->archive(archive);
  return stream.str();
}

}  // namespace

TEST_CASE("a structure that was saved and loaded answers and measures as it did") {
  const Folder folder;
  const fs::path file = folder / "saved";
  for (const std::size_t count : {0u, 1u, 700u}) {
    // Far from the origin, where what boxes are padded by decides whether rays at vertices meet them.
    const TriangleMesh mesh = moved(random_triangles(count, 0.2f, 11), 1.0f, {1e4f, -7.5e3f, 5e3f});
    // The vertices of the loaded one lie elsewhere: an index leaf must not point to those of the mesh that was built
    // from.
    const TriangleMesh again = mesh;
    std::vector<Ray> rays =
        count ? generic_rays(mesh, 200, 3) : std::vector<Ray>{Ray{{0, 0, -3}, 0, {0, 0, 1}, kInfinity}};
    for (std::size_t i = 0; count && i < 200; ++i) {
      const Vec3f vertex = mesh.vertices[i * 31 % mesh.vertices.size()], from = rays[i].origin;
      rays.push_back({from, 0, vertex - from, kInfinity});
    }
    for (const StructureEntry& entry : all_structures()) {
      if (entry.info.name == "embree") continue;
      for (const std::string_view leaf : entry.info.leaves) {
        INFO(entry.info.name << " " << leaf << " " << count);
        const BuildSettings settings = settings_for(entry.info, leaf);
        BuildReport report;
        const auto built = build_structure(entry.info.name, mesh, settings, report);
        save_structure(*built, mesh, settings, file);
        const auto loaded = load_structure(entry.info.name, again, settings, file);
        CHECK(loaded->bytes() == built->bytes());
        const BuilderParameters costs;
        const StructureStatistics a = compute_statistics(*built, mesh, costs, true),
                                  b = compute_statistics(*loaded, again, costs, true);
        CHECK(a.sah_cost == b.sah_cost);
        CHECK(a.epo == b.epo);
        CHECK(a.depth_histogram == b.depth_histogram);
        CHECK(a.references == b.references);
        // Every leaf form by itself: rows that share their code differ in what of the file they read.
        for (const KernelRow& row : kernel_table()) {
          if (row.structure != entry.info.name || row.leaf != leaf || row.isa != best_isa()) continue;
          if (row.traversal != "single" && row.traversal != "packet64" && row.traversal != "queued") continue;
          CHECK(same_bits(closest_hit(row, *built, rays), closest_hit(row, *loaded, rays)));
          CHECK(any_hit(row, *built, rays) == any_hit(row, *loaded, rays));
        }
      }
    }
  }
}

TEST_CASE("the same build gives the same bytes, whatever memory held before and for any number of threads") {
  const tbb::global_control enough(tbb::global_control::max_allowed_parallelism, 8);
  for (const StructureEntry& entry : all_structures()) {
    if (entry.info.name == "embree") continue;
    for (const std::size_t count : {0u, 1u, 300u, 9000u}) {
      const TriangleMesh mesh = random_triangles(count, 0.05f, 11);
      const bool all_threads = count == 9000;
      for (const std::string_view leaf : entry.info.leaves) {
        if (all_threads && leaf != entry.info.leaves.front()) continue;
        for (const std::string_view builder : entry.info.builders) {
          if (builder != entry.info.builders.front() && (!all_threads || builder.ends_with("_reinsertion"))) continue;
          if (entry.info.takes_below && builder != entry.info.builders.front()) continue;  // of what is below it
          INFO(entry.info.name << " " << builder << " " << leaf << " " << count);
          BuildSettings settings = settings_for(entry.info, leaf);
          settings.builder = builder;
          const std::string first = saved_bytes(entry.info, mesh, settings, 0x55, 1);
          CHECK((saved_bytes(entry.info, mesh, settings, 0x2a, 1) == first));
          if (!all_threads) continue;
          for (const unsigned threads : {2u, 3u, 7u}) {
            INFO(threads << " threads");
            CHECK((saved_bytes(entry.info, mesh, settings, int(0x10 + threads), threads) == first));
          }
        }
      }
    }
  }
}
