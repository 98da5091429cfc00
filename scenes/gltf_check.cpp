#include "scenes/gltf_check.h"

#include <algorithm>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

constexpr std::size_t kDeepestBracket = 100;
constexpr std::size_t kDeepestNode = 1000;

struct Child {
  std::string parent, node;
};

/// Notes all of `nodes[.].children[.]` while the text is read; nodes are an array in glTF 2, an object in glTF 1.
class NodeHandler final : public nlohmann::json_sax<nlohmann::json> {
 public:
  NodeHandler(std::string_view json, const std::string& name) : json_(json), name_(name) {}

  bool null() override { return value(); }
  bool boolean(bool) override { return value(); }
  bool number_integer(number_integer_t number) override { return value(std::to_string(number)); }
  bool number_unsigned(number_unsigned_t number) override { return value(std::to_string(number)); }
  bool number_float(number_float_t, const string_t& text) override { return value(text); }
  bool string(string_t& text) override { return value(text); }
  bool binary(binary_t&) override { return value(); }
  bool key(string_t& text) override {
    path_.back().key = text;
    return true;
  }
  bool start_object(std::size_t) override { return open(true); }
  bool start_array(std::size_t) override { return open(false); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool parse_error(std::size_t at, const std::string&, const nlohmann::detail::exception& error) override {
    // "[json.exception.…] parse error at line 1, column 26: syntax error while … - what was found; what is expected"
    std::string_view what = error.what();
    if (const std::size_t dash = what.find(" - "); dash != std::string_view::npos)
      what.remove_prefix(dash + 3);
    else if (const std::size_t colon = what.find(": "); colon != std::string_view::npos)
      what.remove_prefix(colon + 2);
    const std::string_view before = json_.substr(0, at > 0 ? at - 1 : 0);
    throw UserError(fmt::format("{}: broken or truncated: line {} of its JSON: {}; copy or export it anew", name_,
                                1 + std::ranges::count(before, '\n'), one_line(what)));
  }

  std::vector<std::string> nodes;
  std::vector<Child> children;

 private:
  struct Level {
    bool is_object;
    std::string key;
    std::size_t index = 0;
  };

  [[nodiscard]] bool is_among_nodes() const { return path_.size() >= 2 && path_[0].key == "nodes"; }
  /// Of `nodes`, at that moment.
  [[nodiscard]] std::string node() const { return path_[1].is_object ? path_[1].key : std::to_string(path_[1].index); }

  bool open(bool is_object) {
    if (path_.size() == kDeepestBracket)
      throw UserError(fmt::format("{}: more than {} brackets in each other; it is no glTF", name_, kDeepestBracket));
    if (path_.size() == 2 && is_among_nodes() && is_object) nodes.push_back(node());
    path_.push_back({is_object, {}});
    return true;
  }
  bool close() {
    path_.pop_back();
    return value();
  }
  bool value(const std::string& text = {}) {
    if (path_.size() == 4 && is_among_nodes() && path_[2].key == "children" && !text.empty())
      children.push_back({node(), text});
    if (!path_.empty()) ++path_.back().index;
    return true;
  }

  std::string_view json_;
  const std::string& name_;
  std::vector<Level> path_;
};

void check_forest(const std::vector<std::string>& nodes, const std::vector<Child>& children, const std::string& name) {
  std::unordered_map<std::string, std::string> parent_of;
  for (const std::string& node : nodes) parent_of.emplace(node, "");
  for (const Child& child : children) {
    const auto found = parent_of.find(child.node);
    if (found == parent_of.end())
      throw UserError(fmt::format("{}: node {} names child {}, and there {} {} node{}", name, one_line(child.parent),
                                  one_line(child.node), nodes.size() == 1 ? "is" : "are", nodes.size(),
                                  nodes.size() == 1 ? "" : "s"));
    if (!found->second.empty())
      throw UserError(fmt::format("{}: node {} is a child of node {} and again of node {}; give each node one parent",
                                  name, one_line(child.node), one_line(found->second), one_line(child.parent)));
    found->second = child.parent;
  }
  std::unordered_map<std::string, std::size_t> depth_of;
  std::vector<std::string> way;
  for (const std::string& node : nodes) {
    way.clear();
    std::string at = node;
    while (!at.empty() && !depth_of.contains(at) && way.size() <= nodes.size()) way.push_back(at), at = parent_of[at];
    if (way.size() > nodes.size())
      throw UserError(fmt::format("{}: node {} is below itself; make its nodes a tree", name, one_line(at)));
    std::size_t depth = at.empty() ? 0 : depth_of[at];
    for (; !way.empty(); way.pop_back()) depth_of[way.back()] = ++depth;
    if (depth > kDeepestNode)
      throw UserError(fmt::format("{}: nodes more than {} levels deep; flatten its tree", name, kDeepestNode));
  }
}

/// As assimp's parser sees it: to the first 0, and no matter in what encoding.
std::string plain(std::string_view json) {
  std::string text(json.substr(0, json.find('\0')));
  for (char& c : text)
    if (static_cast<unsigned char>(c) >= 0x80) c = '?';
  return text;
}

}  // namespace

void check_gltf(std::string_view json, const std::string& name) {
  const std::string text = plain(without_mark(json));
  NodeHandler handler(text, name);
  (void)nlohmann::json::sax_parse(text, &handler);
  check_forest(handler.nodes, handler.children, name);
}

}  // namespace arboretum
