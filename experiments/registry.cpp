#include "experiments/registry.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <type_traits>
#include <utility>

#include "structures/builders/reinsertion_name.h"
#include "structures/own_parameters.h"
#include "structures/parameters_read.h"

namespace arboretum {

const StructureEntry* Registry::structure(std::string_view name) const {
  const auto found = std::ranges::find_if(structures, [&](const StructureEntry& e) { return e.info.name == name; });
  return found == structures.end() ? nullptr : &*found;
}

const KernelRow* Registry::kernel(std::string_view structure, std::string_view leaf, std::string_view intersector,
                                  std::string_view box, std::string_view traversal, Isa isa) const {
  const auto found = std::ranges::find_if(kernels, [&](const KernelRow& row) {
    return row.structure == structure && row.leaf == leaf && row.intersector == intersector && row.box == box &&
           row.traversal == traversal && row.isa == isa;
  });
  return found == kernels.end() ? nullptr : &*found;
}

bool Registry::has(Isa isa) const { return std::ranges::find(isas, isa) != isas.end(); }

bool Registry::reads(std::string_view parameter, std::string_view name, std::string_view builder,
                     std::string_view below) const {
  const StructureEntry* entry = structure(name);
  if (!entry || !entry->info.uses_parameters) return false;
  const auto read = parameters_read ? parameters_read(name, builder, below) : std::nullopt;
  if (read) return std::ranges::find(*read, parameter) != read->end();
  // One that does not say reads what there is for all, and what it has itself.
  if (find_own_parameter(parameter)) return has_own_parameter(name, parameter);
  return parameter != "below" || entry->info.takes_below;
}

namespace {

std::string listed(std::span<const std::string_view> names, std::string_view separator, std::size_t most) {
  const std::size_t shown = std::min(names.size(), most);
  const std::string words = fmt::format("{}", fmt::join(names.first(shown), separator));
  return shown == names.size() ? words : fmt::format("{} and {} more", words, names.size() - shown);
}

}  // namespace

std::string folded_builders(std::span<const std::string_view> names, std::string_view separator, std::size_t most) {
  const auto is_there = [&](std::string_view name) { return std::ranges::find(names, name) != names.end(); };
  std::vector<std::string_view> again, once;
  for (std::string_view name : names) {
    if (name.ends_with(kReinsertion) && is_there(name.substr(0, name.size() - kReinsertion.size()))) continue;
    (is_there(std::string(name) + std::string(kReinsertion)) ? again : once).push_back(name);
  }
  std::string words = listed(again, separator, most);
  if (!again.empty()) words += fmt::format(", also as …{}", kReinsertion);
  if (!again.empty() && !once.empty()) words += "; ";
  return words + listed(once, separator, most);
}

std::string Registry::readers_of(std::string_view parameter, std::size_t most) const {
  using Names = std::vector<std::string_view>;
  std::vector<std::pair<Names, Names>> groups;  // builders, empty for all; structures
  for (const StructureEntry& entry : structures) {
    if (entry.info.takes_below && parameter != "below") continue;  // it reads what the structure below it does
    Names builders;
    for (std::string_view builder : entry.info.builders)
      if (reads(parameter, entry.info.name, builder, "")) builders.push_back(builder);
    if (builders.empty()) continue;
    if (builders.size() == entry.info.builders.size()) {
      builders.clear();
    } else if (most != kAll && std::ranges::all_of(entry.info.builders, [&](std::string_view builder) {
                 return builder.ends_with(kReinsertion) == (std::ranges::find(builders, builder) != builders.end());
               })) {
      builders = {"…_reinsertion"};
    }
    const auto group = std::ranges::find(groups, builders, &std::pair<Names, Names>::first);
    if (group == groups.end())
      groups.push_back({builders, {entry.info.name}});
    else
      group->second.push_back(entry.info.name);
  }
  std::string words;
  for (const auto& [builders, structures] : groups) {
    if (!words.empty()) words += "; ";
    const std::string where = listed(structures, ", ", most);
    words +=
        builders.empty()
            ? where
            : fmt::format("{} ({})",
                          most == kAll ? listed(builders, ", ", most) : folded_builders(builders, ", ", most), where);
  }
  return words.empty() ? "nothing in this build" : words;
}

namespace {

/// A function that always answers the same, and looks through all kernels for it: a sweep asks it once a cell, and has
/// far more cells than different questions.
template <class Function>
auto remembered(Function* ask) {
  using Result = typename decltype(std::function(ask))::result_type;
  return [ask, known = std::make_shared<std::map<std::string, Result>>()](const auto&... asked) -> Result {
    std::string question;
    const auto add = [&question](const auto& word) {
      if constexpr (std::is_same_v<std::decay_t<decltype(word)>, Isa>) {
        question += to_string(word);
      } else {
        question.append(word).push_back('\n');
      }
    };
    (add(asked), ...);
    const auto found = known->find(question);
    return found != known->end() ? found->second : known->emplace(std::move(question), ask(asked...)).first->second;
  };
}

}  // namespace

Registry this_registry() {
  (void)all_own_parameters();  // what structures say wrongly of parameters is told whatever the command
  Registry registry;
  registry.structures = all_structures();
  registry.kernels = kernel_table();
  registry.isas.assign(available_isas().begin(), available_isas().end());
  registry.default_leaf = remembered(default_leaf);
  registry.why_no_kernel = remembered(why_no_kernel);
  registry.build = build_structure;
  registry.parameters_read = parameters_read;
  registry.builder_summary = builder_summary;
  return registry;
}

}  // namespace arboretum
