// Builder parameters that a structure has of its own, beside BuilderParameters: its folder alone declares them, in
// <name>_parameters.h, as the members of a struct that the class has as `parameters` (docs/add-a-structure.md).
// A build takes their values from BuilderParameters::own; Accel::build() finds them in `parameters`.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "structures/accel.h"
#include "structures/parameter_limits.h"

namespace arboretum {

/// Adds what a structure has, each name once. Throws UserError for one that has the name of another with other limits,
/// other words or another default, for names that cannot be part of a cell's, and for a default out of its limits.
void add_own_parameters(std::string_view structure, std::span<const OwnParameter> own, std::vector<OwnParameter>& all);
/// Those of every structure of this executable, in the structures' order. Throws UserError as above, and as
/// check_names_read() (parameters_read.h).
[[nodiscard]] std::span<const OwnParameter> all_own_parameters();
/// nullptr where there is none of that name.
[[nodiscard]] const OwnParameter* find_own_parameter(std::string_view name);
/// Whether the structure declares it.
[[nodiscard]] bool has_own_parameter(std::string_view structure, std::string_view name);

/// A structure that is not built yet, with the values that `parameters.own` has for it. Throws UserError for a value of
/// another type or out of its limits, and for one that the structure does not have, unless it stands above another,
/// which then must have it.
[[nodiscard]] std::unique_ptr<Accel> create_structure(const StructureEntry& entry, const BuilderParameters& parameters);

}  // namespace arboretum
