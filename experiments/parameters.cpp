#include "experiments/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <span>

#include "structures/parameter_limits.h"

namespace arboretum {
namespace {

struct Field {
  std::string_view name;
  ParameterLimits limits = {};
  unsigned BuilderParameters::*integer = nullptr;
  unsigned TraversalSettings::*setting = nullptr;  ///< of a way of traversal
  float BuilderParameters::*real = nullptr;
  std::string BuilderParameters::*word = nullptr;
  std::span<const std::string_view> words = {};
  std::span<const unsigned> choices = {};  ///< of an integer that may take no other value between low and high
  bool has_own = setting != nullptr;       ///< `auto` is a value, and the default

  /// Where has_own.
  [[nodiscard]] unsigned& of(Parameters& all) const { return setting ? all.traversal.*setting : all.builder.*integer; }
};

constexpr std::string_view kOwn = "auto";  ///< the builder's or the way of traversal's own choice
static_assert(BuilderParameters::kOwn == TraversalSettings::kOwn);

/// What may stand below another structure, and what cannot: the plan says why not.
std::span<const std::string_view> structure_names() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const StructureEntry& e : all_structures()) list.push_back(e.info.name);
    return list;
  }();
  return names;
}

const std::vector<Field>& fields() {
  static const std::vector<Field> table{
      {.name = "bins", .limits = kBuilderLimits.bins, .integer = &BuilderParameters::bins},
      {.name = "traversal_cost", .limits = kBuilderLimits.traversal_cost, .real = &BuilderParameters::traversal_cost},
      {.name = "intersection_cost",
       .limits = kBuilderLimits.intersection_cost,
       .real = &BuilderParameters::intersection_cost},
      {.name = "max_leaf_blocks",
       .limits = kBuilderLimits.max_leaf_blocks,
       .integer = &BuilderParameters::max_leaf_blocks},
      {.name = "morton_bits",
       .limits = kBuilderLimits.morton_bits,
       .integer = &BuilderParameters::morton_bits,
       .choices = kMortonBits},
      {.name = "ploc_radius", .limits = kBuilderLimits.ploc_radius, .integer = &BuilderParameters::ploc_radius},
      {.name = "duplication_budget",
       .limits = kBuilderLimits.duplication_budget,
       .real = &BuilderParameters::duplication_budget},
      {.name = "spatial_overlap",
       .limits = kBuilderLimits.spatial_overlap,
       .real = &BuilderParameters::spatial_overlap},
      {.name = "spatial_gain", .limits = kBuilderLimits.spatial_gain, .real = &BuilderParameters::spatial_gain},
      {.name = "reinsertion_rounds",
       .limits = kBuilderLimits.reinsertion_rounds,
       .integer = &BuilderParameters::reinsertion_rounds},
      {.name = "reinsertion_top",
       .limits = kBuilderLimits.reinsertion_top,
       .integer = &BuilderParameters::reinsertion_top,
       .has_own = true},
      {.name = "empty_bonus", .limits = kBuilderLimits.empty_bonus, .real = &BuilderParameters::empty_bonus},
      {.name = "max_depth", .limits = kBuilderLimits.max_depth, .integer = &BuilderParameters::max_depth},
      {.name = "grid_density", .limits = kBuilderLimits.grid_density, .real = &BuilderParameters::grid_density},
      {.name = "below", .word = &BuilderParameters::below, .words = structure_names()},
      {.name = "collapse", .word = &BuilderParameters::collapse, .words = kCollapses},
      {.name = "hybrid_threshold",
       .limits = kTraversalLimits.hybrid_threshold,
       .setting = &TraversalSettings::hybrid_threshold},
      {.name = "rays_in_flight",
       .limits = kTraversalLimits.rays_in_flight,
       .setting = &TraversalSettings::rays_in_flight},
  };
  return table;
}

const Field& field(std::string_view name) {
  return *std::ranges::find_if(fields(), [&](const Field& f) { return f.name == name; });
}

std::string expectation(const Field& f) {
  if (f.word) return fmt::format("one of {}", fmt::join(f.words, ", "));
  if (!f.choices.empty()) return fmt::format("one of {}", fmt::join(f.choices, ", "));
  if (f.has_own) return fmt::format("{} or an integer from {} to {}", kOwn, f.limits.low, f.limits.high);
  return fmt::format("{} from {} to {}", f.integer ? "an integer" : "a number", f.limits.low, f.limits.high);
}

template <class T>
bool parse_within(const std::string& text, const ParameterLimits& limits, T& out) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !limits.hold(value)) return false;
  out = value;
  return true;
}

}  // namespace

std::vector<std::string> parameter_names() {
  std::vector<std::string> names;
  for (const Field& f : fields()) names.emplace_back(f.name);
  return names;
}

std::string default_parameter(std::string_view name) {
  const BuilderParameters defaults;
  const Field& f = field(name);
  if (f.has_own) return std::string(kOwn);
  if (f.word) return defaults.*f.word;
  return f.integer ? fmt::format("{}", defaults.*f.integer) : fmt::format("{}", defaults.*f.real);
}

std::string set_parameter(Parameters& all, std::string_view name, const std::string& value) {
  const Field& f = field(name);
  BuilderParameters& parameters = all.builder;
  bool done = false;
  if (f.has_own) {
    unsigned& setting = f.of(all);
    done = value == kOwn || parse_within(value, f.limits, setting);
    if (value == kOwn) setting = BuilderParameters::kOwn;
  } else if (f.word) {
    done = std::ranges::find(f.words, value) != f.words.end();
    if (done) parameters.*f.word = value;
  } else if (!f.choices.empty()) {
    unsigned chosen = 0;
    done = parse_within(value, f.limits, chosen) && std::ranges::find(f.choices, chosen) != f.choices.end();
    if (done) parameters.*f.integer = chosen;
  } else {
    done = f.integer ? parse_within(value, f.limits, parameters.*f.integer)
                     : parse_within(value, f.limits, parameters.*f.real);
  }
  return done ? std::string() : expectation(f);
}

bool is_of_traversal(std::string_view name) { return field(name).setting != nullptr; }

bool concerns(std::string_view name, std::string_view traversal) {
  return name == "hybrid_threshold" ? traversal.starts_with("hybrid")
                                    : name == "rays_in_flight" && traversal == "queued";
}

void reset_parameter(BuilderParameters& parameters, std::string_view name) {
  const BuilderParameters defaults;
  const Field& f = field(name);
  if (f.integer) parameters.*f.integer = defaults.*f.integer;
  if (f.real) parameters.*f.real = defaults.*f.real;
  if (f.word) parameters.*f.word = defaults.*f.word;
}

void drop_label(std::string& label, std::string_view name) {
  const std::size_t begin = label.find(fmt::format(":{}=", name));
  if (begin == std::string::npos) return;
  const std::size_t end = label.find(':', begin + 1);
  label.erase(begin, end == std::string::npos ? end : end - begin);
}

std::vector<ParameterPoint> parameter_points(const ParameterSweep& sweep) {
  std::vector<ParameterPoint> points(1);
  for (const auto& [name, values] : sweep) {
    std::vector<ParameterPoint> next;
    for (const ParameterPoint& point : points) {
      for (const std::string& value : values) {
        next.push_back(point);
        (void)set_parameter(next.back().parameters, name, value);
        if (values.size() > 1)
          (is_of_traversal(name) ? next.back().traversal_label : next.back().label) += ":" + name + "=" + value;
      }
    }
    points = std::move(next);
  }
  return points;
}

}  // namespace arboretum
