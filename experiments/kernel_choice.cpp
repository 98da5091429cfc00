#include "experiments/kernel_choice.h"

#include <algorithm>
#include <thread>

#include <fmt/format.h>

#include "core/error.h"
#include "core/names.h"
#include "experiments/axes.h"

namespace arboretum {
namespace {

void check_name(Axis axis, const std::string& name, const Registry& registry) {
  const std::vector<std::string> known = known_values(axis, registry);
  if (name != kAuto && std::ranges::find(known, name) == known.end())
    throw UserError(unknown_name_message(to_string(axis), name, known));
}

Isa chosen_isa(const std::string& name, const Registry& registry) {
  if (name == kAuto) return registry.isas.back();
  const std::optional<Isa> isa = parse_isa(name);
  if (!isa) throw UserError(unknown_name_message("isa", name, known_values(Axis::isa, registry)));
  if (!registry.has(*isa))
    throw UserError(fmt::format("isa {} is not available here; the best is {}", name, to_string(registry.isas.back())));
  return *isa;
}

const StructureEntry& chosen_structure(const std::string& name, const TriangleMesh& mesh, const Registry& registry) {
  const std::string_view wanted = resolve_structure(name, mesh.moves());
  const StructureEntry* entry = registry.structure(wanted);
  if (!entry) throw UserError(fmt::format("this build has no structure {}", wanted));
  if (mesh.moves() && !entry->info.holds_motion)
    throw UserError(fmt::format(
        "{} holds one moment, and the scene moves: take bvh4_motion, or leave the effect motion_blur out", wanted));
  return *entry;
}

/// The mend where there is no kernel.
std::string what_is_possible(std::string_view structure, Isa isa, const Registry& registry) {
  std::vector<std::string_view> isas;
  for (Isa other : registry.isas)
    if (std::ranges::any_of(registry.kernels,
                            [&](const KernelRow& row) { return row.structure == structure && row.isa == other; }))
      isas.push_back(to_string(other));
  if (isas.empty() || std::ranges::find(isas, to_string(isa)) != isas.end())
    return "choose another --structure, --leaf, --intersector, --box, --traversal or --isa";
  return fmt::format("possible with --structure {}: --isa {}", structure, fmt::join(isas, ", "));
}

}  // namespace

std::string BuiltKernel::name() const {
  return fmt::format("{}/{}/{}/{}/{}/{}/{}", kernel->structure, builder, kernel->leaf, kernel->intersector, kernel->box,
                     kernel->traversal, to_string(kernel->isa));
}

BuiltKernel build_kernel(const KernelChoice& choice, const TriangleMesh& mesh, const Registry& registry) {
  check_name(Axis::structure, choice.structure, registry);
  check_name(Axis::builder, choice.builder, registry);
  check_name(Axis::leaf, choice.leaf, registry);
  check_name(Axis::intersector, choice.intersector, registry);
  check_name(Axis::box, choice.box, registry);
  check_name(Axis::traversal, choice.traversal, registry);
  const Isa isa = chosen_isa(choice.isa, registry);
  const StructureInfo& info = chosen_structure(choice.structure, mesh, registry).info;
  const StructureEntry* below = info.takes_below ? registry.structure(BuilderParameters{}.below) : nullptr;
  const std::string_view intersector = resolve_intersector(choice.intersector, info.name, registry.kernels);
  const std::string_view box = resolve_box(choice.box, intersector);
  std::string leaf = choice.leaf;
  if (leaf == kAuto) leaf = registry.default_leaf(below ? below->info.name : info.name, intersector, isa);
  std::string traversal = resolve_traversal(choice.traversal, isa);
  BuiltKernel built;
  built.kernel = registry.kernel(info.name, leaf, intersector, box, traversal, isa);
  if (!built.kernel && choice.traversal == kAuto)
    built.kernel = registry.kernel(info.name, leaf, intersector, box, traversal = "single", isa);
  if (!built.kernel) {
    const std::string why = registry.why_no_kernel(info.name, leaf, intersector, box, traversal, isa);
    throw UserError(fmt::format("{}; {}", why.empty() ? "no such kernel in this build" : why,
                                what_is_possible(info.name, isa, registry)));
  }
  const std::vector<std::string_view>& builders = below ? below->info.builders : info.builders;
  built.builder = choice.builder == kAuto && !builders.empty() ? std::string(builders.front()) : choice.builder;
  BuildSettings settings{
      .builder = built.builder, .leaf = leaf, .isa = isa, .threads = choice.threads, .parameters = {}};
  if (settings.threads == 0) settings.threads = std::max(1u, std::thread::hardware_concurrency());
  built.accel = registry.build(info.name, mesh, settings, built.report);
  return built;
}

}  // namespace arboretum
