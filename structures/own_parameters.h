// Builder parameters that a structure has of its own, beside BuilderParameters: its folder alone declares them, in
// <name>_parameters.h, as the members of a struct that the class has as `parameters` (docs/add-a-structure.md).
//
// On the way to a build their values stand behind the builder's name, as in the names of cells: BuildSettings::builder
// may be "mesh_order:run_length=2". What is not named keeps its default. Accel::build() finds the values in
// `parameters`, and the builder's name alone.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "structures/accel.h"
#include "structures/parameter_limits.h"

namespace arboretum {

/// Values other than the defaults, by name.
using OwnValues = std::map<std::string, ParameterValue, std::less<>>;

/// Adds what a structure has, each name once. Throws UserError for one that has the name of another with other limits,
/// other words or another default, for names that cannot be part of a cell's, and for a default out of its limits.
void add_own_parameters(std::string_view structure, std::span<const OwnParameter> own, std::vector<OwnParameter>& all);
/// Those of every structure of this executable, in the structures' order. Throws UserError as above.
[[nodiscard]] std::span<const OwnParameter> all_own_parameters();
/// nullptr where there is none of that name.
[[nodiscard]] const OwnParameter* find_own_parameter(std::string_view name);
/// Whether the structure declares it.
[[nodiscard]] bool has_own_parameter(std::string_view structure, std::string_view name);

[[nodiscard]] std::string text_of(const ParameterValue& value);
/// The value that `text` is, whatever its limits; nothing where it is none of the parameter's type.
[[nodiscard]] std::optional<ParameterValue> read_value(const OwnParameter& parameter, std::string_view text);
/// "mesh_order:run_length=2": what BuildSettings::builder takes.
[[nodiscard]] std::string with_values(std::string_view builder, const OwnValues& values);
/// The builder's name, without values that stand behind it.
[[nodiscard]] std::string_view builder_of(std::string_view with_values) noexcept;

/// A structure that is not built yet, with the values that stand behind the name of settings.builder; they are taken
/// away there, but for those that a structure which stands above another leaves to that one. Throws UserError for a
/// value out of its limits, and for one that the structure does not have.
[[nodiscard]] std::unique_ptr<Accel> create_structure(const StructureEntry& entry, BuildSettings& settings);

}  // namespace arboretum
