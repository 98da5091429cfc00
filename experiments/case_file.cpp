#include "experiments/case_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/exact/exact_predicate.h"
#include "core/names.h"
#include "core/whole_file.h"
#include "experiments/json_text.h"

namespace arboretum {
namespace {

using Json = nlohmann::json;

/// Of all triangles, one by one.
struct ExactAnswer {
  std::vector<std::uint32_t> nearest;  ///< all that share the nearest t, ascending
  double t = std::numeric_limits<double>::infinity();
  std::size_t closed_hits = 0;
  [[nodiscard]] bool hit() const { return !nearest.empty(); }
};

ExactAnswer exact_answer(const TriangleMesh& mesh, const Ray& ray) {
  ExactAnswer answer;
  if (!is_valid(ray)) return answer;
  ExactPredicate predicate(ray);
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    Enclosure t;
    if (!predicate.meets(mesh.corners(i), t)) continue;
    ++answer.closed_hits;
    const int order = answer.hit() ? predicate.compare_t(mesh.corners(i), mesh.corners(answer.nearest[0])) : -1;
    if (order < 0) answer.nearest.clear();
    if (order <= 0) answer.nearest.push_back(i);
  }
  if (answer.hit()) answer.t = predicate.round(mesh.corners(answer.nearest[0])).t;
  return answer;
}

/// Reads one case; every error names the file and the case.
class CaseReader {
 public:
  CaseReader(const std::filesystem::path& file, std::size_t number, const Json& entry) : entry_(entry) {
    where_ = fmt::format("{}: case {}", file.string(), number);
    if (!entry.is_object())
      fail("is no object; a case is {\"id\": …, \"triangles\": […], \"origin\": …, \"direction\": …}");
    id_ = entry.contains("id") && entry["id"].is_string() ? entry["id"].get<std::string>() : std::to_string(number);
    where_ = fmt::format("{}: case {}", file.string(), id_);
  }

  VerifyCase read() {
    VerifyCase c;
    c.id = id_;
    expect_known_keys();
    if (entry_.contains("why")) c.why = entry_["why"];
    const Json& triangles = member("triangles");
    if (!triangles.is_array() || triangles.empty())
      fail("triangles must be a list of [[x, y, z], [x, y, z], [x, y, z]]");
    for (std::uint32_t i = 0; i < triangles.size(); ++i) add_triangle(c, i, triangles[i]);
    c.ray.origin = point(member("origin"), "origin"), c.ray.direction = point(member("direction"), "direction");
    if (entry_.contains("tnear")) c.ray.tnear = number(entry_["tnear"], "tnear");
    if (entry_.contains("tfar")) c.ray.tfar = number(entry_["tfar"], "tfar");
    const ExactAnswer truth = exact_answer(c.mesh, c.ray);
    expect_nothing_below_zero(c, truth);
    expect_truth(c, truth);
    return c;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw UserError(fmt::format("{}: {}", where_, what)); }

  const Json& member(const char* name) const {
    if (!entry_.contains(name)) fail(fmt::format("has no {}; add it", name));
    return entry_[name];
  }
  float number(const Json& value, std::string_view what) const {
    if (value.is_number()) {
      // The shortest decimal of a float may lie beyond it, as that of the largest does
      const float x = static_cast<float>(value.get<double>());
      if (!std::isfinite(x)) fail(fmt::format("{}: {} is beyond float32", what, to_text(value)));
      return x;
    }
    if (value == "inf") return std::numeric_limits<float>::infinity();
    if (value == "-inf") return -std::numeric_limits<float>::infinity();
    if (value == "nan") return std::numeric_limits<float>::quiet_NaN();
    fail(fmt::format("{}: {} is no number, \"inf\", \"-inf\" or \"nan\"", what, to_text(value)));
  }
  Vec3f point(const Json& value, std::string_view what) const {
    if (!value.is_array() || value.size() != 3) fail(fmt::format("{} must be [x, y, z], not {}", what, to_text(value)));
    return {number(value[0], what), number(value[1], what), number(value[2], what)};
  }
  void add_triangle(VerifyCase& c, std::uint32_t id, const Json& corners) const {
    if (!corners.is_array() || corners.size() != 3)
      fail(fmt::format("triangle {} must have three corners [x, y, z]", id));
    const Vec3f p[3] = {point(corners[0], "triangles"), point(corners[1], "triangles"), point(corners[2], "triangles")};
    if (!is_finite(p[0]) || !is_finite(p[1]) || !is_finite(p[2])) return;
    const auto first = static_cast<std::uint32_t>(c.mesh.vertices.size());
    c.mesh.vertices.insert(c.mesh.vertices.end(), p, p + 3);
    c.mesh.triangles.push_back({first, first + 1, first + 2});
    c.ids.push_back(id);
  }
  void expect_known_keys() const {
    static const std::vector<std::string> known{"id",  "triangles", "origin",      "direction",   "tnear", "tfar",
                                                "hit", "t",         "nearest_ids", "closed_hits", "why",   "source"};
    for (const auto& [key, value] : entry_.items())
      if (std::ranges::find(known, key) == known.end()) fail(unknown_name_message("key", key, known));
    for (const char* name : {"id", "why", "source"})
      if (entry_.contains(name) && !entry_[name].is_string())
        fail(fmt::format("{} must be a string, not {}", name, to_text(entry_[name])));
  }
  /// A tnear below 0 is no ray's (core/ray.h), and no kernel's answer to it is promised: it may stand where 0 would do.
  void expect_nothing_below_zero(const VerifyCase& c, const ExactAnswer& truth) const {
    if (!(c.ray.tnear < 0)) return;
    Ray ray = c.ray;
    ray.tnear = 0;
    if (exact_answer(c.mesh, ray).nearest != truth.nearest)
      fail(fmt::format("tnear {} is below 0 and something lies there; rays look from their origin on (core/ray.h)",
                       c.ray.tnear));
  }
  /// The answer that the file gives must be the exact one, as far as it gives it.
  void expect_truth(const VerifyCase& c, const ExactAnswer& truth) const {
    const auto given = [&](const char* name, auto is_of_type, std::string_view type) -> const Json* {
      if (!entry_.contains(name)) return nullptr;
      if (!is_of_type(entry_[name])) fail(fmt::format("{} must be {}, not {}", name, type, to_text(entry_[name])));
      return &entry_[name];
    };
    const auto expect = [&](const char* name, bool holds, const std::string& found) {
      if (!holds)
        fail(fmt::format("{} is {}, but exact arithmetic finds {}; correct the file", name, to_text(entry_[name]),
                         found));
    };
    const auto is_whole = [](const Json& j) { return j.is_number_unsigned(); };
    if (const Json* hit = given(
            "hit", [](const Json& j) { return j.is_boolean(); }, "true or false"))
      expect("hit", *hit == truth.hit(), truth.hit() ? "a hit" : "a miss");
    if (const Json* t = given(
            "t", [](const Json& j) { return j.is_number() || j.is_null(); }, "a number, or null for a miss")) {
      const bool holds = truth.hit()
                             ? t->is_number() && std::fabs(t->get<double>() - truth.t) <= std::fabs(truth.t) * 0x1p-48
                             : t->is_null();
      expect("t", holds, truth.hit() ? fmt::format("{}", truth.t) : "a miss");
    }
    const auto is_list = [&](const Json& j) { return j.is_array() && std::ranges::all_of(j, is_whole); };
    if (const Json* list = given("nearest_ids", is_list, "a list of whole numbers")) {
      std::set<std::uint64_t> exact;
      for (std::uint32_t i : truth.nearest) exact.insert(c.ids[i]);
      if (list->get<std::set<std::uint64_t>>().size() != list->size())
        fail(fmt::format("nearest_ids names an id twice: {}", to_text(*list)));
      expect("nearest_ids", list->get<std::set<std::uint64_t>>() == exact, fmt::format("[{}]", fmt::join(exact, ",")));
    }
    if (const Json* count = given("closed_hits", is_whole, "a whole number"))
      expect("closed_hits", *count == truth.closed_hits, std::to_string(truth.closed_hits));
  }

  const Json& entry_;
  std::string id_, where_;
};

/// The file as JSON. A number beyond double ends the parser's work, and of doubled keys it keeps the last, so that no
/// CaseReader sees either: they are told here, with the case.
Json parse(const std::filesystem::path& file, const std::string& text) {
  constexpr int kInDocument = 1, kEntry = 2, kInEntry = 3;  // the parser's depths
  std::size_t number = 1;
  std::string id, list, key;
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto place = [&] {
    return list == "cases" ? fmt::format(": case {}", id.empty() ? std::to_string(number) : id) : std::string();
  };
  const auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      throw UserError(fmt::format("{}{}: {} is given twice; keep one", file.string(), place(), to_text(parsed)));
    if (event == Json::parse_event_t::key && depth == kInDocument) list = parsed;
    if (event == Json::parse_event_t::key && depth == kInEntry) key = parsed;
    if (event == Json::parse_event_t::value && depth == kInEntry && key == "id" && parsed.is_string()) id = parsed;
    if (event == Json::parse_event_t::object_end && depth == kEntry) ++number, id.clear(), key.clear();
    return true;
  };
  try {
    return Json::parse(text, watch);
  } catch (const Json::out_of_range& e) {
    const std::string what = e.what();
    const std::size_t quote = what.find('\'');
    throw UserError(
        fmt::format("{}{}: {} is beyond float32", file.string(), place(),
                    quote == std::string::npos ? "a number" : what.substr(quote + 1, what.rfind('\'') - quote - 1)));
  } catch (const Json::parse_error& e) {
    fail_syntax(file, text, e, "mend the line or the one above it");
  }
}

/// The shortest decimal that is read back as the same float32.
std::string decimal(float x) {
  if (std::isnan(x)) return "\"nan\"";
  if (std::isinf(x)) return x > 0 ? "\"inf\"" : "\"-inf\"";
  return fmt::format("{}", x);
}
std::string decimal(Vec3f p) { return fmt::format("[{},{},{}]", decimal(p.x), decimal(p.y), decimal(p.z)); }

}  // namespace

std::vector<VerifyCase> read_case_file(const std::filesystem::path& file) {
  const Json document = parse(file, read_whole(file));
  if (!document.is_object() || !document.contains("cases") || !document["cases"].is_array() ||
      document["cases"].empty())
    throw UserError(
        fmt::format("{}: holds no {{\"cases\": [...]}}; docs/command-line.md shows the format", file.string()));
  std::vector<VerifyCase> cases;
  std::set<std::string> ids;
  for (const Json& entry : document["cases"]) {
    cases.push_back(CaseReader(file, cases.size() + 1, entry).read());
    if (!ids.insert(cases.back().id).second)
      throw UserError(fmt::format("{}: two cases have the id {}; rename one", file.string(), cases.back().id));
  }
  return cases;
}

std::string case_json(const std::string& id, const std::string& why, const TriangleMesh& mesh, const Ray& ray) {
  std::vector<std::string> triangles;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto c = mesh.corners(i);
    triangles.push_back(fmt::format("[{},{},{}]", decimal(c[0]), decimal(c[1]), decimal(c[2])));
  }
  const ExactAnswer truth = exact_answer(mesh, ray);
  return fmt::format(
      R"({{"id":{},"triangles":[{}],"origin":{},"direction":{},"tnear":{},"tfar":{},"hit":{},"t":{},"nearest_ids":[{}],"closed_hits":{},"why":{},"source":"arboretum verify"}})",
      to_text(Json(id)), fmt::join(triangles, ","), decimal(ray.origin), decimal(ray.direction), decimal(ray.tnear),
      decimal(ray.tfar), truth.hit(), truth.hit() ? fmt::format("{}", truth.t) : "null", fmt::join(truth.nearest, ","),
      truth.closed_hits, to_text(Json(why)));
}

std::string ray_json(const std::string& id, const std::string& why, const Ray& ray, float time) {
  return fmt::format(
      R"({{"id":{},"origin":{},"direction":{},"tnear":{},"tfar":{},"time":{},"why":{},"source":"arboretum verify"}})",
      to_text(Json(id)), decimal(ray.origin), decimal(ray.direction), decimal(ray.tnear), decimal(ray.tfar),
      decimal(time), to_text(Json(why)));
}

}  // namespace arboretum
