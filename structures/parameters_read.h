// What a structure says of its builders: the line on each, and what they read of the parameters. A parameter that a
// builder does not read makes no other structure of it.
//
// A structure says so beside itself: structures/<folder>/<name>_parameters.h declares, in the structure's namespace, of
//   std::vector<std::string_view> builder_parameters(std::type_identity<Structure>, std::string_view builder);
//   std::string_view builder_summary(std::type_identity<Structure>, std::string_view builder);
//   std::span<const Parameter<Set>> own_parameters(std::type_identity<Structure>);
// those that it has something to say in: the names of the parameters that a build with `builder` reads (without it the
// structure counts as reading all), one line on each builder of its own (builders of binary trees have theirs), and the
// parameters that it has beside BuilderParameters (own_parameters.h), Set being the type of Structure::parameters.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace arboretum {

struct StructureBuilders;
struct StructureInfo;

/// Throws UserError for a name that a builder of the structure says it reads, and that no parameter has, be it of
/// BuilderParameters or the structure's own: it would never be read.
void check_names_read(const StructureInfo& info, const StructureBuilders& builders);

/// What the structure declares; nullptr where there is no such structure. Throws UserError as above, whichever
/// structure of the executable it is.
[[nodiscard]] const StructureBuilders* builders_of_structure(std::string_view structure);

/// Names of the parameters that a build of `structure` with `builder` reads, each once; where the structure takes one
/// below it, those that `below` reads with the same builder included. nullopt: it does not say, and may read all. None
/// for a structure that is not there.
[[nodiscard]] std::optional<std::vector<std::string_view>> parameters_read(std::string_view structure,
                                                                           std::string_view builder,
                                                                           std::string_view below = {});

/// One line for `list`: what the structure says of its builder, else what is said of the builder of binary trees that
/// has the name. Empty where nobody says.
[[nodiscard]] std::string builder_summary(std::string_view structure, std::string_view builder);

}  // namespace arboretum
