#include "experiments/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "core/parse_number.h"
#include "structures/below.h"
#include "structures/own_parameters.h"
#include "structures/parameter_limits.h"

namespace arboretum {
namespace {

constexpr std::string_view kOwn = "auto";  ///< the builder's or the way of traversal's own choice

/// f(parameter, the set that it is of) for the one of that name; of a structure's own BuilderParameters, too.
template <class F>
auto with(std::string_view name, Parameters& all, const F& f) {
  for (const auto& parameter : traversal_setting_table())
    if (parameter.name == name) return f(parameter, all.traversal);
  for (const auto& parameter : builder_parameter_table())
    if (parameter.name == name) return f(parameter, all.builder);
  if (const OwnParameter* parameter = find_own_parameter(name)) return f(*parameter, all.builder);
  throw std::logic_error(fmt::format("there is no parameter {}", name));
}

/// f(a value of the parameter's type).
template <class Set, class F>
auto of_type(const Parameter<Set>& parameter, const F& f) {
  return std::visit([&]<class T>(T Set::*) { return f(T{}); }, parameter.member);
}
template <class F>
auto of_type(const OwnParameter& parameter, const F& f) {
  return std::visit(f, parameter.initial);
}

template <class Set, class T>
void assign(const Parameter<Set>& parameter, Set& set, const T& value) {
  set.*std::get<T Set::*>(parameter.member) = value;
}
/// Kept where it is not the default.
void assign(const OwnParameter& parameter, BuilderParameters& set, const ParameterValue& value) {
  if (value == parameter.initial)
    set.own.erase(std::string(parameter.name));
  else
    set.own[std::string(parameter.name)] = value;
}

/// Whether the builder or the way of traversal may choose itself.
template <class Set>
bool has_own_choice(const Parameter<Set>& parameter) {
  return parameter.has_own;
}
bool has_own_choice(const OwnParameter&) { return false; }

/// Whether the word is one that the parameter may have: where the table leaves it open, a structure's name. What cannot
/// stand below, the plan says.
template <class Row>
bool allows(const Row& parameter, const std::string& word) {
  if (parameter.words.empty()) return find_structure(word) != nullptr;
  return std::ranges::find(parameter.words, word) != parameter.words.end();
}

/// What a word may be, without the structures that never stand below.
template <class Row>
std::vector<std::string_view> words_of(const Row& parameter) {
  std::vector<std::string_view> words(parameter.words.begin(), parameter.words.end());
  return words.empty() ? names_below() : words;
}

/// What a value of type T may be, in words.
template <class T, class Row>
std::string expectation(const Row& p) {
  if constexpr (std::is_same_v<T, std::string>) return fmt::format("one of {}", fmt::join(words_of(p), ", "));
  if (!p.choices.empty()) return fmt::format("one of {}", fmt::join(p.choices, ", "));
  if (has_own_choice(p)) return fmt::format("{} or an integer from {} to {}", kOwn, p.limits.low, p.limits.high);
  return fmt::format("{} from {} to {}", std::is_integral_v<T> ? "an integer" : "a number", p.limits.low,
                     p.limits.high);
}

/// The value that the text is, where it is one that the parameter may have.
template <class T, class Row>
std::optional<T> allowed_value(const Row& parameter, const std::string& text) {
  if constexpr (std::is_same_v<T, std::string>) {
    return allows(parameter, text) ? std::optional(text) : std::nullopt;
  } else {
    if constexpr (std::is_same_v<T, unsigned>) {
      if (has_own_choice(parameter) && text == kOwn) return BuilderParameters::kOwn;
    }
    const std::optional<T> value = parse_number<T>(text);
    if (!value) return std::nullopt;
    bool allowed = parameter.limits.hold(*value);
    if constexpr (std::is_same_v<T, unsigned>) {
      const auto& choices = parameter.choices;
      if (!choices.empty()) allowed = std::ranges::find(choices, *value) != choices.end();
    }
    return allowed ? value : std::nullopt;
  }
}

template <class Set>
std::string value_text(const Parameter<Set>& parameter, const Set& set) {
  const auto text = [&]<class T>(T Set::*member) {
    if constexpr (std::is_same_v<T, unsigned>) {
      if (parameter.has_own && set.*member == Set::kOwn) return std::string(kOwn);
    }
    return fmt::format("{}", set.*member);
  };
  return std::visit(text, parameter.member);
}
std::string value_text(const OwnParameter& parameter, const BuilderParameters& set) {
  const auto value = set.own.find(parameter.name);
  return text_of(value == set.own.end() ? parameter.initial : value->second);
}

template <class Set>
void reset(Set& set, std::span<const Parameter<Set>> table, std::string_view name) {
  const Set defaults;
  for (const Parameter<Set>& p : table)
    if (p.name == name) std::visit([&](auto member) { set.*member = defaults.*member; }, p.member);
}

}  // namespace

std::vector<std::string> parameter_names() {
  std::vector<std::string> names;
  for (const auto& p : builder_parameter_table()) names.emplace_back(p.name);
  for (const auto& p : traversal_setting_table()) names.emplace_back(p.name);
  for (const OwnParameter& p : all_own_parameters()) names.emplace_back(p.name);
  return names;
}

std::string default_parameter(std::string_view name) { return parameter_text({}, name); }

std::string parameter_text(const Parameters& parameters, std::string_view name) {
  Parameters all = parameters;
  return with(name, all, [](const auto& parameter, const auto& set) { return value_text(parameter, set); });
}

std::string parameter_values(std::string_view name) {
  Parameters all;
  return with(name, all, [](const auto& parameter, const auto&) {
    return of_type(parameter, [&]<class T>(const T&) { return expectation<T>(parameter); });
  });
}

std::string_view parameter_summary(std::string_view name) {
  Parameters all;
  return with(name, all, [](const auto& parameter, const auto&) { return parameter.summary; });
}

std::string set_parameter(Parameters& all, std::string_view name, const std::string& text) {
  return with(name, all, [&](const auto& parameter, auto& set) {
    return of_type(parameter, [&]<class T>(const T&) {
      const std::optional<T> value = allowed_value<T>(parameter, text);
      if (value) assign(parameter, set, *value);
      return value ? std::string() : expectation<T>(parameter);
    });
  });
}

std::span<const std::string_view> traversals_reading(std::string_view name) {
  for (const auto& p : traversal_setting_table())
    if (p.name == name) return p.traversals;
  return {};
}

bool is_of_traversal(std::string_view name) { return !traversals_reading(name).empty(); }

bool concerns(std::string_view name, std::string_view traversal) {
  const std::span<const std::string_view> readers = traversals_reading(name);
  return std::ranges::find(readers, traversal) != readers.end();
}

void reset_parameter(BuilderParameters& parameters, std::string_view name) {
  parameters.own.erase(std::string(name));
  reset(parameters, builder_parameter_table(), name);
}

void reset_parameter(TraversalSettings& settings, std::string_view name) {
  reset(settings, traversal_setting_table(), name);
}

void drop_label(std::string& label, std::string_view name) {
  const std::size_t begin = label.find(fmt::format(":{}=", name));
  if (begin == std::string::npos) return;
  const std::size_t end = label.find(':', begin + 1);
  label.erase(begin, end == std::string::npos ? end : end - begin);
}

std::vector<ParameterPoint> parameter_points(const ParameterSweep& sweep) {
  std::vector<ParameterPoint> points(1);
  for (const auto& [name, values] : sweep) {
    std::vector<ParameterPoint> next;
    for (const ParameterPoint& point : points) {
      for (const std::string& value : values) {
        next.push_back(point);
        (void)set_parameter(next.back().parameters, name, value);
        if (values.size() > 1)
          (is_of_traversal(name) ? next.back().traversal_label : next.back().label) += ":" + name + "=" + value;
      }
    }
    points = std::move(next);
  }
  return points;
}

}  // namespace arboretum
