// Builder parameters by name: what the YAML's `parameters:` may hold, one table for reading, defaults and
// cell names.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "structures/accel.h"

namespace arboretum {

/// Values to sweep of each parameter that the configuration names, as written.
using ParameterSweep = std::map<std::string, std::vector<std::string>>;

[[nodiscard]] std::vector<std::string> parameter_names();
/// The default as text.
[[nodiscard]] std::string default_parameter(std::string_view name);
/// Sets one parameter. Returns why not ("an integer from 4 to 64"), or empty when it is set.
[[nodiscard]] std::string set_parameter(BuilderParameters& parameters, std::string_view name,
                                        const std::string& value);

/// One point of a sweep. `label` names what is swept (more than one value): ":bins=16:collapse=greedy".
struct ParameterPoint {
  BuilderParameters parameters;
  std::string label;
};
/// The product of all lists; one point with the defaults for an empty sweep. The values must have been
/// accepted by set_parameter.
[[nodiscard]] std::vector<ParameterPoint> parameter_points(const ParameterSweep& sweep);

}  // namespace arboretum
