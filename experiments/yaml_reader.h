// YamlReader: strict reading of YAML nodes: every error names file and line, every key is checked against a
// list.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arboretum {

class YamlReader {
 public:
  /// Loads the file. Throws UserError for a missing, unreadable or empty file, a tab, or text that is no
  /// YAML.
  explicit YamlReader(std::filesystem::path file);

  [[nodiscard]] const YAML::Node& root() const noexcept { return root_; }
  /// "file:line".
  [[nodiscard]] std::string where(const YAML::Node& node) const;
  [[noreturn]] void fail(const YAML::Node& node, const std::string& message) const;

  /// The node must be a map whose keys are among `keys`, none twice and none without a value.
  void check_map(const YAML::Node& node, std::string_view what, std::span<const std::string> keys) const;
  [[nodiscard]] std::string text(const YAML::Node& node, std::string_view what) const;
  [[nodiscard]] std::uint64_t integer(const YAML::Node& node, std::string_view what, std::uint64_t low,
                                      std::uint64_t high) const;
  [[nodiscard]] double number(const YAML::Node& node, std::string_view what, double low, double high) const;
  /// A scalar or a list of scalars; never empty, nothing twice.
  [[nodiscard]] std::vector<YAML::Node> list(const YAML::Node& node, std::string_view what) const;
  /// Bytes: `8GiB`, `512 MiB`, or a plain number.
  [[nodiscard]] std::size_t bytes(const YAML::Node& node, std::string_view what) const;

 private:
  std::filesystem::path file_;
  YAML::Node root_;
};

}  // namespace arboretum
