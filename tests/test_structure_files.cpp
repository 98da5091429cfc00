// Files of built structures: every one that does not fit is refused in one line, and writers do not meet.
#include <boost/crc.hpp>

#include <sys/stat.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"
#include "structures/structure_file.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/folder.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

/// The message of the UserError that loading throws; empty where it loads.
std::string refusal(const char* name, const TriangleMesh& mesh, const BuildSettings& settings, const fs::path& file) {
  const std::string line = error_of([&] { (void)load_structure(name, mesh, settings, file); });
  CHECK((line.empty() || line.starts_with(file.string())));
  return line;
}

bool has(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

/// The file, shorter than 4 MiB, with another digest of the program, and the checksum that goes with it.
std::string by_another_program(std::string file) {
  const auto sum = [](const void* bytes, std::size_t size) {
    boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~std::uint64_t{0}, ~std::uint64_t{0}, true, true> piece, pieces;
    piece.process_bytes(bytes, size);
    const std::uint64_t of_piece = piece.checksum();
    pieces.process_bytes(&of_piece, sizeof of_piece);
    return std::uint64_t(pieces.checksum());
  };
  REQUIRE(file.size() < (std::size_t{4} << 20));
  constexpr std::size_t kHeader = 64, kChecksum = 24, kProgram = 56;
  file[kProgram] = char(file[kProgram] ^ 1);
  std::memset(file.data() + kChecksum, 0, 8);
  const std::uint64_t parts[] = {sum(file.data(), kHeader), sum(file.data() + kHeader, file.size() - kHeader)};
  const std::uint64_t checksum = sum(parts, sizeof parts);
  std::memcpy(file.data() + kChecksum, &checksum, sizeof checksum);
  return file;
}

BuildSettings settings_for(const StructureInfo& info, std::string_view leaf) {
  BuildSettings settings;
  settings.builder = info.builders.front(), settings.leaf = leaf, settings.isa = best_isa();
  return settings;
}

}  // namespace

TEST_CASE("every structure of the project but Embree can be saved") {
  const Folder folder;
  const TriangleMesh mesh = random_triangles(20, 0.2f, 11);
  for (const StructureEntry& entry : all_structures()) {
    INFO(entry.info.name);
    BuildReport report;
    const BuildSettings settings = settings_for(entry.info, entry.info.leaves.front());
    const auto built = build_structure(entry.info.name, mesh, settings, report);
    if (entry.info.name == "embree") {
      CHECK_THROWS_WITH(save_structure(*built, mesh, settings, folder / "x"),
                        "embree cannot be saved to a file; build it anew");
      CHECK_FALSE(fs::exists(folder / "x"));
    } else {
      CHECK_NOTHROW(save_structure(*built, mesh, settings, folder / std::string(entry.info.name).c_str()));
    }
  }
}

TEST_CASE("two threads save to one path at once: both do, and nothing is left beside the file") {
  const Folder folder;
  const TriangleMesh mesh = random_triangles(2000, 0.1f, 11);
  const StructureInfo& info = find_structure("bvh8")->info;
  const BuildSettings settings = settings_for(info, info.leaves.front());
  BuildReport report;
  std::vector<std::unique_ptr<Accel>> built;
  for (int i = 0; i < 2; ++i) built.push_back(build_structure(info.name, mesh, settings, report));
  std::atomic<unsigned> failures{0};
  for (int round = 0; round < 40; ++round) {
    std::vector<std::thread> threads;
    for (const auto& one : built) {
      threads.emplace_back([&] {
        try {
          save_structure(*one, mesh, settings, folder / "same");
        } catch (const UserError&) {
          ++failures;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  CHECK(failures == 0);
  CHECK_NOTHROW(load_structure(info.name, mesh, settings, folder / "same"));
  const fs::directory_iterator files((folder / "same").parent_path());
  CHECK(std::distance(begin(files), end(files)) == 1);
}

TEST_CASE("a file that does not fit is refused, and the message says why") {
  const Folder folder;
  const fs::path file = folder / "saved", other = folder / "other";
  const TriangleMesh mesh = random_triangles(9, 0.2f, 11);
  BuildSettings settings;
  settings.leaf = "triangle4v", settings.isa = best_isa();
  BuildReport report;
  const auto built = build_structure("bvh4", mesh, settings, report);
  save_structure(*built, mesh, settings, file);
  REQUIRE(refusal("bvh4", mesh, settings, file) == "");
  const std::string whole = read(file);

  SECTION("no such file, a folder, an empty file, another file") {
    CHECK(has(refusal("bvh4", mesh, settings, folder / "none"), "is no file"));
    CHECK(has(refusal("bvh4", mesh, settings, folder / "."), "is no file"));
    write(other, "");
    CHECK(has(refusal("bvh4", mesh, settings, other), "is no saved structure"));
    write(other, std::string(500, 'x'));
    CHECK(has(refusal("bvh4", mesh, settings, other), "is no saved structure"));
  }
  SECTION("every truncation, and bytes at the end") {
    for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
      write(other, whole.substr(0, bytes));
      CHECK(has(refusal("bvh4", mesh, settings, other), bytes < 64 ? "is no saved structure" : "is truncated"));
    }
    write(other, whole + "x");
    CHECK(has(refusal("bvh4", mesh, settings, other), "is damaged"));
  }
  SECTION("every flipped byte") {
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1 << i % 8, 0xff}) {
        std::string damaged = whole;
        damaged[i] = char(damaged[i] ^ flip);
        write(other, damaged);
        INFO("byte " << i << " xor " << flip);
        REQUIRE(refusal("bvh4", mesh, settings, other) != "");
      }
    }
  }
  SECTION("another version, another byte order") {
    std::string changed = whole;
    changed[8] = 4;
    write(other, changed);
    CHECK(has(refusal("bvh4", mesh, settings, other), "is of format version 4, this build reads version 3"));
    changed = whole;
    std::reverse(changed.begin() + 12, changed.begin() + 16);
    write(other, changed);
    CHECK(has(refusal("bvh4", mesh, settings, other), "other byte order"));
  }
  SECTION("another structure, builder, leaf, parameter") {
    CHECK(has(refusal("bvh8", mesh, settings, file), "holds structure 'bvh4', not 'bvh8'"));
    CHECK_THROWS_AS(load_structure("bvh5", mesh, settings, file), UserError);
    BuildSettings wanted = settings;
    wanted.leaf = "triangle4";
    CHECK(has(refusal("bvh4", mesh, wanted, file), "holds leaf 'triangle4v', not 'triangle4'"));
    wanted = settings, wanted.builder = "none";
    CHECK(has(refusal("bvh4", mesh, wanted, file), "holds builder 'binned_sah', not 'none'"));
    wanted = settings, wanted.parameters.bins = 16;
    wanted.parameters.reinsertion_top = 7, wanted.parameters.grid_density = 2;
    CHECK(has(refusal("bvh4", mesh, wanted, file),
              "holds other parameters (bins 32, here 16; reinsertion_top auto, here 7); ask for"));
    wanted = settings, wanted.parameters.grid_density = 2, wanted.parameters.below = "bvh2";  // not read
    CHECK(refusal("bvh4", mesh, wanted, file) == "");
  }
  SECTION("threads and instruction set do not matter") {
    BuildSettings wanted = settings;
    wanted.threads = 7, wanted.isa = Isa::scalar;
    CHECK(refusal("bvh4", mesh, wanted, file) == "");
  }
  SECTION("another build of the program: of use, but not as this one's") {
    CHECK(program_digest() == program_digest());
    CHECK_NOTHROW(load_structure("bvh4", mesh, settings, file, BuiltBy::this_program));
    write(other, by_another_program(whole));
    CHECK(refusal("bvh4", mesh, settings, other) == "");
    CHECK_THROWS_WITH(load_structure("bvh4", mesh, settings, other, BuiltBy::this_program),
                      Catch::Contains("was built by another build of the program"));
  }
  SECTION("another mesh: fewer triangles, one moved by an ulp, two swapped; materials do not matter") {
    TriangleMesh changed = mesh;
    changed.triangles.pop_back();
    CHECK(has(refusal("bvh4", changed, settings, file), "was built from another mesh (9 triangles, this one has 8)"));
    changed = mesh;
    changed.vertices[5].y = std::nextafter(changed.vertices[5].y, 9.0f);
    CHECK(has(refusal("bvh4", changed, settings, file),
              "was built from another mesh (as many triangles, but other positions, indices"));
    changed = mesh;
    changed.vertices.push_back({});
    CHECK(has(refusal("bvh4", changed, settings, file), " vertices, this one has "));
    changed = mesh;
    std::swap(changed.triangles[2], changed.triangles[3]);
    CHECK(has(refusal("bvh4", changed, settings, file), "another mesh"));
    changed = mesh;
    changed.materials.assign(mesh.size(), 1);
    CHECK(refusal("bvh4", changed, settings, file) == "");
  }
  SECTION("what cannot be written") {
    CHECK_THROWS_AS(save_structure(*built, mesh, settings, folder / "none/saved"), UserError);
    CHECK_FALSE(fs::exists(folder / "none"));
    const fs::path pipe = folder / "pipe";
    REQUIRE(::mkfifo(pipe.c_str(), 0666) == 0);
    CHECK_THROWS_WITH(save_structure(*built, mesh, settings, pipe), Catch::Contains("is no file"));
    CHECK(fs::is_fifo(pipe));
    CHECK_THROWS_AS(save_structure(*built, mesh, settings, folder / "."), UserError);
  }
  SECTION("a link stays, and what it leads to is written") {
    fs::create_symlink("other", folder / "link");
    save_structure(*built, mesh, settings, folder / "link");
    CHECK(fs::is_symlink(folder / "link"));
    CHECK(read(folder / "other") == whole);
  }
  SECTION("saving is over the old file, and leaves nothing beside it") {
    save_structure(*built, mesh, settings, file);
    CHECK(read(file) == whole);
    CHECK(std::distance(fs::directory_iterator(folder / "."), fs::directory_iterator{}) == 1);
  }
}
