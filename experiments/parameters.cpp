#include "experiments/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "core/parse_number.h"
#include "structures/parameter_limits.h"

namespace arboretum {
namespace {

constexpr std::string_view kOwn = "auto";  ///< the builder's or the way of traversal's own choice

/// f(parameter, the set that it is of) for the one of that name.
template <class F>
auto with(std::string_view name, Parameters& all, const F& f) {
  for (const auto& parameter : traversal_setting_table())
    if (parameter.name == name) return f(parameter, all.traversal);
  for (const auto& parameter : builder_parameter_table())
    if (parameter.name == name) return f(parameter, all.builder);
  throw std::logic_error(fmt::format("there is no parameter {}", name));
}

/// What a word may be: where the table leaves it open, a structure's name. What cannot stand below, the plan says.
template <class Set>
std::vector<std::string_view> words_of(const Parameter<Set>& parameter) {
  std::vector<std::string_view> words(parameter.words.begin(), parameter.words.end());
  if (words.empty())
    for (const StructureEntry& e : all_structures()) words.push_back(e.info.name);
  return words;
}

/// What a value of type T may be, in words.
template <class T, class Set>
std::string expectation(const Parameter<Set>& p) {
  if constexpr (std::is_same_v<T, std::string>) return fmt::format("one of {}", fmt::join(words_of(p), ", "));
  if (!p.choices.empty()) return fmt::format("one of {}", fmt::join(p.choices, ", "));
  if (p.has_own) return fmt::format("{} or an integer from {} to {}", kOwn, p.limits.low, p.limits.high);
  return fmt::format("{} from {} to {}", std::is_integral_v<T> ? "an integer" : "a number", p.limits.low,
                     p.limits.high);
}

template <class T>
bool parse_within(const std::string& text, const ParameterLimits& limits, T& out) {
  const std::optional<T> value = parse_number<T>(text);
  if (!value || !limits.hold(*value)) return false;
  out = *value;
  return true;
}

}  // namespace

std::vector<std::string> parameter_names() {
  std::vector<std::string> names;
  for (const auto& p : builder_parameter_table()) names.emplace_back(p.name);
  for (const auto& p : traversal_setting_table()) names.emplace_back(p.name);
  return names;
}

std::string default_parameter(std::string_view name) { return parameter_text({}, name); }

std::string parameter_text(const Parameters& parameters, std::string_view name) {
  Parameters all = parameters;
  return with(name, all, []<class Set>(const Parameter<Set>& parameter, const Set& set) {
    const auto text = [&]<class T>(T Set::*member) {
      if constexpr (std::is_same_v<T, unsigned>) {
        if (parameter.has_own && set.*member == Set::kOwn) return std::string(kOwn);
      }
      return fmt::format("{}", set.*member);
    };
    return std::visit(text, parameter.member);
  });
}

std::string set_parameter(Parameters& all, std::string_view name, const std::string& value) {
  return with(name, all, [&]<class Set>(const Parameter<Set>& parameter, Set& set) {
    const auto assign = [&]<class T>(T Set::*member) {
      T& to = set.*member;
      bool done = false;
      if constexpr (std::is_same_v<T, std::string>) {
        const std::vector<std::string_view> words = words_of(parameter);
        done = std::ranges::find(words, value) != words.end();
        if (done) to = value;
      } else if constexpr (std::is_same_v<T, unsigned>) {
        const auto& choices = parameter.choices;
        unsigned chosen = Set::kOwn;
        done = (parameter.has_own && value == kOwn) || parse_within(value, parameter.limits, chosen);
        done = done && (choices.empty() || std::ranges::find(choices, chosen) != choices.end());
        if (done) to = chosen;
      } else {
        done = parse_within(value, parameter.limits, to);
      }
      return done ? std::string() : expectation<T>(parameter);
    };
    return std::visit(assign, parameter.member);
  });
}

bool is_of_traversal(std::string_view name) {
  return std::ranges::find(traversal_setting_table(), name, &Parameter<TraversalSettings>::name) !=
         traversal_setting_table().end();
}

bool concerns(std::string_view name, std::string_view traversal) {
  return name == "hybrid_threshold" ? traversal.starts_with("hybrid")
                                    : name == "rays_in_flight" && traversal == "queued";
}

void reset_parameter(BuilderParameters& parameters, std::string_view name) {
  const BuilderParameters defaults;
  for (const auto& p : builder_parameter_table())
    if (p.name == name) std::visit([&](auto member) { parameters.*member = defaults.*member; }, p.member);
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
