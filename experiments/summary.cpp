#include "experiments/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "core/missing_isa.h"
#include "experiments/sampling.h"
#include "experiments/table_text.h"
#include "oracle/oracle.h"

namespace arboretum {
namespace {

using Row = TableRow;

constexpr std::ptrdiff_t kBesideEmbree = 10;  ///< place of the column that compares with Embree, where there is one

double rate_of(const CellResult& r, bool cpu) { return median(r.rates(cpu)); }

/// The fastest embree cell of the same scene, workload, ISA and threads.
const CellResult* embree_beside(const CellResult& r, const std::vector<CellResult>& all, bool cpu) {
  const CellResult* best = nullptr;
  for (const CellResult& other : all) {
    const Cell &a = r.cell, &b = other.cell;
    if (b.structure != "embree" || !other.is_trace() || a.scene != b.scene || a.workload_name() != b.workload_name() ||
        a.isa != b.isa || a.threads != b.threads) {
      continue;
    }
    if (!best || rate_of(other, cpu) > rate_of(*best, cpu)) best = &other;
  }
  return best;
}

/// Of one pass of each repetition, wall time.
std::vector<double> milliseconds(const CellResult& r) {
  std::vector<double> all;
  for (const Repetition& rep : r.repetitions)
    all.push_back(1e3 * rep.wall_seconds / static_cast<double>(rep.iterations));
  return all;
}

std::optional<double> build_milliseconds(const CellResult& r, const std::vector<CellResult>& all) {
  for (const CellResult& other : all) {
    const Cell &a = r.cell, &b = other.cell;
    if (other.is_trace() || a.scene != b.scene || a.structure != b.structure || a.builder_name() != b.builder_name() ||
        a.leaf != b.leaf || a.isa != b.isa || a.threads != b.threads) {
      continue;
    }
    return median(milliseconds(other));
  }
  return std::nullopt;
}

std::string optional_figure(const CellResult& r, const char* fact, const char* format) {
  return r.has_fact(fact) ? fmt::format(fmt::runtime(format), r.fact(fact)) : "-";
}

/// "-" of one repetition.
std::string interval_text(const Interval& i, std::size_t repetitions) {
  return repetitions < 2 ? "-" : fmt::format("[{}, {}]", figure(i.low, 2), figure(i.high, 2));
}

/// The fewest and the most repetitions of a cell.
std::pair<std::size_t, std::size_t> repetitions_of(const std::vector<const CellResult*>& results) {
  const auto [least, most] =
      std::ranges::minmax(results, {}, [](const CellResult* r) { return r->repetitions.size(); });
  return {least->repetitions.size(), most->repetitions.size()};
}

std::string interval_head(const std::vector<const CellResult*>& results) {
  const auto [least, most] = repetitions_of(results);
  return interval_name(least, most);
}

/// What stands beside the medians, in the words of a sentence.
std::string interval_words(const std::vector<const CellResult*>& results) {
  const auto [least, most] = repetitions_of(results);
  if (most < 2) return "of one repetition, which has no interval";
  if (least >= kFewestOfInterval) return "median with its 95 % interval (order statistics)";
  if (most >= kFewestOfInterval)
    return fmt::format("median with its 95 % interval, of fewer than {} repetitions with their range",
                       kFewestOfInterval);
  return fmt::format("median with the range of {} repetitions, which covers it {:.0f} times in 100 (95 take {})",
                     least == most ? std::to_string(most) : fmt::format("{} to {}", least, most),
                     100.0 * range_coverage(std::max<std::size_t>(least, 2)), kFewestOfInterval);
}

/// Of the rays whose answers were checked.
double wrong_share(const CellResult& r) { return r.fact("wrong_answers") / std::max(r.checked_rays(), 1.0); }

/// `beside`: with the column that compares with Embree.
Row trace_row(const CellResult& r, const std::vector<CellResult>& all, bool cpu, bool beside) {
  const Cell& c = r.cell;
  const Interval rate = median_interval(r.rates(cpu));
  const CellResult* embree = embree_beside(r, all, cpu);
  const std::optional<double> build = build_milliseconds(r, all);
  Row row{c.structure,
          c.builder_name(),
          c.leaf,
          c.intersector,
          c.box,
          c.traversal_name(),
          std::string(to_string(c.isa)),
          std::to_string(c.threads),
          figure(rate.median * 1e-6, 2),
          interval_text({rate.median * 1e-6, rate.low * 1e-6, rate.high * 1e-6}, r.repetitions.size()),
          r.has_fact("wrong_answers") ? figure(1e6 * wrong_share(r), 1) : "unchecked",
          optional_figure(r, "sah_cost", "{:.1f}"),
          build ? figure(*build, 1) : "-"};
  if (beside)
    row.insert(row.begin() + kBesideEmbree,
               embree ? figure(rate_of(r, cpu) / std::max(rate_of(*embree, cpu), 1e-9), 2) : "-");
  return row;
}

/// What became of rays that leave their surface in one of several ways.
void add_starts(std::vector<Row>& rows, const std::vector<const CellResult*>& results) {
  constexpr std::pair<const char*, const char*> kColumns[] = {
      {"self/1e6", "self_hits_per_million"}, {"near/1e6", "near_hits_per_million"}, {"leaks/1e6", "leaks_per_million"}};
  for (const auto& [head, fact] : kColumns) {
    rows[0].emplace_back(head);
    for (std::size_t i = 0; i < results.size(); ++i)
      rows[i + 1].push_back(optional_figure(*results[i], fact, "{:.1f}"));
  }
}

std::string build_table(const std::vector<CellResult>& all) {
  std::vector<const CellResult*> builds;
  for (const CellResult& r : all)
    if (!r.is_trace()) builds.push_back(&r);
  if (builds.empty()) return {};
  std::vector<Row> rows{{"scene", "structure", "builder", "leaf", "isa", "threads", "build ms", interval_head(builds),
                         "Mtri/s", "bytes/tri", "SAH"}};
  for (const CellResult* build : builds) {
    const CellResult& r = *build;
    const Interval time = median_interval(milliseconds(r));
    const Cell& c = r.cell;
    rows.push_back({c.scene, c.structure, c.builder_name(), c.leaf, std::string(to_string(c.isa)),
                    std::to_string(c.threads), figure(time.median, 2), interval_text(time, r.repetitions.size()),
                    figure(median(r.rates(false)) * 1e-6, 2), optional_figure(r, "bytes_per_triangle", "{:.0f}"),
                    optional_figure(r, "sah_cost", "{:.1f}")});
  }
  return "\nbuilds\n" + format_table(rows, 6) + fmt::format("\nbuild ms: {}.\n", interval_words(builds));
}

/// Comparable to a standard deviation and blind to single outliers; of too few repetitions for that their range. By the
/// clock of the tables: `cpu` holds for traces, builds are by wall time.
double relative_spread(const CellResult& r, bool cpu) {
  const std::vector<double> rates = r.rates(cpu && r.is_trace());
  const double centre = median(rates);
  if (rates.size() < 2 || centre <= 0.0) return 0.0;
  if (rates.size() < kFewestOfInterval) {
    const auto [least, most] = std::ranges::minmax(rates);
    return (most - least) / centre;
  }
  std::vector<double> deviations;
  for (double v : rates) deviations.push_back(std::abs(v - centre));
  return 1.4826 * median(deviations) / centre;
}

/// The clock of all traces.
bool by_cpu_time(const RunOutcome& outcome) {
  return std::ranges::all_of(outcome.results, allows_cpu_time, &CellResult::cell);
}

/// Scenes that no primary ray hits, and how many there are: one is enough, of any cell.
std::map<std::string, std::size_t> views_of_nothing(const RunOutcome& outcome) {
  std::map<std::string, std::size_t> rays;
  std::set<std::string> hit;
  for (const CellResult& r : outcome.results) {
    if (!r.is_trace() || r.cell.workload != "primary" || !r.has_fact("hits")) continue;
    rays[r.cell.scene] = static_cast<std::size_t>(r.fact("rays"));
    if (r.fact("hits") > 0.0) hit.insert(r.cell.scene);
  }
  for (const std::string& scene : hit) rays.erase(scene);
  return rays;
}

}  // namespace

std::string result_tables(const RunOutcome& outcome) {
  std::vector<std::pair<std::string, std::vector<const CellResult*>>> groups;
  for (const CellResult& r : outcome.results) {
    if (!r.is_trace()) continue;
    const std::string title = r.cell.scene + ", " + r.cell.workload_name();
    auto group = std::ranges::find(groups, title, &std::pair<std::string, std::vector<const CellResult*>>::first);
    if (group == groups.end()) group = groups.insert(groups.end(), {title, {}});
    group->second.push_back(&r);
  }
  std::string text;
  std::vector<const CellResult*> traces;
  const bool cpu = by_cpu_time(outcome);
  const bool beside = std::ranges::any_of(
      outcome.results, [](const CellResult& r) { return r.is_trace() && r.cell.structure == "embree"; });
  for (const auto& [title, results] : groups) {
    traces.insert(traces.end(), results.begin(), results.end());
    std::vector<Row> rows{{"structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "threads",
                           rate_unit(cpu), interval_head(results), "wrong/1e6", "SAH", "build ms"}};
    if (beside) rows[0].insert(rows[0].begin() + kBesideEmbree, "x embree");
    for (const CellResult* r : results) rows.push_back(trace_row(*r, outcome.results, cpu, beside));
    if (!results.front()->cell.start_label.empty()) add_starts(rows, results);
    const CellResult& first = *results.front();
    text += fmt::format("\n{}: {:.0f} rays, {:.0f} triangles\n{}", title, first.fact("rays"), first.fact("triangles"),
                        format_table(rows, 8));
  }
  if (!groups.empty()) {
    text += fmt::format("\n{}: {}, by {}.{}\n", rate_unit(cpu), interval_words(traces),
                        cpu ? "thread CPU time" : "wall time, as some cells have several threads",
                        beside ? " x embree: against the fastest embree cell of the same ISA and threads." : "");
  }
  if (groups.empty()) text = build_table(outcome.results);
  const auto is_stream = [](const Cell& c) { return c.structure == "embree" && c.traversal.starts_with("stream"); };
  if (std::ranges::any_of(outcome.results, is_stream, &CellResult::cell)) {
    text += "embree: Debian's package keeps its assertions on, which costs it about 12 % on streams.\n";
  }
  return text;
}

std::string skipped_lines(const Plan& plan, const RunOutcome& outcome) {
  std::vector<SkippedCell> all = plan.skipped;
  all.insert(all.end(), outcome.failed.begin(), outcome.failed.end());
  if (all.empty()) return {};
  std::string text = fmt::format("{} skipped:\n", counted(all.size(), "combination"));
  for (const auto& [reason, count] : group_reasons(all)) text += fmt::format("  {:5}  {}\n", count, reason);
  return text;
}

std::vector<std::string> run_warnings(const RunOutcome& outcome, const Plan& plan, unsigned cores) {
  constexpr double kWide = 0.05;
  std::vector<std::string> warnings;
  const bool cpu = by_cpu_time(outcome);
  std::size_t noisy = 0;
  std::size_t noisy_builds = 0;
  const CellResult* worst = nullptr;
  for (const CellResult& r : outcome.results) {
    if (relative_spread(r, cpu) <= kWide) continue;
    ++noisy;
    if (!r.is_trace()) ++noisy_builds;
    if (!worst || relative_spread(r, cpu) > relative_spread(*worst, cpu)) worst = &r;
  }
  if (worst) {
    warnings.push_back(
        fmt::format("noisy machine: the repetitions of {} of {} spread by more than {:.0f} % (most: {:.0f} % in "
                    "{}); raise {}, or free the machine",
                    noisy, counted(outcome.results.size(), "cell"), kWide * 100, relative_spread(*worst, cpu) * 100,
                    worst->cell.name(),
                    noisy_builds == noisy ? "repetitions"
                    : noisy_builds > 0    ? "min_time (builds heed it little) or repetitions"
                                          : "min_time or repetitions"));
  }
  const auto has_wrong_uv = [](const CellResult& r) { return r.fact("uv_error_median") > kWrongUv; };
  if (const auto first = std::ranges::find_if(outcome.results, has_wrong_uv); first != outcome.results.end())
    warnings.push_back(
        fmt::format("u or v of most hits is off by more than 2^-10 in {} of {} (first: {}): u is to "
                    "weigh the triangle's second corner, v its third",
                    std::ranges::count_if(outcome.results, has_wrong_uv), counted(outcome.results.size(), "cell"),
                    first->cell.name()));
  for (const auto& [scene, rays] : views_of_nothing(outcome))
    warnings.push_back(
        fmt::format("none of the {} primary rays hits {}: its camera looks past it, and the times are of "
                    "rays that meet nothing",
                    rays, scene));
  for (const Cell& cell : plan.cells) {
    if (cell.threads <= cores) continue;
    warnings.push_back(fmt::format("some cells have more threads than the machine's {}", counted(cores, "core")));
    break;
  }
  std::set<std::string> lacking;
  for (const SkippedCell& cell : plan.skipped)
    for (Isa isa : kAllIsas)
      if (cell.reason == missing_isa_reason(isa)) lacking.insert(std::string(to_string(isa)));
  for (const std::string& isa : lacking)
    warnings.push_back(fmt::format("this machine (or ARBORETUM_ISA) has no {}: its cells are skipped", isa));
  return warnings;
}

std::pair<ExitStatus, std::string> verdict(const RunOutcome& outcome) {
  if (outcome.results.empty()) return {ExitStatus::kNothingMeasured, "nothing was measured"};
  const CellResult* worst = nullptr;
  std::size_t wrong = 0, checked = 0;
  std::map<std::string, std::size_t> by_test;
  for (const CellResult& r : outcome.results) {
    if (!r.has_fact("wrong_answers")) continue;
    ++checked;
    if (r.fact("wrong_answers") == 0.0) continue;
    ++wrong;
    ++by_test[r.cell.intersector + "+" + r.cell.box];
    if (!worst || wrong_share(r) > wrong_share(*worst)) worst = &r;
  }
  if (wrong == 0) {
    const std::string measured = counted(outcome.results.size(), "cell");
    if (checked == 0) return {ExitStatus::kDone, fmt::format("{} measured; answers were not checked", measured)};
    return {ExitStatus::kDone, fmt::format("{} measured, all answers right", measured)};
  }
  std::vector<std::string> tests;
  for (const auto& [test, count] : by_test) tests.push_back(fmt::format("{} {}", count, test));
  return {ExitStatus::kWrongAnswers,
          fmt::format("wrong answers in {} of {} ({}); most: {:.0f} of {:.0f} rays in {}; exit status 1", wrong,
                      counted(checked, "checked cell"), fmt::join(tests, ", "), worst->fact("wrong_answers"),
                      worst->checked_rays(), worst->cell.name())};
}

}  // namespace arboretum
