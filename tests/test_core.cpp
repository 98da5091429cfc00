#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/arena.h"
#include "core/bounds.h"
#include "core/coordinates.h"
#include "core/error.h"
#include "core/instances.h"
#include "core/isa.h"
#include "core/memory_meter.h"
#include "core/names.h"
#include "core/parse_number.h"
#include "core/random.h"
#include "core/ray.h"
#include "core/reserved_array.h"
#include "core/rounding.h"
#include "core/whole_file.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/folder.h"

using namespace arboretum;

TEST_CASE("isa names go there and back") {
  for (Isa isa : kAllIsas) CHECK(parse_isa(to_string(isa)) == isa);
  CHECK(parse_isa("avx") == Isa::avx2);
  CHECK_FALSE(parse_isa("avx3").has_value());
  CHECK(is_available(Isa::scalar));
  for (Isa isa : available_isas()) CHECK(cpu_supports(isa));
}

TEST_CASE("long words are shortened between characters") {
  CHECK(shortened("grüße", 7) == "grüße");
  CHECK(shortened("grüße", 6) == "grüß... (5 characters)");
  CHECK(shortened("grüße", 5) == "grü... (5 characters)");
  CHECK(shortened("grüße", 3) == "gr... (5 characters)");
}

TEST_CASE("a number is all of its word") {
  CHECK(parse_number<unsigned>("042") == 42u);
  CHECK(parse_number<int>("-7") == -7);
  CHECK(parse_number<double>("1e-3") == 1e-3);
  for (const char* word : {"", " ", " 1", "1 ", "+1", "-1", "0x1", "1.0", "1a", "4294967296"})
    CHECK_FALSE(parse_number<unsigned>(word));
  for (const char* word : {"", " 1", "1 ", "+1", "0x1p3", "1e", "1e999", "1,5"})
    CHECK_FALSE(parse_number<double>(word));
}

TEST_CASE("whole files are read to their last byte, and what cannot be read is an error") {
  const test::Folder folder;
  std::string bytes;
  for (std::size_t i = 0; i < 200'000; ++i) bytes += static_cast<char>(i % 251);
  for (const std::string& text : {std::string(), std::string("\r\n\0x", 4), bytes})
    CHECK(read_whole(folder.write("file", text)) == text);
  const std::string path = folder.path().string();
  CHECK(test::error_of([&] { (void)read_whole(folder / "none"); }) == path + "/none: no such file; check the path");
  CHECK(test::error_of([&] { (void)read_whole(folder.path()); }) == path + ": is a folder; a file is to stand there");
  CHECK_THAT(test::error_of([&] { (void)read_whole(folder / "file/below"); }),
             Catch::Contains("file/below: cannot be read: "));
}

TEST_CASE("an empty box has no area and contains nothing") {
  Bounds3f box;
  CHECK(box.empty());
  CHECK(box.area() == 0.0);
  constexpr float inf = Bounds3f::kInfinity;
  for (const Vec3f p : {Vec3f{0, 0, 0}, Vec3f{1, 2, 3}, Vec3f{inf, inf, inf}, Vec3f{-inf, -inf, -inf}})
    CHECK_FALSE(box.contains({p, p}));
  CHECK_FALSE(box.contains({{-inf, -inf, -inf}, {inf, inf, inf}}));
  box.extend(Vec3f{1, 2, 3});
  CHECK_FALSE(box.empty());
  CHECK(box.area() == 0.0);
  box.extend(Vec3f{2, 4, 6});
  CHECK(box.area() == 2.0 * (1 * 2 + 2 * 3 + 3 * 1));
}

TEST_CASE("affine maps: the determinant is the linear part's, and goes with the inverse") {
  const AffineMap map{{{2, 1, 0, 7}, {0, 3, 1, 8}, {1, 0, 4, 9}}};
  CHECK(determinant(AffineMap{}) == 1);
  CHECK(determinant(map) == 25);
  CHECK(determinant(inverse(map)) == Approx(1.0 / 25));
  CHECK(transform_point(inverse(map), transform_point(map, {1, 2, 3})) == Vec3f{1, 2, 3});
  CHECK(determinant({{{1, 2, 3, 0}, {4, 5, 6, 0}, {7, 8, 9, 0}}}) == 0);
  CHECK(determinant({{{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, 1, 0}}}) == -1);
}

TEST_CASE("directed rounding gives the neighbouring floats, of either sign, at zero and at the ends of the range") {
  const float inf = std::numeric_limits<float>::infinity(), most = std::numeric_limits<float>::max();
  for (const float f : {0.0f, -0.0f, 1e-45f, -1e-45f, 0x1p-126f, 1.0f, -1.0f, 0x1.fffffep0f, -3.7f, most, -most}) {
    CAPTURE(f);
    CHECK(next_below(f) == std::nextafter(f, -inf));
    CHECK(next_above(f) == std::nextafter(f, inf));
    CHECK(rounded_down(f) == f);
    CHECK(rounded_up(f) == f);
    // A little to either side of f, where doubles still tell it from f.
    const double above = std::nextafter(double(f), double(inf)), below = std::nextafter(double(f), -double(inf));
    CHECK(rounded_down(above) == f);
    CHECK(rounded_up(above) == std::nextafter(f, inf));
    CHECK(rounded_down(below) == std::nextafter(f, -inf));
    CHECK(rounded_up(below) == f);
  }
  CHECK(rounded_down(1e300) == most);
  CHECK(rounded_up(1e300) == inf);
  CHECK(rounded_down(-1e300) == -inf);
  CHECK(rounded_up(-1e300) == -most);
  CHECK(rounded_down(double(inf)) == inf);
  CHECK(rounded_up(-double(inf)) == -inf);
  CHECK(std::isnan(rounded_down(std::nan(""))));
  CHECK(std::isnan(rounded_up(std::nan(""))));
}

TEST_CASE("the largest coordinate is of either corner, and a mesh holds what is finite and within the range") {
  CHECK(largest_coordinate(Vec3f{1, -7, 3}) == 7.0f);
  CHECK(largest_coordinate(Bounds3f{}) == 0.0f);
  CHECK(largest_coordinate(Bounds3f{{-9, 0, 0}, {1, 2, 3}}) == 9.0f);
  CHECK(largest_coordinate(Bounds3f{{-1, 0, 0}, {1, 2, 4}}) == 4.0f);
  const float beyond = next_above(kMaxCoordinate), nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const float wrong : {beyond, -beyond, Bounds3f::kInfinity, nan}) {
      Vec3f p{kMaxCoordinate, -kMaxCoordinate, 0};
      CHECK(is_in_range(p));
      p[axis] = wrong;
      CHECK_FALSE(is_in_range(p));
    }
  }
}

TEST_CASE("a ray is valid only with finite numbers, a direction and a non-empty interval") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  CHECK(is_valid(Ray{{0, 0, 0}, 0, {0, 0, 1}, inf}));
  CHECK(is_valid(Ray{{0, 0, 0}, 1, {0, 0, 1}, 1}));
  CHECK_FALSE(is_valid(Ray{{0, 0, 0}, 2, {0, 0, 1}, 1}));
  CHECK_FALSE(is_valid(Ray{{0, 0, 0}, 0, {0, 0, -0.0f}, inf}));
  CHECK_FALSE(is_valid(Ray{{nan, 0, 0}, 0, {0, 0, 1}, inf}));
  CHECK_FALSE(is_valid(Ray{{0, 0, 0}, 0, {0, inf, 1}, inf}));
  CHECK_FALSE(is_valid(Ray{{0, 0, 0}, nan, {0, 0, 1}, inf}));
}

TEST_CASE("the memory meter sees what arenas and vectors hold, and their peak") {
  const std::size_t before = MemoryMeter::current();
  MemoryMeter::reset_peak();
  {
    Arena arena(1 << 20);
    CHECK(reinterpret_cast<std::uintptr_t>(arena.data()) % 64 == 0);
    MeteredVector<float> values(1000);
    CHECK(MemoryMeter::current() == before + (1 << 20) + 4000);
    Arena moved = std::move(arena);
    CHECK(arena.data() == nullptr);
    CHECK(moved.bytes() == 1 << 20);
  }
  CHECK(MemoryMeter::current() == before);
  CHECK(MemoryMeter::peak() == before + (1 << 20) + 4000);
}

TEST_CASE("a reserved array becomes an arena of what it has handed out") {
  const std::size_t before = MemoryMeter::current();
  {
    ReservedArray<std::byte> array;
    array.reserve(3 << 20);
    array.hand_out(900), array.hand_out(100);
    CHECK(array.counted() == 1000);
    const std::byte* const data = array.data();
    const Arena arena(std::move(array));
    CHECK(array.empty());
    CHECK(arena.data() == data);
    CHECK(arena.bytes() == 1000);
    CHECK(MemoryMeter::current() == before + 1000);
  }
  CHECK(MemoryMeter::current() == before);
}

TEST_CASE("a reserved array counts what it has handed out, less the pages it gave back") {
  const std::size_t before = MemoryMeter::current(), n = 1 << 20;
  {
    ReservedArray<std::uint32_t> array;
    array.reserve(2 * n);
    CHECK(MemoryMeter::current() == before);
    array.hand_out(n);
    std::fill_n(array.data(), n, 7u);
    CHECK(MemoryMeter::current() == before + 4 * n);
    array.give_back(n / 2, n);
    CHECK(MemoryMeter::current() <= before + 2 * n + (1 << 16));
    CHECK(MemoryMeter::current() >= before + 2 * n);
    array.give_back(1, 3);  // less than a page
    CHECK(MemoryMeter::current() >= before + 2 * n);
    CHECK(std::all_of(array.data(), array.data() + n / 2, [](std::uint32_t v) { return v == 7; }));
    ReservedArray<std::uint32_t> moved = std::move(array);
    CHECK(array.empty());
  }
  CHECK(MemoryMeter::current() == before);
}

TEST_CASE("the nearest name to a misspelt one") {
  const std::vector<std::string> names{"bvh2", "bvh4", "bvh8", "bvh16", "kdtree", "embree"};
  CHECK(nearest_name("kd-tree", names) == "kdtree");
  CHECK(nearest_name("ebmree", names) == "embree");
  CHECK(edit_distance("ab", "ba") == 1);
  CHECK(edit_distance("", "abc") == 3);
  CHECK_THAT(unknown_name_message("structure", "bhv8", names), Catch::Contains("did you mean 'bvh8'?"));
  // What is not spelt alike is not asked for: a third of the longer word, or its first three letters.
  CHECK(unknown_name_message("scene", "kitchn", std::vector<std::string>{"city", "forest"}) ==
        "unknown scene 'kitchn' (valid: city forest)");
  CHECK(close_name("nosuch", std::vector<std::string>{"forest"}).empty());
  CHECK(close_name("nonexist", std::vector<std::string>{"A"}).empty());
  CHECK(close_name("rum", std::vector<std::string>{"run", "render"}) == "run");
  CHECK(close_name("rotation", std::vector<std::string>{"scale", "rotate"}) == "rotate");
  CHECK(close_name("", names).empty());
  CHECK(close_name("bvh", {}).empty());
}

TEST_CASE("an error is one line, whatever it quotes, and no page") {
  CHECK(std::string(UserError("a\nb\tc\r\x7f, ä").what()) == "a\\nb\\tc\\x0d\\x7f, ä");
  std::string path = "begin ";
  for (int i = 0; i < 50000; ++i) path += "ö";
  const std::string line = UserError(path + ": no file; name one").what();
  CHECK(line.size() <= UserError::kLongest);
  CHECK(line.starts_with("begin öö"));
  CHECK(line.ends_with("ö: no file; name one"));
  CHECK(line.find("ö ... ö") != std::string::npos);
}

TEST_CASE("random numbers depend on seed, index and dimension alone, and fill [0, 1)") {
  CHECK(random_bits(1, 2, 3) == 0xc5b0c6f09d26294fu);
  CHECK(random_float(1, 2, 3) == 0x1.8b618cp-1f);
  CHECK(random_bits(1, 2, 3) != random_bits(1, 3, 2));
  CHECK(random_bits(1, 2, 3) != random_bits(2, 2, 3));
  double sum = 0;
  for (int i = 0; i < 100000; ++i) {
    const float r = random_float(7, i, 0);
    REQUIRE((r >= 0.0f && r < 1.0f));
    sum += r;
  }
  CHECK(sum / 100000 == Approx(0.5).margin(0.005));
}
