// Nearest valid name to a misspelt one, for error messages.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace arboretum {

/// ASCII letters in lower case, whatever the locale.
[[nodiscard]] std::string in_lower_case(std::string_view text);
/// Edit distance with adjacent transpositions (restricted Damerau-Levenshtein); upper and lower case are one.
[[nodiscard]] std::size_t edit_distance(std::string_view left, std::string_view right);
/// The candidate with the smallest edit distance to `name`; empty when there are no candidates.
[[nodiscard]] std::string nearest_name(std::string_view name, std::span<const std::string> candidates);
/// The nearest candidate, if it looks like a misspelling: at most a third of the longer word differs, or the first
/// three letters are the same. Empty where none does.
[[nodiscard]] std::string close_name(std::string_view name, std::span<const std::string> candidates);
/// `text` for a message of one line: where it is longer than `most` bytes, whole characters of its start and its
/// length.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t most);
/// "unknown <kind> 'naem'; did you mean 'name'? (valid: a b c)": one line for UserError. Asks only for a close name,
/// and shows the first 100 characters of a longer one.
[[nodiscard]] std::string unknown_name_message(std::string_view kind, std::string_view name,
                                               std::span<const std::string> candidates);
/// Where `name` stands in `names`; throws UserError with unknown_name_message() where it does not.
[[nodiscard]] std::size_t index_of_name(std::string_view kind, std::string_view name,
                                        std::span<const std::string_view> names);

}  // namespace arboretum
