#include "structures/parameter_limits.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <iterator>

#include "core/error.h"
#include "structures/bvh/bvh.h"

namespace arboretum {
namespace {

constexpr std::array<unsigned, 2> kMortonBits{30, 63};
constexpr std::array<std::string_view, 2> kCollapses{"optimal", "greedy"};
constexpr ParameterLimits kCosts{1e-3, 1e3};

using B = BuilderParameters;
constexpr Parameter<B> kBuilderTable[] = {
    {.name = "bins", .summary = "binned SAH: bins an axis", .member = &B::bins, .limits = {4, 64}},
    {.name = "traversal_cost",
     .summary = "cost of a node visit, in units of one block test",
     .member = &B::traversal_cost,
     .limits = kCosts},
    {.name = "intersection_cost",
     .summary = "cost of testing one leaf block",
     .member = &B::intersection_cost,
     .limits = kCosts},
    {.name = "max_leaf_blocks",
     .summary = "leaf blocks in a leaf at most",
     .member = &B::max_leaf_blocks,
     .limits = {1, bvh::kMaxLeafBlocks}},
    {.name = "morton_bits",
     .summary = "bits of a Morton code",
     .member = &B::morton_bits,
     .limits = {30, 63},
     .choices = kMortonBits},
    {.name = "ploc_radius",
     .summary = "neighbours looked at on each side",
     .member = &B::ploc_radius,
     .limits = {1, kMostPlocRadius}},
    {.name = "duplication_budget",
     .summary = "references added at most, as a share of the triangles",
     .member = &B::duplication_budget,
     .limits = {0, 4}},
    {.name = "spatial_overlap",
     .summary = "least overlap of an object split for a spatial one to be tried, and least area that a reference more "
                "must save: shares of the root's area",
     .member = &B::spatial_overlap,
     .limits = {0, 1}},
    {.name = "spatial_gain",
     .summary = "a share x of references more must lower the estimated cost by (1 - this) x",
     .member = &B::spatial_gain,
     .limits = {0.01, 1}},
    {.name = "reinsertion_rounds",
     .summary = "builders that end in _reinsertion: passes over the tree",
     .member = &B::reinsertion_rounds,
     .limits = {1, 64}},
    {.name = "reinsertion_top",
     .summary = "how many of the tree's largest nodes the builder ends by reinserting; auto: 512 after binned_sah, "
                "sweep_sah and spatial_sah, else none",
     .member = &B::reinsertion_top,
     .limits = {0, 65536},
     .has_own = true},
    {.name = "empty_bonus",
     .summary = "share of the cost taken off a split that cuts away empty space",
     .member = &B::empty_bonus,
     .limits = {0, 0.95}},
    {.name = "max_depth",
     .summary = "deepest leaf; 0: 8 + 1.3 log2 n for the kdtree, 21 for the octree, whose end that is",
     .member = &B::max_depth,
     .limits = {0, 63}},  // an octree's end at 21
    {.name = "grid_density", .summary = "cells a triangle", .member = &B::grid_density, .limits = {0.01, 64}},
    {.name = "below", .summary = "the structure of each prototype", .member = &B::below},
    {.name = "collapse",
     .summary = "binary to N-wide: by dynamic programming, or the largest area first",
     .member = &B::collapse,
     .words = kCollapses},
};

constexpr std::array<std::string_view, 3> kHybrids{"hybrid4", "hybrid8", "hybrid16"};
constexpr std::array<std::string_view, 1> kQueued{"queued"};

using S = TraversalSettings;
constexpr Parameter<S> kTraversalTable[] = {
    {.name = "hybrid_threshold",
     .summary = "so many rays of a packet in a node, or fewer, go on alone; 0: none ever",
     .member = &S::hybrid_threshold,
     .limits = {0, S::kWidestHybrid},
     .traversals = kHybrids},
    {.name = "rays_in_flight",
     .summary = "rays on their way at once",
     .member = &S::rays_in_flight,
     .limits = {1, S::kMostInFlight},
     .traversals = kQueued},
};

constexpr std::size_t kBuilderMembers = 17, kTraversalMembers = 2;
/// The compiler refuses these where a struct has another number of members.
[[maybe_unused]] void bind_all(const B& parameters) {
  [[maybe_unused]] const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, own] = parameters;
}
[[maybe_unused]] void bind_all(const S& settings) { [[maybe_unused]] const auto& [a, b] = settings; }
static_assert(std::size(kBuilderTable) == kBuilderMembers - 1 && std::size(kTraversalTable) == kTraversalMembers,
              "each member has a row, but for `own`");
static_assert(B::kOwn == S::kOwn);
static_assert(std::ranges::none_of(kTraversalTable, [](const Parameter<S>& p) { return p.traversals.empty(); }),
              "each names the ways of traversal that read it");

template <class T>
requires std::is_arithmetic_v<T> std::string shown(T value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}
std::string shown(std::string_view word) { return std::string(word); }

template <class T>
void require(std::string_view parameter, T value, const ParameterLimits& limits) {
  if (limits.hold(value)) return;
  throw UserError(std::string(parameter) + ": " + shown(value) + " is not within " + shown(limits.low) + " .. " +
                  shown(limits.high));
}

/// `value`, of which `text` is said, must be one of `choices`.
template <class T, class Choice>
void require_one(std::string_view parameter, const T& value, const std::string& text, std::span<const Choice> choices) {
  if (std::ranges::find(choices, value) != choices.end()) return;
  std::string all;
  for (const Choice& choice : choices) all += (all.empty() ? "neither " : " nor ") + shown(choice);
  throw UserError(std::string(parameter) + ": " + text + " is " + all);
}

template <class Row, class T>
void check_value(const Row& parameter, const T& value) {
  if constexpr (std::is_same_v<T, std::string>) {
    if (!parameter.words.empty()) require_one(parameter.name, value, "'" + value + "'", parameter.words);
  } else {
    if constexpr (std::is_same_v<T, unsigned>) {
      if (!parameter.choices.empty()) return require_one(parameter.name, value, shown(value), parameter.choices);
    }
    require(parameter.name, value, parameter.limits);
  }
}

template <class Set, class T>
bool is_own_choice(const Parameter<Set>& parameter, const T& value) {
  if constexpr (std::is_same_v<T, unsigned>) {
    return parameter.has_own && value == Set::kOwn;
  } else {
    return false;
  }
}

template <class Set>
void check(std::span<const Parameter<Set>> table, const Set& set) {
  for (const Parameter<Set>& parameter : table) {
    const auto one = [&](auto member) {
      if (is_own_choice(parameter, set.*member)) return;
      check_value(parameter, set.*member);
    };
    std::visit(one, parameter.member);
  }
}

}  // namespace

std::span<const Parameter<BuilderParameters>> builder_parameter_table() noexcept { return kBuilderTable; }
std::span<const Parameter<TraversalSettings>> traversal_setting_table() noexcept { return kTraversalTable; }

void check_parameters(const BuilderParameters& parameters) { check(builder_parameter_table(), parameters); }
void check_settings(const TraversalSettings& settings) { check(traversal_setting_table(), settings); }

bool operator==(const OwnParameter& a, const OwnParameter& b) noexcept {
  return a.name == b.name && a.initial == b.initial && a.limits.low == b.limits.low && a.limits.high == b.limits.high &&
         std::ranges::equal(a.choices, b.choices) && std::ranges::equal(a.words, b.words);
}

void check_parameter(const OwnParameter& parameter, const ParameterValue& value) {
  constexpr std::string_view kTypes[] = {"a whole number", "a number", "a word"};
  if (value.index() != parameter.initial.index())
    throw UserError(std::string(parameter.name) + ": '" + text_of(value) + "' is not " +
                    std::string(kTypes[parameter.initial.index()]));
  std::visit([&](const auto& v) { check_value(parameter, v); }, value);
}

std::string text_of(const ParameterValue& value) {
  return std::visit([](const auto& v) { return shown(v); }, value);
}

void require_within(std::string_view parameter, unsigned value, const ParameterLimits& limits) {
  require(parameter, value, limits);
}

void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most) {
  if (triangles <= most) return;
  throw UserError(std::string(structure) + " takes at most 2^" + std::to_string(std::bit_width(most)) +
                  " - 1 triangles");
}

}  // namespace arboretum
