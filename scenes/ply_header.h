// The header of a PLY file: its format, and the elements and properties that it promises.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "core/error.h"

namespace arboretum::ply {

enum class Type : unsigned char { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

constexpr std::size_t size_of(Type type) noexcept {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[int(type)];
}

struct Property {
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  [[nodiscard]] int find(std::initializer_list<std::string_view> names) const {
    for (std::size_t i = 0; i < properties.size(); ++i)
      if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) return int(i);
    return -1;
  }
};

enum class Format { ascii, little_endian, big_endian };

struct Header {
  Format format = Format::ascii;
  std::vector<Element> elements;
  std::size_t bytes = 0;  ///< where the data begins
};

/// Errors, which name the file.
class Failure {
 public:
  explicit Failure(const std::filesystem::path& path) : name_(path.string()) {}
  [[noreturn]] void operator()(const std::string& what) const { throw UserError(name_ + ": " + what); }
  [[noreturn]] void line(std::size_t number, const std::string& what) const {
    throw UserError(fmt::format("{}:{}: {}", name_, number, what));
  }

 private:
  std::string name_;
};

/// `text`: the whole file, of which only the header is read.
[[nodiscard]] Header parse_header(std::string_view text, const Failure& fail);

}  // namespace arboretum::ply
