// Parameters by name, of builders, a structure's own among them, and of ways of traversal: what the YAML's
// `parameters:` may hold, one table for reading, defaults and cell names.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/ray.h"
#include "structures/accel.h"

namespace arboretum {

/// Values to sweep of each parameter that the configuration names, as written.
using ParameterSweep = std::map<std::string, std::vector<std::string>>;

struct Parameters {
  BuilderParameters builder;
  TraversalSettings traversal;
  friend bool operator==(const Parameters&, const Parameters&) = default;
};

[[nodiscard]] std::vector<std::string> parameter_names();
/// The default as text.
[[nodiscard]] std::string default_parameter(std::string_view name);
/// A value as text, "auto" where the builder or the way of traversal chooses itself.
[[nodiscard]] std::string parameter_text(const Parameters& parameters, std::string_view name);
/// Sets one parameter. Returns why not ("an integer from 4 to 64"), or empty when it is set.
[[nodiscard]] std::string set_parameter(Parameters& parameters, std::string_view name, const std::string& value);
/// The ways of traversal that read it; none for a builder's parameter, whose readers the registry knows.
[[nodiscard]] std::span<const std::string_view> traversals_reading(std::string_view name);
[[nodiscard]] bool is_of_traversal(std::string_view name);
[[nodiscard]] bool concerns(std::string_view name, std::string_view traversal);
/// What a value may be, in words: "an integer from 4 to 64"; and what a parameter means, in one line.
[[nodiscard]] std::string parameter_values(std::string_view name);
[[nodiscard]] std::string_view parameter_summary(std::string_view name);
/// Sets a parameter to its default, where it is one of these.
void reset_parameter(BuilderParameters& parameters, std::string_view name);
void reset_parameter(TraversalSettings& settings, std::string_view name);
/// Takes ":name=value" out of a label.
void drop_label(std::string& label, std::string_view name);

/// One point of a sweep. The labels name what is swept (more than one value): ":bins=16:collapse=greedy".
struct ParameterPoint {
  Parameters parameters;
  std::string label;            ///< of the builder's
  std::string traversal_label;  ///< of the way of traversal's
};
/// The product of all lists; one point with the defaults for an empty sweep. The values must have been
/// accepted by set_parameter.
[[nodiscard]] std::vector<ParameterPoint> parameter_points(const ParameterSweep& sweep);

}  // namespace arboretum
