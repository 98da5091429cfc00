// What structures of one's own say of their builders, and builder parameters that they have of their own. The
// executable has a registry of its own: two structures that hold nothing, and two_level.
#include "core/error.h"
#include "experiments/axes.h"
#include "experiments/parameters.h"
#include "experiments/registry.h"
#include "structures/own_parameters.h"
#include "structures/parameters_read.h"
#include "structures/registry.h"
#include "structures/structure_file.h"
#include "structures/two_level/two_level_parameters.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/kernel_scenes.h"

namespace arboretum::toy {

struct Parameters {
  unsigned steps = 4;
  unsigned bits = 30;
  float share = 0.5f;
  std::string order = "x";
  friend bool operator==(const Parameters&, const Parameters&) = default;
};

/// With what the last structure was built.
struct Seen {
  std::string builder;
  Parameters parameters;
} seen;

const StructureInfo& info_of(std::string_view name) {
  static std::map<std::string_view, StructureInfo> infos;
  StructureInfo& info = infos[name];
  info.name = name, info.builders = {"plain", "fancy"}, info.leaves = {"triangle1"};
  return info;
}

struct WithParameters {
  Parameters parameters;
};
struct Without {};

/// Kind 0 has parameters of its own; kind 1 has none, and does not say what it reads.
template <int Kind>
class Toy final : public Accel, public std::conditional_t<Kind == 0, WithParameters, Without> {
 public:
  [[nodiscard]] static const StructureInfo& static_info() { return info_of(Kind == 0 ? "toy" : "mute"); }
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  void build(const TriangleMesh&, const BuildSettings& settings, BuildReport&) override {
    seen = {settings.builder, {}};
    if constexpr (Kind == 0) seen.parameters = this->parameters;
  }
  [[nodiscard]] bool visit(StructureVisitor&) const override { return true; }
  [[nodiscard]] std::size_t bytes() const noexcept override { return 0; }
};

constexpr unsigned kBits[] = {30, 63};
constexpr std::string_view kOrders[] = {"x", "y"};
constexpr Parameter<Parameters> kOwn[] = {
    {.name = "toy_steps", .summary = "of a build", .member = &Parameters::steps, .limits = {1, 8}},
    {.name = "toy_bits", .summary = "of a code", .member = &Parameters::bits, .choices = kBits},
    {.name = "toy_share", .summary = "of all", .member = &Parameters::share, .limits = {0, 1}},
    {.name = "toy_order", .summary = "of axes", .member = &Parameters::order, .words = kOrders},
};
std::span<const Parameter<Parameters>> own_parameters(std::type_identity<Toy<0>>) { return kOwn; }
std::string_view builder_summary(std::type_identity<Toy<0>>, std::string_view builder) {
  return builder == "fancy" ? "with all that there is" : "";
}
std::vector<std::string_view> builder_parameters(std::type_identity<Toy<0>>, std::string_view builder) {
  if (builder == "fancy") return {"toy_steps", "toy_bits", "toy_share", "toy_order", "bins"};
  return {"toy_steps"};
}

}  // namespace arboretum::toy

namespace arboretum {

using All = TypeList<toy::Toy<0>, toy::Toy<1>, two_level::TwoLevel>;
std::vector<StructureEntry> registered_structures() { return structure_entries(All{}); }
std::vector<StructureBuilders> registered_builders() { return builders_entries(All{}); }
std::vector<KernelRow> registered_kernels() { return {}; }

}  // namespace arboretum

using namespace arboretum;
using namespace arboretum::test;

namespace {

using Values = std::map<std::string, ParameterValue, std::less<>>;

toy::Seen built(std::string_view structure, const std::string& builder, const BuilderParameters& parameters = {}) {
  BuildReport report;
  const TriangleMesh mesh = random_triangles(8, 0.1f, 1);
  const BuildSettings settings{.builder = builder, .leaf = "triangle1", .parameters = parameters};
  (void)build_structure(structure, mesh, settings, report);
  return toy::seen;
}

/// With `fancy`.
std::string refusal(const Values& own, std::string_view structure = "toy") {
  return error_of([&] { (void)built(structure, "fancy", {.own = own}); });
}

}  // namespace

TEST_CASE("own parameters are set, refused and shown as those that there are for all") {
  const std::vector<std::string> names = parameter_names();
  for (const char* name : {"toy_steps", "toy_bits", "toy_share", "toy_order"})
    CHECK(std::ranges::count(names, name) == 1);
  CHECK(default_parameter("toy_steps") == "4");
  CHECK(default_parameter("toy_share") == "0.5");
  CHECK(default_parameter("toy_order") == "x");
  CHECK(parameter_summary("toy_share") == "of all");
  CHECK(parameter_values("toy_steps") == "an integer from 1 to 8");

  Parameters parameters;
  CHECK(set_parameter(parameters, "toy_steps", "9") == "an integer from 1 to 8");
  CHECK(set_parameter(parameters, "toy_steps", "-1") == "an integer from 1 to 8");
  CHECK(set_parameter(parameters, "toy_steps", "auto") == "an integer from 1 to 8");
  CHECK(set_parameter(parameters, "toy_bits", "31") == "one of 30, 63");
  Parameters chosen;
  CHECK(set_parameter(chosen, "toy_bits", "63").empty());
  CHECK(parameter_text(chosen, "toy_bits") == "63");
  CHECK(set_parameter(parameters, "toy_share", "1.5") == "a number from 0 to 1");
  CHECK(set_parameter(parameters, "toy_share", "nan") == "a number from 0 to 1");
  CHECK(set_parameter(parameters, "toy_order", "z") == "one of x, y");
  CHECK(parameters == Parameters{});

  CHECK(set_parameter(parameters, "toy_steps", "4").empty());
  CHECK(parameters == Parameters{});  // a default asks for nothing
  CHECK(set_parameter(parameters, "toy_steps", "2").empty());
  CHECK(set_parameter(parameters, "toy_order", "y").empty());
  CHECK(parameter_text(parameters, "toy_steps") == "2");
  CHECK(parameter_text(parameters, "toy_order") == "y");
  CHECK(parameters.builder.own == Values{{"toy_order", "y"}, {"toy_steps", 2u}});
  reset_parameter(parameters.builder, "toy_order");
  CHECK(parameters.builder.own == Values{{"toy_steps", 2u}});

  const auto points = parameter_points({{"toy_steps", {"1", "4"}}, {"toy_share", {"0.25"}}});
  REQUIRE(points.size() == 2);
  CHECK(points[0].label == ":toy_steps=1");
  CHECK(points[0].parameters.builder.own == Values{{"toy_share", 0.25f}, {"toy_steps", 1u}});
  CHECK(points[1].parameters.builder.own == Values{{"toy_share", 0.25f}});
}

TEST_CASE("values arrive in the build") {
  CHECK(built("toy", "plain").parameters == toy::Parameters{});
  const toy::Seen all =
      built("toy", "fancy", {.own = {{"toy_order", "y"}, {"toy_share", 0.25f}, {"toy_steps", 2u}, {"toy_bits", 63u}}});
  CHECK(all.builder == "fancy");
  CHECK(all.parameters == toy::Parameters{2, 63, 0.25f, "y"});

  CHECK(refusal({{"toy_steps", 9u}}) == "toy_steps: 9 is not within 1 .. 8");
  CHECK(refusal({{"toy_bits", 31u}}) == "toy_bits: 31 is neither 30 nor 63");
  CHECK(refusal({{"toy_order", "z"}}) == "toy_order: 'z' is neither x nor y");
  CHECK(refusal({{"toy_share", std::numeric_limits<float>::quiet_NaN()}}) == "toy_share: nan is not within 0 .. 1");
  CHECK(refusal({{"toy_steps", "many"}}) == "toy_steps: 'many' is not a whole number");
  CHECK(refusal({{"toy_share", 1u}}) == "toy_share: '1' is not a number");
  CHECK(refusal({{"toy_order", 2u}}) == "toy_order: '2' is not a word");
  CHECK_THAT(refusal({{"toy_step", 2u}}), Catch::Contains("toy: ") && Catch::Contains("did you mean 'toy_steps'"));
  CHECK_THAT(refusal({{"toy_steps", 2u}}, "mute"), Catch::Contains("mute: it has no parameters of its own"));
  for (const char* structure : {"toy", "mute"})
    CHECK_THAT(refusal({{"bins", 8u}}, structure), Catch::Contains("set parameters.bins, not parameters.own"));
}

TEST_CASE("a structure that stands above others hands them on") {
  BuilderParameters below;
  below.below = "toy";
  CHECK(built("two_level", "plain", below).parameters == toy::Parameters{});
  below.own = {{"toy_steps", 3u}};
  const toy::Seen under = built("two_level", "fancy", below);
  CHECK(under.builder == "fancy");
  CHECK(under.parameters == toy::Parameters{.steps = 3});
  below.below = "mute";
  CHECK_THAT(error_of([&] { (void)built("two_level", "fancy", below); }),
             Catch::Contains("mute: it has no parameters of its own"));
}

TEST_CASE("who reads an own parameter, and what is said of builders") {
  const Registry registry = this_registry();
  CHECK(registry.reads("toy_steps", "toy", "plain", ""));
  CHECK(registry.reads("toy_share", "toy", "fancy", ""));
  CHECK_FALSE(registry.reads("toy_share", "toy", "plain", ""));
  CHECK(registry.reads("toy_share", "two_level", "fancy", "toy"));
  CHECK_FALSE(registry.reads("toy_share", "mute", "fancy", ""));  // it does not say, but cannot know it
  CHECK(registry.reads("bins", "mute", "fancy", ""));
  CHECK(registry.readers_of("toy_share") == "fancy (toy)");
  CHECK(registry.readers_of("bins") == "fancy (toy); mute");
  CHECK(summary_of(Axis::builder, "fancy", registry) == "with all that there is");
  CHECK(summary_of(Axis::builder, "plain", registry).empty());
  CHECK(summary_of(Axis::builder, "auto", registry) == "the first that the structure takes");
  CHECK_THAT(builder_summary("two_level", "ploc_reinsertion"), Catch::StartsWith("bottom-up") && Catch::Contains("; "));
}

TEST_CASE("parameters that nobody could read are refused: a set that is not declared, a name that there is not") {
  static_assert(HasParameters<toy::Toy<0>> && SaysParameters<toy::Toy<0>>);
  static_assert(HasParameters<toy::WithParameters> && !SaysParameters<toy::WithParameters>);  // would not compile
  static_assert(!HasParameters<toy::Toy<1>> && !SaysParameters<toy::Toy<1>>);

  StructureBuilders builders = *builders_of_structure("toy");
  const auto refused = [&] { return error_of([&] { check_names_read(toy::info_of("toy"), builders); }); };
  CHECK(refused().empty());
  builders.reads = [](std::string_view builder) -> std::vector<std::string_view> {
    if (builder == "fancy") return {"toy_steps", "bins", "toy_step"};
    return {"toy_steps"};
  };
  CHECK_THAT(refused(), Catch::StartsWith("toy: its builder fancy says that it reads an unknown parameter 'toy_step'; "
                                          "did you mean 'toy_steps'?"));
  builders.reads = [](std::string_view) -> std::vector<std::string_view> { return {"binz"}; };
  CHECK_THAT(refused(), Catch::StartsWith("toy: its builder plain says") && Catch::Contains("did you mean 'bins'?"));
}

TEST_CASE("a saved structure is found by its values") {
  const TriangleMesh mesh = random_triangles(8, 0.1f, 1);
  const BuildSettings plain{.builder = "fancy", .leaf = "triangle1", .parameters = {}};
  BuildSettings other = plain;
  other.parameters.own = {{"toy_steps", 2u}};
  CHECK(structure_file_name("toy", mesh, plain) != structure_file_name("toy", mesh, other));
}

TEST_CASE("own parameters that could not be told apart, or are not usable, are refused") {
  std::vector<OwnParameter> all;
  const auto refused = [&](const OwnParameter& one) {
    return error_of([&] { add_own_parameters("mine", std::span(&one, 1), all); });
  };
  const OwnParameter good{"mine", "", 4u, {1, 8}};
  CHECK(refused(good).empty());
  CHECK(refused(good).empty());  // of several structures of a folder
  CHECK(all.size() == 1);
  CHECK(refused({"mine", "", 4u, {1, 9}}) ==
        "mine: its parameter mine is another structure's too, with another default or other limits; call it otherwise");
  CHECK_THAT(refused({"bins", "", 4u, {1, 9}}), Catch::Contains("there for all"));
  CHECK_THAT(refused({"hybrid_threshold", "", 4u, {1, 9}}), Catch::Contains("there for all"));
  CHECK_THAT(refused({"a:b", "", 4u, {1, 9}}), Catch::Contains("part of cell names"));
  CHECK_THAT(refused({"far", "", 10u, {1, 9}}), Catch::EndsWith("far: 10 is not within 1 .. 9"));
  CHECK_THAT(refused({"word", "", std::string("x")}), Catch::Contains("`words`"));
  CHECK(all.size() == 1);
}
