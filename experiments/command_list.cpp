#include <fmt/format.h>

#include <algorithm>

#include "core/names.h"
#include "experiments/axes.h"
#include "experiments/commands.h"
#include "experiments/json_text.h"
#include "experiments/parameters.h"
#include "experiments/result.h"
#include "intersectors/promises.h"
#include "scenes/catalogue.h"
#include "scenes/effects.h"
#include "scenes/generators/generators.h"

namespace arboretum {
namespace {

std::string plural(Axis axis) {
  switch (axis) {
    case Axis::leaf: return "leaves";
    case Axis::box: return "boxes";
    default: return std::string(to_string(axis)) + "s";
  }
}

/// Builder parameters that the structure reads, by builder.
Json parameters_of(const StructureInfo& info, const Registry& registry) {
  Json read = Json::object();
  for (std::string_view builder : info.builders) {
    Json& list = read[std::string(builder)] = Json::array();
    for (const std::string& name : parameter_names())
      if (!is_of_traversal(name) && registry.reads(name, info.name, builder, BuilderParameters{}.below))
        list.push_back(name);
  }
  return read;
}

/// Ways of traversal that the structure has on some instruction set of the machine.
Json traversals_of(const std::string& structure, const Registry& registry) {
  Json list = Json::array();
  for (const std::string& value : known_values(Axis::traversal, registry)) {
    const auto has = [&](const KernelRow& row) {
      return row.structure == structure && row.traversal == value && registry.has(row.isa);
    };
    if (std::ranges::any_of(registry.kernels, has)) list.push_back(value);
  }
  return list;
}

/// Builder parameters that the builder reads, by structure.
Json parameters_of(const std::string& builder, const Registry& registry) {
  Json read = Json::object();
  for (const StructureEntry& entry : registry.structures)
    if (Json all = parameters_of(entry.info, registry); all.contains(builder))
      read[std::string(entry.info.name)] = all[builder];
  return read;
}

Json axis_entries(Axis axis, const Registry& registry) {
  Json entries = Json::array();
  for (const std::string& value : known_values(axis, registry)) {
    Json entry = {{"name", value}, {"summary", summary_of(axis, value, registry)}};
    if (axis == Axis::structure) {
      const StructureEntry* structure = registry.structure(value);
      entry["available"] = structure != nullptr;
      if (structure) entry["builders"] = structure->info.builders, entry["leaves"] = structure->info.leaves;
      if (structure)
        entry["traversals"] = traversals_of(value, registry),
        entry["parameters"] = parameters_of(structure->info, registry);
    }
    if (axis == Axis::builder) entry["parameters"] = parameters_of(value, registry);
    if (axis == Axis::isa) entry["available"] = registry.has(*parse_isa(value));
    entries.push_back(std::move(entry));
  }
  return entries;
}

/// Of builders and of ways of traversal; `most` as readers_of() takes it.
Json parameter_entries(const Registry& registry, std::size_t most) {
  Json entries = Json::array();
  for (const std::string& name : parameter_names()) {
    Json entry = {{"name", name},
                  {"summary", parameter_summary(name)},
                  {"values", parameter_values(name)},
                  {"default", default_parameter(name)}};
    entry["readers"] = is_of_traversal(name) ? fmt::format("{}", fmt::join(traversals_reading(name), ", "))
                                             : registry.readers_of(name, most);
    entries.push_back(std::move(entry));
  }
  return entries;
}

Json scene_entries() {
  Json entries = Json::array();
  for (const CatalogueEntry& scene : catalogue()) {
    const bool generated = scene.source == CatalogueEntry::Source::generator;
    Json entry = {{"name", scene.name},
                  {"summary", scene.description},
                  {"generator", generated},
                  {"triangles", scene.triangles},
                  {"available", scene.is_present()}};
    if (!generated) entry["package"] = scene.package, entry["licence"] = scene.licence;
    if (generated) {
      const auto generator = std::ranges::find(generators(), scene.name, &GeneratorInfo::name);
      entry["takes_seed"] = generator != generators().end() && generator->takes_seed;
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

constexpr std::pair<std::string_view, std::string_view> kEffectSummaries[] = {
    {"shadow_hard", "shadows of point, directional and spot lights"},
    {"shadow_soft", "shadows of light-emitting triangles"},
    {"env_light", "light of the surroundings"},
    {"mirror", "perfect reflection"},
    {"glossy", "blurred reflection"},
    {"dielectric", "glass and water: reflection and refraction"},
    {"diffuse_gi", "light from surface to surface"},
    {"dof", "depth of field of a thin lens"},
    {"motion_blur", "movement while the shutter is open"},
    {"alpha_cutout", "holes cut by an opacity map"},
    {"instancing", "a mesh in several places"},
    {"texture", "colours from images"},
    {"multi_light", "more than one light"},
};

constexpr const std::string_view* effect_summary(std::string_view name) {
  for (const auto& [effect, summary] : kEffectSummaries)
    if (effect == name) return &summary;
  return nullptr;
}
static_assert(std::ranges::all_of(kEffectNames, effect_summary), "an effect without a summary");

Json effect_entries() {
  Json entries = Json::array();
  for (std::string_view name : kEffectNames) entries.push_back({{"name", name}, {"summary", *effect_summary(name)}});
  return entries;
}

Json promise_entries(const Registry& registry) {
  Json entries = Json::array();
  for (const std::string& intersector : known_values(Axis::intersector, registry)) {
    for (const std::string& box : known_values(Axis::box, registry)) {
      if (box == kAuto) continue;
      const Promise promise = promise_of("", intersector, box);
      Json entry = {{"name", intersector + "/" + box},
                    {"summary", to_words(promise)},
                    {"intersector", intersector},
                    {"box", box}};
      entry["crack_free_at_edges"] = promise.coverage != Coverage::none;
      entry["crack_free"] = promise.coverage >= Coverage::closed;
      entry["exact"] = promise.coverage == Coverage::exact;
      entry["t_error_ulp"] = promise.t_ulp > 0 ? Json(promise.t_ulp) : Json(nullptr);
      const std::string_view conditioning = to_string(promise.conditioning);
      entry["t_error_conditioning"] = conditioning.empty() ? Json(nullptr) : Json(conditioning);
      entry["range_exponent"] = promise.exponent > 0 ? Json(promise.exponent) : Json(nullptr);
      entries.push_back(std::move(entry));
    }
  }
  return entries;
}

/// What a person sees after the name.
std::string remark(const Json& entry) {
  std::string line = entry["summary"].get<std::string>();
  if (entry.contains("builders") && !entry["builders"].empty()) {
    const std::vector<std::string> names = entry["builders"];
    line +=
        fmt::format(" [builders: {}]", folded_builders(std::vector<std::string_view>(names.begin(), names.end()), " "));
  }
  if (entry.contains("values"))
    line += fmt::format(" [{}; default: {}; read by {}]", entry["values"].get<std::string>(),
                        entry["default"].get<std::string>(), entry["readers"].get<std::string>());
  if (entry.contains("generator")) {
    line += !entry["generator"].get<bool>()   ? fmt::format(" ({} triangles)", entry["triangles"].get<std::size_t>())
            : entry["takes_seed"].get<bool>() ? " (generated, any triangle count and seed)"
                                              : " (generated, any triangle count)";
  }
  if (entry.contains("available") && !entry["available"].get<bool>()) {
    line += entry.contains("generator")
                ? fmt::format(" - not here: arboretum fetch {}", entry["name"].get<std::string>())
                : " - not available here";
  }
  return line;
}

}  // namespace

ExitStatus command_list(const std::string& wanted, bool json) {
  const Registry registry = this_registry();
  std::vector<std::string> titles;
  for (std::size_t i = 0; i + 1 < kAxisCount; ++i)
    titles.push_back(plural(static_cast<Axis>(i)));  // threads are no list
  titles.emplace_back("parameters");
  titles.emplace_back("scenes");
  titles.emplace_back("effects");
  titles.emplace_back("promises");
  const bool known = std::ranges::any_of(titles, [&](const std::string& t) { return t == wanted; }) ||
                     wanted == "parameter" || wanted == "scene" || wanted == "effect" || wanted == "promise" ||
                     (parse_axis(wanted) && wanted != "threads");
  if (!wanted.empty() && !known) throw UserError(unknown_name_message("axis", wanted, titles));

  Json document = Json::object();
  for (std::size_t i = 0; i + 1 < kAxisCount; ++i) {
    const Axis axis = static_cast<Axis>(i);
    if (wanted.empty() || wanted == plural(axis) || wanted == to_string(axis))
      document[plural(axis)] = axis_entries(axis, registry);
  }
  if (wanted.empty() || wanted == "parameters" || wanted == "parameter")
    document["parameters"] = parameter_entries(registry, json ? Registry::kAll : 4);
  if (wanted.empty() || wanted == "scenes" || wanted == "scene") document["scenes"] = scene_entries();
  if (wanted.empty() || wanted == "effects" || wanted == "effect") document["effects"] = effect_entries();
  if (wanted.empty() || wanted == "promises" || wanted == "promise") document["promises"] = promise_entries(registry);

  if (json) {
    // One axis: its list alone.
    fmt::print("{}\n", to_text(wanted.empty() ? document : *document.begin(), 1));
    return ExitStatus::kDone;
  }
  for (const auto& [title, entries] : document.items()) {
    if (wanted.empty()) fmt::print("{}\n", title);
    std::size_t width = 0;
    for (const Json& entry : entries) width = std::max(width, entry["name"].get_ref<const std::string&>().size());
    for (const Json& entry : entries) {
      fmt::print("{}{:<{}}  {}\n", wanted.empty() ? "  " : "", entry["name"].get<std::string>(), width, remark(entry));
    }
  }
  return ExitStatus::kDone;
}

}  // namespace arboretum
