#include "scenes/ply_header.h"

#include <utility>

#include "core/parse_number.h"
#include "scenes/readers.h"

namespace arboretum::ply {
namespace {

std::vector<std::string_view> words(std::string_view line) {
  std::vector<std::string_view> result;
  while (true) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) return result;
    line.remove_prefix(first);
    const std::size_t length = std::min(line.find_first_of(" \t\r"), line.size());
    result.push_back(line.substr(0, length));
    line.remove_prefix(length);
  }
}

Type parse_type(std::string_view word, std::size_t line, const Failure& fail) {
  constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::int8},     {"int8", Type::int8},       {"uchar", Type::uint8},    {"uint8", Type::uint8},
      {"short", Type::int16},   {"int16", Type::int16},     {"ushort", Type::uint16},  {"uint16", Type::uint16},
      {"int", Type::int32},     {"int32", Type::int32},     {"uint", Type::uint32},    {"uint32", Type::uint32},
      {"float", Type::float32}, {"float32", Type::float32}, {"double", Type::float64}, {"float64", Type::float64}};
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  fail.line(line, fmt::format("unknown property type '{}'; PLY has char uchar short ushort int uint float double",
                              one_line(word)));
}

}  // namespace

Header parse_header(std::string_view text, const Failure& fail) {
  Header header;
  bool has_format = false;
  std::size_t position = 0;
  for (std::size_t number = 1;; ++number) {
    const std::size_t end = text.find('\n', position);
    if (number == 1 && text.substr(0, 3) != "ply") fail("not a PLY file: it does not begin with 'ply'");
    if (end == std::string_view::npos) fail("the PLY header has no 'end_header' line; the file is truncated or broken");
    const auto word = words(text.substr(position, end - position));
    position = end + 1;
    if (word.empty() || word[0] == "ply" || word[0] == "comment" || word[0] == "obj_info") continue;
    if (word[0] == "end_header") break;
    if (word[0] == "format" && word.size() >= 2) {
      has_format = true;
      if (word[1] == "ascii")
        header.format = Format::ascii;
      else if (word[1] == "binary_little_endian")
        header.format = Format::little_endian;
      else if (word[1] == "binary_big_endian")
        header.format = Format::big_endian;
      else
        fail.line(number, fmt::format("unknown format '{}'; PLY has ascii, binary_little_endian, binary_big_endian",
                                      one_line(word[1])));
    } else if (word[0] == "element" && word.size() == 3) {
      const auto count = parse_number<decltype(Element::count)>(word[2]);
      if (!count) fail.line(number, fmt::format("the number of elements '{}' is no whole number", one_line(word[2])));
      header.elements.push_back({.name = std::string(word[1]), .count = *count, .properties = {}});
    } else if (word[0] == "property" && !header.elements.empty() && word.size() >= 3) {
      Property property;
      if (word[1] == "list") {
        if (word.size() != 5) fail.line(number, "a list property is 'property list COUNT_TYPE TYPE NAME'");
        property.is_list = true;
        property.count_type = parse_type(word[2], number, fail);
        if (property.count_type >= Type::float32) fail.line(number, "a list's count cannot be a floating-point number");
        property.type = parse_type(word[3], number, fail);
      } else {
        property.type = parse_type(word[1], number, fail);
      }
      property.name = std::string(word.back());
      header.elements.back().properties.push_back(std::move(property));
    } else {
      fail.line(number, fmt::format("unknown PLY header line '{}'", one_line(word[0])));
    }
  }
  if (!has_format) fail("the PLY header has no 'format' line");
  header.bytes = position;
  return header;
}

}  // namespace arboretum::ply
