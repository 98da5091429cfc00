// The parameters of builders and of ways of traversal, one table each: what they are called, which values they may
// have, where they are kept. Command line, saved structures and checks go by them. And limits of meshes.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "core/ray.h"
#include "structures/accel.h"

namespace arboretum {

/// Both ends inclusive.
struct ParameterLimits {
  double low, high;

  /// Limits are those of the value's type: 0.01 as a float is a little less. NaN is not within.
  template <class T>
  [[nodiscard]] constexpr bool hold(T value) const noexcept {
    return value >= T(low) && value <= T(high);
  }
};

/// A member of `Set`: of BuilderParameters, of TraversalSettings, or of what a structure has of its own
/// (own_parameters.h).
template <class Set>
struct Parameter {
  std::string_view name;
  std::string_view summary;  ///< one line for `list`
  std::variant<unsigned Set::*, float Set::*, std::string Set::*> member;
  ParameterLimits limits{};                               ///< of a number
  std::span<const unsigned> choices{};                    ///< of a number that may have no other values
  std::span<const std::string_view> words{};              ///< of a word; none: any, which is looked at where it is read
  bool has_own = std::is_same_v<Set, TraversalSettings>;  ///< kOwn is a value, too, and the default
  std::span<const std::string_view> traversals{};         ///< of TraversalSettings: the ways that read it
};

/// In the order of the members. A new member needs a row in parameter_limits.cpp, which does not compile without, and
/// whoever reads it has to say so (parameters_read.h; of a way of traversal its row).
[[nodiscard]] std::span<const Parameter<BuilderParameters>> builder_parameter_table() noexcept;
[[nodiscard]] std::span<const Parameter<TraversalSettings>> traversal_setting_table() noexcept;

/// Throws UserError, which names the first parameter that is out of its limits, whether or not a builder reads it. NaN
/// is out of any.
void check_parameters(const BuilderParameters& parameters);
/// As above of a way of traversal, whether or not it reads the setting.
void check_settings(const TraversalSettings& settings);

/// A structure's own parameter, whatever it is a member of. All its values are of the type of `initial`, the default.
struct OwnParameter {
  std::string_view name, summary;
  ParameterValue initial;
  ParameterLimits limits{};
  std::span<const unsigned> choices{};
  std::span<const std::string_view> words{};
  friend bool operator==(const OwnParameter& a, const OwnParameter& b) noexcept;
};
/// Throws UserError for a value of another type or out of the parameter's limits.
void check_parameter(const OwnParameter& parameter, const ParameterValue& value);
/// As short as it is read back the same.
[[nodiscard]] std::string text_of(const ParameterValue& value);
/// Throws UserError unless the limits hold `value`: for those that a structure has beside the table's.
void require_within(std::string_view parameter, unsigned value, const ParameterLimits& limits);

inline constexpr unsigned kMostPlocRadius = 128;
/// References that a tree of two nodes each can have, numbered in 31 bits.
inline constexpr std::size_t kMaxReferences = (std::size_t{1} << 30) - 1;
/// Throws UserError for more than `most` triangles, which is a power of two less one.
void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most = kMaxReferences);

}  // namespace arboretum
