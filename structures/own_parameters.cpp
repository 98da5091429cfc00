#include "structures/own_parameters.h"

#include <algorithm>

#include "core/error.h"
#include "core/names.h"
#include "structures/parameters_read.h"
#include "structures/registry.h"

namespace arboretum {
namespace {

void require_usable(std::string_view structure, const OwnParameter& parameter) {
  const auto refuse = [&](const std::string& why) {
    throw UserError(std::string(structure) + ": its parameter " + std::string(parameter.name) + why);
  };
  const auto has_its_name = [&](const auto& row) { return row.name == parameter.name; };
  if (std::ranges::any_of(builder_parameter_table(), has_its_name) ||
      std::ranges::any_of(traversal_setting_table(), has_its_name))
    refuse(" has the name of one that is there for all; call it otherwise, or read that one");
  if (parameter.name.empty() || parameter.name.find_first_of(":=/ ") != std::string_view::npos)
    refuse(" is part of cell names: give it a name without ':', '=', '/' and blanks");
  if (std::holds_alternative<std::string>(parameter.initial) && parameter.words.empty())
    refuse(" is a word: say which there are in `words`");
  try {
    check_parameter(parameter, parameter.initial);
  } catch (const UserError& e) {
    refuse(std::string(": its default is out of its limits: ") + e.what());
  }
}

}  // namespace

void add_own_parameters(std::string_view structure, std::span<const OwnParameter> own, std::vector<OwnParameter>& all) {
  for (const OwnParameter& parameter : own) {
    require_usable(structure, parameter);
    const auto known = std::ranges::find(all, parameter.name, &OwnParameter::name);
    if (known == all.end())
      all.push_back(parameter);
    else if (*known != parameter)
      throw UserError(std::string(structure) + ": its parameter " + std::string(parameter.name) +
                      " is another structure's too, with another default or other limits; call it otherwise");
  }
}

std::span<const OwnParameter> all_own_parameters() {
  static const std::vector<OwnParameter> all = [] {
    std::vector<OwnParameter> list;
    for (const StructureEntry& e : all_structures())
      add_own_parameters(e.info.name, builders_of_structure(e.info.name)->own, list);
    return list;
  }();
  return all;
}

const OwnParameter* find_own_parameter(std::string_view name) {
  const auto found = std::ranges::find(all_own_parameters(), name, &OwnParameter::name);
  return found == all_own_parameters().end() ? nullptr : &*found;
}

bool has_own_parameter(std::string_view structure, std::string_view name) {
  const StructureBuilders* builders = builders_of_structure(structure);
  return builders && std::ranges::find(builders->own, name, &OwnParameter::name) != builders->own.end();
}

std::unique_ptr<Accel> create_structure(const StructureEntry& entry, const BuilderParameters& parameters) {
  std::unique_ptr<Accel> accel = entry.create();
  const StructureBuilders* builders = builders_of_structure(entry.info.name);
  for (const auto& [name, value] : parameters.own) {
    const auto known = std::ranges::find(builders->own, name, &OwnParameter::name);
    if (known != builders->own.end()) {
      check_parameter(*known, value);
      builders->set(*accel, std::size_t(known - builders->own.begin()), value);
    } else if (!entry.info.takes_below) {
      if (std::ranges::find(builder_parameter_table(), name, &Parameter<BuilderParameters>::name) !=
          builder_parameter_table().end())
        throw UserError(std::string(entry.info.name) + ": '" + name +
                        "' is none of its own parameters, but one of all: set parameters." + name +
                        ", not parameters.own");
      std::vector<std::string> names;
      for (const OwnParameter& parameter : builders->own) names.emplace_back(parameter.name);
      throw UserError(std::string(entry.info.name) + ": " +
                      (names.empty() ? "it has no parameters of its own, but is given '" + name + "'"
                                     : unknown_name_message("parameter of its own", name, names)));
    }
  }
  return accel;
}

}  // namespace arboretum
