#include "experiments/axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <utility>

#include "experiments/call_axis.h"
#include "experiments/rendered_rays.h"
#include "intersectors/promises.h"
#include "oracle/hard_rays.h"
#include "rendering/hard_workload.h"

namespace arboretum {
namespace {

struct Summary {
  std::string_view key, line;
};

/// Others stand beside the builders (structures/parameters_read.h); Embree's are here because configurations may name
/// them where its library is missing.
constexpr Summary kBuilders[] = {
    {"low", "Embree's low quality (Morton)"},
    {"medium", "Embree's medium quality (binned SAH)"},
    {"high", "Embree's high quality (spatial splits)"},
    {"auto", "the first that the structure takes"},
    {"all", "each that the structure takes, a cell for each"},
};
constexpr Summary kTraversals[] = {
    {"single", "one ray at a time, boxes and triangles in the lanes"},
    {"queued", "32 rays in flight (any hit: 64), their next steps in queues"},
    {"packet", "rays in the lanes, as many as the instruction set has"},
    {"hybrid", "packets that fall apart into single rays, as wide as the instruction set"},
    {"stream",
     "groups of up to 64 rays of an octant share nodes, each with a mask of its rays; of embree its own, with its "
     "coherent flag for primary rays alone"},
    {"stream_sorted", "stream, of rays sorted by octant and origin within the measured time"},
    {"stream_coherent", "Embree's stream of single rays, always with its coherent flag"},
    {"stream_incoherent", "Embree's stream of single rays, never with its coherent flag"},
    {"stream_lists", "groups of 1024 rays go down together, sorted into a list for each child"},
    {"auto",
     "looks at the rays, tile by tile: packets of 64 where they hold together, else streams in the wide BVHs (on SSE "
     "rays in flight where they share too little, with four or eight children), rays in flight in kdtree and octree, "
     "hybrid16 in two_level (single rays on SSE), single rays in bih and grid"},
};
constexpr Summary kCallSummaries[] = {
    {"batch", "all rays in one call"},
    {"packet", "a call for each packet of the traversal's width (packetN, hybridN)"},
    {"ray", "a call for each ray (single rays, packets, hybrids, auto)"},
};
constexpr Summary kIsas[] = {
    {"scalar", "no vector instructions: the reference that every machine runs"},
    {"sse", "SSE4.2, four lanes"},
    {"avx2", "AVX2, FMA and BMI, eight lanes (avx is a synonym)"},
    {"avx512", "AVX-512 F, VL, DQ and BW, sixteen lanes"},
};
constexpr Summary kWorkloads[] = {
    {"primary", "closest hit, one ray a pixel from the camera"},
    {"shadow", "any hit, from the primary hits towards a point light"},
    {"ambient_occlusion", "any hit, from the primary hits, cosine-distributed, length 0.2 of the diagonal"},
    {"reflection", "closest hit, from the primary hits along the mirror direction"},
    {"diffuse", "closest hit, from the primary hits, cosine-distributed"},
    {"random", "closest hit, between two uniform points of the bounding sphere"},
    {"whitted", "a picture by Whitted's method, shading included: direct light, mirrors, glass"},
    {"path", "a picture by path tracing, shading included"},
    {"hard", "closest hit, all kinds of hard rays but `far` in turn: what accuracy is measured by"},
    {"camera_edges", "closest hit, from the camera at edges and vertices: a picture of leaks"},
};

/// Of hard_KIND, in the order of HardKind.
constexpr std::string_view kHardKinds[] = {
    "aimed at vertices, every fourth exactly",
    "aimed at edges that two triangles share",
    "aimed at edges of one triangle, or of more than two",
    "aimed at points within triangles",
    "nearly in a triangle's plane",
    "along an axis, through vertices, edges and triangles",
    "in the planes of box faces",
    "from points of triangles, or off them by their rounding",
    "from 4 to 2^27 scene radii away",
    "with tnear or tfar at the hit",
};
static_assert(std::size(kHardKinds) == static_cast<std::size_t>(HardKind::invalid), "a kind of ray without a summary");

std::string_view look_up(std::span<const Summary> table, std::string_view key) {
  for (const Summary& s : table)
    if (s.key == key) return s.line;
  return {};
}

/// Splits `packet16` into `packet` and `16`.
std::pair<std::string_view, std::string_view> split_number(std::string_view name) {
  std::size_t end = name.size();
  while (end > 0 && std::isdigit(static_cast<unsigned char>(name[end - 1]))) --end;
  return {name.substr(0, end), name.substr(end)};
}

std::string leaf_summary(std::string_view leaf) {
  if (leaf == kAuto) return "the block that suits structure, intersector and instruction set";
  if (!leaf.starts_with("triangle")) return {};
  constexpr std::pair<char, std::string_view> kForms[] = {{'v', "three vertices"},
                                                          {'i', "indices of vertices"},
                                                          {'w', "the map to the unit triangle (baldwin_weber)"},
                                                          {'h', "three planes (havel_herout)"},
                                                          {'p', "a plane and two projected edges (wald_projection)"},
                                                          {'a', "a vertex and edges, as array of structures"}};
  std::string_view rest = leaf.substr(8);
  std::string_view what = "a vertex and precomputed edges";
  for (const auto& [suffix, form] : kForms) {
    if (!rest.ends_with(suffix)) continue;
    what = form, rest.remove_suffix(1);
    break;
  }
  if (rest.empty() || split_number(rest).second != rest) return {};
  return "blocks of " + std::string(rest) + (rest == "1" ? " triangle: " : " triangles: ") + std::string(what);
}

std::string traversal_summary(std::string_view traversal) {
  if (const auto line = look_up(kTraversals, traversal); !line.empty()) return std::string(line);
  for (std::string_view flag : {"_coherent", "_incoherent"}) {
    if (!traversal.ends_with(flag)) continue;
    const std::string plain = traversal_summary(traversal.substr(0, traversal.size() - flag.size()));
    return plain +
           (flag == "_coherent" ? ", always with Embree's coherent flag" : ", never with Embree's coherent flag");
  }
  const auto [kind, number] = split_number(traversal);
  if (kind == "packet") return "packets of " + std::string(number) + " rays";
  if (kind == "hybrid") return "packets of " + std::string(number) + " rays that fall apart into single rays";
  if (kind == "queued") return std::string(number) + " rays in flight";
  return {};
}

void append_new(std::vector<std::string>& list, std::string_view value) {
  if (std::ranges::find(list, value) == list.end()) list.emplace_back(value);
}

/// Where structures say different things of builders of one name, all of them.
std::string builder_summary_of(std::string_view builder, const Registry& registry) {
  std::vector<std::string> lines;
  if (const std::string_view line = look_up(kBuilders, builder); !line.empty()) lines.emplace_back(line);
  for (const StructureEntry& e : registry.structures) {
    const auto& takes = e.info.builders;
    if (!registry.builder_summary || e.info.takes_below || std::ranges::find(takes, builder) == takes.end()) continue;
    if (const std::string line = registry.builder_summary(e.info.name, builder); !line.empty()) append_new(lines, line);
  }
  return fmt::format("{}", fmt::join(lines, "; "));
}

std::string workload_summary(std::string_view workload) {
  constexpr std::string_view kPrefix = "hard_";
  for (std::size_t k = 0; workload.starts_with(kPrefix) && k < std::size(kHardKinds); ++k)
    if (workload.substr(kPrefix.size()) == kHardKindNames[k]) return "closest hit, " + std::string(kHardKinds[k]);
  return std::string(look_up(kWorkloads, workload));
}

}  // namespace

std::optional<Axis> parse_axis(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (kAxisNames[i] == name) return static_cast<Axis>(i);
  return std::nullopt;
}

std::vector<std::string> known_values(Axis axis, const Registry& registry) {
  std::vector<std::string> list;
  switch (axis) {
    case Axis::structure:
      for (const StructureEntry& e : registry.structures) append_new(list, e.info.name);
      append_new(list, "embree");
      break;
    case Axis::builder:
      for (const StructureEntry& e : registry.structures)
        for (std::string_view builder : e.info.builders) append_new(list, builder);
      for (std::string_view builder : {"low", "medium", "high"}) append_new(list, builder);
      append_new(list, kAuto);
      append_new(list, kAll);
      break;
    case Axis::leaf:
      for (const StructureEntry& e : registry.structures)
        for (std::string_view leaf : e.info.leaves) append_new(list, leaf);
      for (const KernelRow& row : registry.kernels) append_new(list, row.leaf);
      append_new(list, kAuto);
      break;
    case Axis::intersector:
      for (const KernelRow& row : registry.kernels) append_new(list, row.intersector);
      break;
    case Axis::box:
      for (const KernelRow& row : registry.kernels) append_new(list, row.box);
      append_new(list, kAuto);
      break;
    case Axis::traversal:
      for (const KernelRow& row : registry.kernels) append_new(list, row.traversal);
      // Embree's, where it or an instruction set is missing: a configuration that names them is right all the same.
      for (std::string_view way : {"packet4", "packet8", "packet16", "stream"})
        for (std::string_view flag : {"_coherent", "_incoherent"}) append_new(list, std::string(way).append(flag));
      for (std::string_view family : {"packet", "hybrid"}) {
        if (std::ranges::any_of(list, [&](const std::string& t) { return split_number(t).first == family; })) {
          append_new(list, family);
        }
      }
      break;
    case Axis::call:
      for (std::string_view call : kCalls) append_new(list, call);
      break;
    case Axis::isa:
      for (Isa isa : kAllIsas) append_new(list, to_string(isa));
      break;
    case Axis::workload:
      for (std::string_view name : workload_names()) append_new(list, name);
      for (std::string_view name : rendered_workload_names()) append_new(list, name);
      for (std::string_view name : hard_workload_names()) append_new(list, name);
      break;
    case Axis::threads: break;
  }
  std::erase(list, std::string(kNone));
  return list;
}

namespace {

std::string_view intersector_summary(std::string_view name) {
  for (const IntersectorPromise& i : kIntersectorPromises)
    if (i.intersector == name) return i.summary;
  return {};
}

std::string_view box_summary(std::string_view name) {
  for (const BoxPromise& b : kBoxPromises)
    if (b.box == name) return b.summary;
  if (name == "auto")
    return "padded for intersectors that promise to lose no hit, fast for moller_trumbore and its like";
  return {};
}

}  // namespace

std::string summary_of(Axis axis, std::string_view value, const Registry& registry) {
  switch (axis) {
    case Axis::structure:
      if (const StructureEntry* e = registry.structure(value)) return std::string(e->info.summary);
      return "not in this build: libembree was not found";
    case Axis::builder: return builder_summary_of(value, registry);
    case Axis::leaf: return leaf_summary(value);
    case Axis::intersector: return std::string(intersector_summary(value));
    case Axis::box: return std::string(box_summary(value));
    case Axis::traversal: return traversal_summary(value);
    case Axis::call: return std::string(look_up(kCallSummaries, value));
    case Axis::isa: return std::string(look_up(kIsas, value));
    case Axis::workload: return workload_summary(value);
    case Axis::threads: return {};
  }
  return {};
}

}  // namespace arboretum
