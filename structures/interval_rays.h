// What the structures have in common whose planes bound a ray's interval of t on one axis at a time (kd-tree, BIH).
#pragma once

#include <string_view>

namespace arboretum {

/// Their StructureInfo::no_streams.
inline constexpr std::string_view kNoStreamsOfIntervals =
    "not built: a stream's stack holds a node and a mask of its rays; here each ray has an interval of t of its "
    "own in every node, which the stack would have to hold for each of them";

}  // namespace arboretum
