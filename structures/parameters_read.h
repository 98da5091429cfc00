// What a structure's builder reads of BuilderParameters: a parameter that it does not read makes no other structure of
// it.
//
// A structure says so beside itself: structures/<folder>/<name>_parameters.h declares, in the structure's namespace,
//   std::vector<std::string_view> builder_parameters(std::type_identity<Structure>, std::string_view builder);
// with the names of the members that a build with `builder` reads. One that has no such header counts as reading all.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace arboretum {

/// Names of the parameters that a build of `structure` with `builder` reads, each once; where the structure takes one
/// below it, those that `below` reads with the same builder included. nullopt: it does not say, and may read all. None
/// for a structure that is not there.
[[nodiscard]] std::optional<std::vector<std::string_view>> parameters_read(std::string_view structure,
                                                                           std::string_view builder,
                                                                           std::string_view below = {});

}  // namespace arboretum
