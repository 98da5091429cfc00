#include "experiments/result.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "experiments/sampling.h"
#include "traversal/kernel_keys.h"

namespace arboretum {
namespace {

/// What one iteration works through: rays of a trace, triangles of a build.
double items(const CellResult& result) { return result.fact(result.is_trace() ? "rays" : "triangles"); }

double per_second(double amount, double seconds) { return seconds > 0.0 ? amount / seconds : 0.0; }

/// The rates and times that change with the repetition.
void add_measured(Json& entry, const CellResult& result, double wall, double cpu, double refit) {
  entry["real_time"] = wall * 1e3, entry["cpu_time"] = cpu * 1e3, entry["time_unit"] = "ms";
  if (result.is_trace()) {
    entry["rays_per_second"] = per_second(items(result), wall);
    entry["rays_per_cpu_second"] = per_second(items(result), cpu);
  } else {
    entry["build_seconds"] = wall;
    entry["triangles_per_second"] = per_second(items(result), wall);
    if (refit > 0.0) entry["refit_seconds"] = refit;
  }
}

Json head(const CellResult& result, const std::string& name, std::string_view run_type) {
  Json entry = Json::object();
  entry["name"] = name;
  entry["run_name"] = result.cell.name();
  entry["run_type"] = run_type;
  entry["repetitions"] = result.repetitions.size();
  return entry;
}

Json measured_fields(const Repetition& repetition) {
  Json json = Json::object();
  json["repetition_index"] = repetition.index;
  json["iterations"] = repetition.iterations;
  json["wall_seconds"] = repetition.wall_seconds;
  json["cpu_seconds"] = repetition.cpu_seconds;
  if (repetition.refit_seconds > 0.0) json["refit_wall_seconds"] = repetition.refit_seconds;
  add_origin(json, repetition.origin);
  if (!repetition.phases.empty()) {
    Json& phases = json["phase_seconds"] = Json::object();
    for (const auto& [name, seconds] : repetition.phases) phases[name] = seconds;
  }
  return json;
}

Repetition parse_measured_fields(const Json& json) {
  Repetition repetition;
  repetition.index = json.at("repetition_index").get<unsigned>();
  repetition.iterations = json.at("iterations").get<std::uint64_t>();
  repetition.wall_seconds = json.at("wall_seconds").get<double>();
  repetition.cpu_seconds = json.at("cpu_seconds").get<double>();
  repetition.refit_seconds = json.value("refit_wall_seconds", 0.0);
  repetition.origin = read_origin(json);
  if (const auto phases = json.find("phase_seconds"); phases != json.end()) {
    for (const auto& [name, seconds] : phases->items()) repetition.phases.emplace_back(name, seconds.get<double>());
  }
  return repetition;
}

}  // namespace

void add_origin(Json& json, const Origin& origin) {
  if (!origin.empty()) json["cpu"] = origin.cpu, json["git_revision"] = origin.git_revision;
}

Origin read_origin(const Json& json) { return {json.value("cpu", ""), json.value("git_revision", "")}; }

void name_origins(std::vector<CellResult>& results, const Origin& origin) {
  for (CellResult& result : results)
    for (Repetition& repetition : result.repetitions)
      if (repetition.origin.empty()) repetition.origin = origin;
}

std::vector<double> CellResult::rates(bool cpu) const {
  std::vector<double> values;
  for (const Repetition& r : repetitions) {
    values.push_back(
        per_second(items(*this) * static_cast<double>(r.iterations), cpu ? r.cpu_seconds : r.wall_seconds));
  }
  return values;
}

double CellResult::fact(const char* name, double otherwise) const {
  const auto found = facts.find(name);
  return found != facts.end() && found->is_number() ? found->get<double>() : otherwise;
}

void add_facts(Json& facts, const StructureStatistics& s) {
  if (!s.available) return;
  facts["sah_cost"] = s.sah_cost, facts["sah_child_cost"] = s.sah_child_cost, facts["epo"] = s.epo;
  facts["nodes"] = s.nodes, facts["leaves"] = s.leaves, facts["depth"] = s.depth;
  facts["node_bytes"] = s.node_bytes, facts["leaf_bytes"] = s.leaf_bytes;
  facts["other_bytes"] = s.bytes - std::min(s.bytes, s.node_bytes + s.leaf_bytes);
  facts["epo_sampled"] = s.epo_sampled;
  facts["lcv"] = s.lcv, facts["leaves_per_line"] = s.leaves_per_line;
  facts["references"] = s.references, facts["blocks"] = s.blocks;
  facts["depth_histogram"] = s.depth_histogram, facts["leaf_histogram"] = s.leaf_histogram;
  facts["leaf_fill"] = s.leaf_fill, facts["duplication"] = s.duplication,
  facts["children_per_node"] = s.children_per_node;
}

void add_facts(Json& facts, const Counters& c, std::size_t of_rays, std::string_view traversal) {
  if (c.rays == 0) return;
  const double rays = static_cast<double>(of_rays);
  facts["nodes_per_ray"] = static_cast<double>(c.nodes) / rays;
  facts["boxes_per_ray"] = static_cast<double>(c.boxes) / rays;
  facts["leaves_per_ray"] = static_cast<double>(c.leaves) / rays;
  facts["triangles_per_ray"] = static_cast<double>(c.triangles) / rays;
  if (c.lanes > 0) facts["simd_utilization"] = static_cast<double>(c.lanes_active) / static_cast<double>(c.lanes);
  const auto share = [](std::uint64_t part, std::uint64_t whole) {
    return static_cast<double>(part) / static_cast<double>(whole);
  };
  // Not every structure's nodes have children that a ray meets: a grid's cells
  if (std::ranges::any_of(c.children_hit, [](std::uint64_t visits) { return visits > 0; })) {
    Json& children = facts["children_hit"] = Json::array();
    for (std::uint64_t visits : c.children_hit) children.push_back(share(visits, c.nodes));
  }
  // In `two_level` over what follows no depth, those of the top would be there alone.
  std::uint64_t followed = 0;
  for (const Counters::Depth& d : c.depths) followed += d.visits;
  if (followed > 0 && followed == c.nodes - c.nodes_shared) {
    Json &visits = facts["visits_by_depth"] = Json::array(),
         &lanes = facts["lane_utilization_by_depth"] = Json::array();
    for (const Counters::Depth& d : c.depths) {
      visits.push_back(static_cast<double>(d.visits) / rays);
      lanes.push_back(d.lanes > 0 ? Json(share(d.lanes_active, d.lanes)) : Json(nullptr));
    }
  }
  const bool chooses = traversal == "auto";
  const bool packets = chooses || packet_width(traversal) > 0;
  if ((packets || traversal.starts_with("stream")) && c.nodes > 0) {
    facts["rays_per_node_visit"] = share(c.nodes, c.nodes - c.nodes_shared);
    if (c.leaves > 0) facts["rays_per_leaf_visit"] = share(c.leaves, c.leaves - c.leaves_shared);
  }
  if (packets) {
    facts["packet_share"] = share(c.rays_in_packets, c.rays);
    facts["interval_tests_per_ray"] = static_cast<double>(c.interval_tests) / rays;
  }
  if (chooses) {
    facts["stream_share"] = share(c.rays_in_streams, c.rays);
    facts["queued_share"] = share(c.rays_in_flight, c.rays);
    facts["single_share"] = share(c.rays - c.rays_in_packets - c.rays_in_streams - c.rays_in_flight, c.rays);
  }
  if (c.packets > 0) {
    facts["switches_per_packet"] = share(c.switches, c.packets);
    if (c.switches > 0) facts["rays_per_switch"] = share(c.rays_alone, c.switches);
  }
  if (c.queue_rounds > 0) {
    facts["node_queue_length"] = share(c.nodes_queued, c.queue_rounds);
    facts["leaf_queue_length"] = share(c.leaves_queued, c.queue_rounds);
  }
}

void add_facts(Json& facts, const AnswerCheck& check, bool closest_hit) {
  facts["wrong_answers"] = check.wrong_answers();
  facts["missed_hits"] = check.missed_hits, facts["false_hits"] = check.false_hits;
  if (!closest_hit) return;
  facts["wrong_surface"] = check.wrong_surface, facts["wrong_primitive"] = check.wrong_primitive;
  facts["cracks"] = check.cracks;
  facts["t_error_ulp_median"] = check.t_error_ulp_median, facts["t_error_ulp_p99"] = check.t_error_ulp_p99;
  facts["t_error_ulp_max"] = check.t_error_ulp_max;
  facts["wrong_uv"] = check.wrong_uv;
  facts["uv_error_median"] = check.uv_error_median, facts["uv_error_p99"] = check.uv_error_p99;
  facts["uv_error_max"] = check.uv_error_max;
}

void add_facts(Json& facts, const StartCheck& check, bool closest_hit) {
  const double million = 1e6 / static_cast<double>(std::max<std::uint64_t>(check.rays, 1));
  facts["self_hits"] = check.self_hits, facts["self_hits_per_million"] = static_cast<double>(check.self_hits) * million;
  if (closest_hit)
    facts["near_hits"] = check.near_hits,
    facts["near_hits_per_million"] = static_cast<double>(check.near_hits) * million;
  facts["leaks"] = check.leaks, facts["leaks_per_million"] = static_cast<double>(check.leaks) * million;
}

Json picture_points(std::span<const std::array<float, 2>> points, std::size_t most) {
  Json list = Json::array();
  const std::size_t step = std::max<std::size_t>(1, (points.size() + most - 1) / most);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const auto [x, y] = points[i];
    if (std::isfinite(x) && std::isfinite(y))
      list.push_back({std::round(x * 10.0) / 10.0, std::round(y * 10.0) / 10.0});
  }
  return list;
}

namespace {

constexpr std::string_view kSeenPointsHead = "camera_edges-", kSeenPointsEnd = ".json";

}  // namespace

std::string seen_points_file(const std::string& scene) {
  return fmt::format("{}{}{}", kSeenPointsHead, scene, kSeenPointsEnd);
}

bool is_seen_points_file(std::string_view name) {
  return name.starts_with(kSeenPointsHead) && name.ends_with(kSeenPointsEnd);
}

void add_axes(Json& json, const Cell& cell) {
  json["metric"] = to_string(cell.metric), json["scene"] = cell.scene, json["structure"] = cell.structure;
  json["builder"] = cell.builder_name(), json["leaf"] = cell.leaf, json["intersector"] = cell.intersector;
  json["box"] = cell.box, json["traversal"] = cell.traversal_name(), json["call"] = cell.call,
  json["isa"] = to_string(cell.isa);
  json["workload"] = cell.workload_name(), json["threads"] = cell.threads;
}

Json repetition_entry(const CellResult& result, const Repetition& repetition) {
  Json entry = head(result, result.cell.name(), "iteration");
  entry["repetition_index"] = repetition.index;
  entry["iterations"] = repetition.iterations;
  const double n = static_cast<double>(repetition.iterations);
  add_measured(entry, result, repetition.wall_seconds / n, repetition.cpu_seconds / n, repetition.refit_seconds / n);
  if (!repetition.phases.empty()) {
    Json& phases = entry["phase_seconds"] = Json::object();
    for (const auto& [name, seconds] : repetition.phases) phases[name] = seconds / n;
  }
  add_axes(entry, result.cell);
  entry.update(result.facts);
  if (repetition.index != 0) entry.erase(kLeakPoints);
  return entry;
}

std::vector<Json> aggregate_entries(const CellResult& result) {
  std::vector<double> wall, cpu, refit;
  for (const Repetition& r : result.repetitions) {
    const double n = static_cast<double>(r.iterations);
    wall.push_back(r.wall_seconds / n), cpu.push_back(r.cpu_seconds / n), refit.push_back(r.refit_seconds / n);
  }
  const auto cv = [](std::span<const double> v) { return mean(v) > 0.0 ? standard_deviation(v) / mean(v) : 0.0; };
  std::vector<Json> entries;
  for (const char* what : {"mean", "median", "stddev", "cv"}) {
    const std::string_view name = what;
    Json entry = head(result, result.cell.name() + "_" + what, "aggregate");
    entry["aggregate_name"] = what;
    entry["aggregate_unit"] = name == "cv" ? "percentage" : "time";
    entry["iterations"] = result.repetitions.size();
    if (name == "mean") add_measured(entry, result, mean(wall), mean(cpu), mean(refit));
    if (name == "median") {
      add_measured(entry, result, median(wall), median(cpu), median(refit));
      const auto add_rate = [&](const std::string& key, const std::vector<double>& rates) {
        const Interval rate = median_interval(rates);
        entry[key] = rate.median;
        if (rates.size() > 1) entry[key + "_low"] = rate.low, entry[key + "_high"] = rate.high;
      };
      add_rate(result.is_trace() ? "rays_per_second" : "triangles_per_second", result.rates(false));
      if (result.is_trace()) add_rate("rays_per_cpu_second", result.rates(true));
      entry.update(result.facts);
      entry.erase(kLeakPoints);
    }
    if (name == "stddev" || name == "cv") {
      const bool relative = name == "cv";
      entry["real_time"] = relative ? cv(wall) : standard_deviation(wall) * 1e3;
      entry["cpu_time"] = relative ? cv(cpu) : standard_deviation(cpu) * 1e3;
      entry["time_unit"] = "ms";
    }
    add_axes(entry, result.cell);
    entries.push_back(std::move(entry));
  }
  return entries;
}

Json cell_line(const CellResult& result, const std::string& configuration_hash) {
  Json line = Json::object();
  line["name"] = result.cell.name();
  line["configuration_hash"] = configuration_hash;
  add_axes(line, result.cell);
  line.update(result.facts);
  Json& list = line["repetitions"] = Json::array();
  for (const Repetition& repetition : result.repetitions) {
    Json entry = measured_fields(repetition);
    const double n = static_cast<double>(repetition.iterations);
    add_measured(entry, result, repetition.wall_seconds / n, repetition.cpu_seconds / n, repetition.refit_seconds / n);
    list.push_back(std::move(entry));
  }
  return line;
}

std::optional<CellResult> parse_cell_line(const Json& line, const Cell& cell, const std::string& configuration_hash) {
  try {
    if (line.at("name") != cell.name() || line.at("configuration_hash") != configuration_hash) return std::nullopt;
    CellResult result{.cell = cell, .repetitions = {}, .facts = line};
    for (const Json& entry : line.at("repetitions")) result.repetitions.push_back(parse_measured_fields(entry));
    Json axes = Json::object();
    add_axes(axes, cell);
    for (const auto& [key, value] : axes.items()) result.facts.erase(key);
    for (const char* key : {"name", "configuration_hash", "repetitions"}) result.facts.erase(key);
    return result;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

Json journal_line(const std::string& name, const Repetition& repetition) {
  Json line = measured_fields(repetition);
  line["name"] = name;
  return line;
}

std::optional<std::pair<std::string, Repetition>> parse_journal_line(const Json& line) {
  try {
    return std::pair{line.at("name").get<std::string>(), parse_measured_fields(line)};
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace arboretum
