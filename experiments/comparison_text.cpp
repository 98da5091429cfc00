#include "experiments/comparison_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <filesystem>
#include <set>
#include <system_error>

#include "experiments/results_writer.h"
#include "experiments/table_text.h"

namespace arboretum {
namespace {

constexpr double kLoadDifference = 0.5;  // half a core
constexpr std::size_t kMostRows = 60, kMostBeyond = 3;

/// "7", "3 to 7" repetitions.
std::string repetitions(const std::vector<CellResult>& cells) {
  if (cells.empty()) return "no cells";
  const auto [least, most] = std::ranges::minmax(cells, {}, [](const CellResult& r) { return r.repetitions.size(); });
  const std::size_t a = least.repetitions.size(), b = most.repetitions.size();
  return fmt::format("{}, {}", counted(cells.size(), "cell"),
                     a == b ? counted(a, "repetition") : fmt::format("{} to {} repetitions", a, b));
}

std::string origin(const char* letter, const ResultFolder& f) {
  const std::string date = f.context_text("date");
  const bool dirty = f.context.contains("git_dirty") && f.context_text("git_dirty") != "false";
  return fmt::format("{}  {}: {}, revision {}{}, {}{}\n", letter, f.path.string(), repetitions(f.cells),
                     short_revision(f.context), dirty ? " with changes" : "", date.substr(0, date.find('T')),
                     f.complete ? "" : ", cut off");
}

/// The axes by which some of the cells differ, and what is the same for all.
struct Axes {
  std::vector<std::string> varying;
  std::vector<std::string> constant;  ///< "builder binned_sah"
};

Axes axes_of(const std::vector<Json>& cells) {
  Axes axes;
  for (const auto& [axis, value] : cells.front().items()) {
    const bool same = std::ranges::all_of(
        cells, [&, &key = axis, &of_first = value](const Json& cell) { return cell[key] == of_first; });
    if (!same)
      axes.varying.push_back(axis);
    else if (axis != "metric" && plain_text(value) != "-")
      axes.constant.push_back(fmt::format("{} {}", axis, plain_text(value)));
  }
  return axes;
}

std::string p_text(double p) { return p < 0.0001 ? "<0.0001" : fmt::format("{:.4f}", p); }

std::string interval_text(const Interval& i) { return fmt::format("[{:.3f}, {:.3f}]", i.low, i.high); }

/// Of fewer repetitions than these the bootstrap covers the ratio less often than it says: of 2, 3 and 4 so many times
/// in 100 where nothing has changed (2 and 3: 1 - 2 / C(2n, n), as the interval is all that the two samples allow; 4 by
/// simulation).
constexpr std::size_t kFewestOfRatio = 5;
constexpr int kCoverage[] = {67, 90, 93};

/// The fewest repetitions of a cell that has several; 1 where none has.
std::size_t fewest_repetitions(const std::vector<const ComparedCell*>& cells) {
  std::size_t fewest = SIZE_MAX;
  for (const ComparedCell* c : cells)
    if (c->is_tested()) fewest = std::min({fewest, c->a.repetitions.size(), c->b.repetitions.size()});
  return fewest == SIZE_MAX ? 1 : fewest;
}

/// The head of the intervals of ratios.
std::string interval_head(std::size_t fewest) { return fewest < kFewestOfRatio ? "interval" : "95 %"; }

std::vector<const ComparedCell*> pointers(const Comparison& comparison) {
  std::vector<const ComparedCell*> cells;
  for (const ComparedCell& c : comparison.cells) cells.push_back(&c);
  return cells;
}

/// What the legend says of the intervals of ratios.
std::string interval_words(std::size_t fewest) {
  if (fewest < 2) return "without an interval, which one repetition has not";
  if (fewest >= kFewestOfRatio) return "with the 95 % bootstrap interval of their ratio";
  return fmt::format(
      "with the bootstrap interval of their ratio, which of {} repetitions covers it {} times in 100 (95 take {})",
      fewest, kCoverage[fewest - 2], kFewestOfRatio);
}

/// The head of ratios: whether they are over those of the control's cells. `trace`, `build`: whether such are there.
std::string ratio_head(const Comparison& comparison, bool trace, bool build) {
  const bool relative = (!trace || comparison.control_of_rays) && (!build || comparison.control_of_builds);
  return relative ? "B/A over control's" : "B/A";
}

/// Cells of one kind: what they have in common, then a row each.
std::string cell_table(const Comparison& comparison, bool trace, bool all) {
  std::vector<const ComparedCell*> cells;
  for (const ComparedCell& c : comparison.cells)
    if (c.is_trace() == trace) cells.push_back(&c);
  if (cells.empty()) return {};
  std::vector<Json> values(cells.size(), Json::object());
  for (std::size_t i = 0; i < cells.size(); ++i) add_axes(values[i], cells[i]->a.cell);
  const Axes axes = axes_of(values);
  const bool some = !all && cells.size() > kMostRows;
  TableRow titles = axes.varying;
  if (titles.empty()) titles = {trace ? "cell" : "structure"};
  for (const char* title : {trace ? "A Mray/s" : "A ms", trace ? "B Mray/s" : "B ms"}) titles.emplace_back(title);
  titles.insert(titles.end(), {(trace ? "" : "speed ") + ratio_head(comparison, trace, !trace),
                               interval_head(fewest_repetitions(cells)), "p", "verdict"});
  std::vector<TableRow> rows{titles};
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const ComparedCell* c = cells[i];
    if (some && c->verdict == Verdict::indistinguishable) {
      ++left_out;
      continue;
    }
    TableRow row;
    for (const std::string& axis : axes.varying) row.push_back(plain_text(values[i][axis]));
    if (row.empty()) row.push_back(c->a.cell.structure);
    const double triangles = c->a.fact("triangles");
    const auto speed = [&](double rate) { return figure(trace ? rate * 1e-6 : 1e3 * triangles / rate, 2); };
    row.insert(row.end(), {speed(c->rate_a), speed(c->rate_b), fmt::format("{:.3f}", c->ratio.median),
                           c->is_tested() ? interval_text(c->ratio) : "-", c->is_tested() ? p_text(c->adjusted_p) : "-",
                           std::string(to_string(c->verdict))});
    rows.push_back(std::move(row));
  }
  std::string text = fmt::format("\n{}", trace ? "rays" : "builds");
  if (!axes.constant.empty()) text += fmt::format(", all of {}", fmt::join(axes.constant, ", "));
  text += "\n";
  if (rows.size() > 1) text += format_table(rows, titles.size() - 6);
  if (left_out > 0) text += fmt::format("{} left out; --all lists them\n", counted(left_out, "indistinguishable cell"));
  return text;
}

std::string mean_table(const Comparison& comparison) {
  const bool trace = std::ranges::any_of(comparison.cells, &ComparedCell::is_trace),
             build = !std::ranges::all_of(comparison.cells, &ComparedCell::is_trace);
  std::vector<TableRow> rows{{"geometric mean", "", ratio_head(comparison, trace, build),
                              interval_head(fewest_repetitions(pointers(comparison))), "cells", "faster", "slower",
                              "indistinguishable", "undecided"}};
  for (const MeanRatio& m : comparison.means) {
    rows.push_back({m.axis.empty() ? "all " + m.value : m.axis, m.axis.empty() ? "" : m.value,
                    fmt::format("{:.3f}", m.ratio.median), m.undecided == m.cells ? "-" : interval_text(m.ratio),
                    std::to_string(m.cells), std::to_string(m.faster), std::to_string(m.slower),
                    std::to_string(m.indistinguishable), std::to_string(m.undecided)});
  }
  return rows.size() == 1 ? "" : "\n" + format_table(rows, 2);
}

/// Median over the cells of half their interval, relative.
double usual_half_width(const Comparison& comparison) {
  std::vector<double> widths;
  for (const ComparedCell& c : comparison.cells)
    if (c.is_tested()) widths.push_back(0.5 * std::log(c.ratio.high / c.ratio.low));
  return std::expm1(median(widths));
}

std::string tests_text(const Comparison& comparison) {
  const auto with = [&](SignificanceTest test) {
    return std::ranges::count(comparison.cells, test, &ComparedCell::test);
  };
  const auto by_ranks = with(SignificanceTest::mann_whitney), by_logs = with(SignificanceTest::welch);
  const std::string few = "Welch's test of logarithms, as ranks of so few repetitions tell nothing among so many cells";
  if (by_logs == 0) return "Mann-Whitney test";
  return by_ranks == 0 ? few : fmt::format("Mann-Whitney test (of {} cells {})", by_logs, few);
}

/// Whose speeds hold what the machine did between the two runs.
std::string drift_text(const Comparison& comparison) {
  constexpr const char* kDrift = "Drift of the machine between the two runs is in neither the interval nor p";
  if (comparison.options.control.empty())
    return fmt::format("{}; --control REGEX (cells whose code did not change) takes it out.\n", kDrift);
  std::string text;
  for (bool trace : {true, false}) {
    const bool any =
        std::ranges::any_of(comparison.cells, [&](const ComparedCell& c) { return c.is_trace() == trace; });
    if (any && !(trace ? comparison.control_of_rays : comparison.control_of_builds))
      text += fmt::format("{} of {}: --control '{}' finds none of them.\n", kDrift, trace ? "rays" : "builds",
                          comparison.options.control);
  }
  return text;
}

std::string legend(const Comparison& comparison) {
  const CompareOptions& o = comparison.options;
  std::string text = fmt::format(
      "\nB/A: speed of B over that of A, so 1.10 is a tenth faster; medians of thread CPU time with one thread, else "
      "of wall time,\n{}. p: {}, adjusted for the number of cells (Benjamini-Hochberg). faster, slower: the whole "
      "interval is beyond {:g} %, and p at\n"
      "most {:g}.\n",
      interval_words(fewest_repetitions(pointers(comparison))), tests_text(comparison), o.min_difference,
      o.significance);
  text += drift_text(comparison);
  if (const std::size_t n = comparison.count(Verdict::indistinguishable); n > 0) {
    text += fmt::format(
        "Of the {} indistinguishable cells {} are known to be equal: their whole interval is within {:g} %.\n", n,
        std::ranges::count(comparison.cells, true, &ComparedCell::equal), o.min_difference);
  }
  if (const double width = usual_half_width(comparison); width > 0.01 * o.min_difference) {
    text += fmt::format(
        "Half of the intervals reach {:.0f} % or more to either side: smaller differences go unseen. More repetitions, "
        "a longer min_time or a quieter machine narrow them.\n",
        100.0 * width);
  }
  if (comparison.count(Verdict::undecided) > 0) {
    text += "undecided: one repetition tells nothing of noise; run both with --repetitions 3 or more\n";
  }
  return text;
}

/// What speaks for a machine that was itself faster or slower.
std::string machine_text(const Comparison& comparison) {
  std::string relative;
  for (bool trace : {true, false}) {
    const std::optional<MeanRatio>& c = trace ? comparison.control_of_rays : comparison.control_of_builds;
    if (c)
      relative +=
          fmt::format("\nSpeeds of {} are relative to the {} of --control '{}', whose geometric mean B/A is {:.3f} {}.",
                      trace ? "rays" : "builds", counted(c->cells, trace ? "trace" : "build"), c->value,
                      c->ratio.median, interval_text(c->ratio));
  }
  if (!relative.empty()) return relative + "\n";
  if (!comparison.embree) return {};
  const Interval& r = comparison.embree->ratio;
  if ((r.low <= 1.0 && r.high >= 1.0) || std::abs(r.median - 1.0) < 0.01) return {};
  return fmt::format(
      "\nnote: embree's {} ran at {:.3f} {} of A's speed: if nothing of Embree changed, the machine did. "
      "--control /embree/ takes that out of the ratios.\n",
      counted(comparison.embree->cells, "cell"), r.median, interval_text(r));
}

std::string wrong_table(const Comparison& comparison) {
  std::vector<TableRow> rows{{"wrong answers", "A", "B", "rays"}};
  std::size_t unchecked = 0;
  for (const ComparedCell& c : comparison.cells) {
    if (c.a.has_fact("wrong_answers") != c.b.has_fact("wrong_answers")) ++unchecked;
    if (c.more_wrong_answers().value_or(0.0) == 0.0) continue;
    rows.push_back({c.a.cell.name(), fmt::format("{:.0f}", c.a.fact("wrong_answers")),
                    fmt::format("{:.0f}", c.b.fact("wrong_answers")), fmt::format("{:.0f}", c.a.checked_rays())});
  }
  std::string text = rows.size() == 1 ? "" : "\n" + format_table(rows, 1);
  if (unchecked > 0)
    text += fmt::format("\n{} had answers checked in only one of A and B: whether they are right does not compare\n",
                        counted(unchecked, "cell"));
  return text;
}

std::string structure_table(const Comparison& comparison) {
  std::vector<TableRow> rows{{"structure changed", "SAH A", "SAH B", "B/A", "bytes A", "bytes B", "B/A"}};
  for (const StructureChange& s : comparison.structures) {
    const auto text_of = [](const std::optional<double>& v, const char* format) {
      return v ? fmt::format(fmt::runtime(format), *v) : "-";
    };
    const auto ratio = [](const std::optional<double>& a, const std::optional<double>& b) {
      return a && b && *a > 0.0 ? fmt::format("{:.4f}", *b / *a) : "-";
    };
    rows.push_back({s.structure, text_of(s.sah_a, "{:.3f}"), text_of(s.sah_b, "{:.3f}"), ratio(s.sah_a, s.sah_b),
                    text_of(s.bytes_a, "{:.0f}"), text_of(s.bytes_b, "{:.0f}"), ratio(s.bytes_a, s.bytes_b)});
  }
  return rows.size() == 1 ? "" : "\n" + format_table(rows, 1);
}

std::string name_list(const std::vector<std::string>& names, const std::string& title) {
  if (names.empty()) return {};
  std::string text = fmt::format("\n{} {}\n", counted(names.size(), "cell"), title);
  for (std::size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) text += "  " + names[i] + "\n";
  if (names.size() > kMostNamed)
    text += fmt::format("  and {} more (--json FILE has them)\n", names.size() - kMostNamed);
  return text;
}

/// Of the undecided cells those whose whole interval is beyond the smallest difference, for the last line: "no
/// regression found" alone would hide them.
std::string beyond_text(const Comparison& comparison) {
  const auto undecided = [](const ComparedCell& c) { return c.verdict == Verdict::undecided && c.beyond; };
  const auto cells = std::ranges::count_if(comparison.cells, undecided);
  if (cells == 0) return {};
  std::vector<std::string> names;
  for (const ComparedCell& c : comparison.cells)
    if (undecided(c) && names.size() < kMostBeyond)
      names.push_back(fmt::format("{} (B/A {:.3f})", c.a.cell.name(), c.ratio.median));
  return fmt::format(
      "; {} {} wholly beyond {:g} % but undecided, {} on the slow side: {}{}; more than one repetition would tell",
      cells, cells == 1 ? "cell is" : "cells are", comparison.options.min_difference, comparison.suspects(),
      fmt::join(names, ", "), static_cast<std::size_t>(cells) > names.size() ? ", …" : "");
}

/// One-minute load average when the run began.
std::optional<double> load_of(const ResultFolder& f) {
  const std::string text = f.context_text("load");
  double load = 0.0;
  return std::from_chars(text.data(), text.data() + text.size(), load).ec == std::errc{} ? std::optional(load)
                                                                                         : std::nullopt;
}

/// What speaks for a machine that was busy while A or B was measured.
std::string busy_text(const ResultFolder& a, const ResultFolder& b) {
  std::string text;
  const std::optional<double> of_a = load_of(a), of_b = load_of(b);
  if (of_a && of_b && std::abs(*of_a - *of_b) > kLoadDifference)
    text += fmt::format("differs: load average at the start: {:.2f} against {:.2f}\n", *of_a, *of_b);
  for (const auto& [letter, folder] : {std::pair{"A", &a}, std::pair{"B", &b}}) {
    for (const Json& warning : folder->context.value("warnings", Json::array()))
      if (warning.is_string() && warning.get<std::string>().starts_with("noisy machine"))
        text += fmt::format("{} warned: {}\n", letter, warning.get<std::string>());
  }
  return text;
}

}  // namespace

std::string origins_text(const ResultFolder& a, const ResultFolder& b, const std::vector<SettingDifference>& settings) {
  std::string text = origin("A", a) + origin("B", b);
  std::error_code ignored;
  if (std::filesystem::equivalent(a.path, b.path, ignored)) text += "A and B are one folder: nothing can differ\n";
  for (const auto& [letter, folder] : {std::pair{"A", &a}, std::pair{"B", &b}})
    for (const std::string& difference : folder->begun) text += fmt::format("{} was {}\n", letter, difference);
  const std::vector<std::string> machine = machine_differences(a.context, b.context);
  for (const std::string& difference : machine) text += fmt::format("differs: {}\n", difference);
  if (machine.empty()) text += fmt::format("both: {}, {}\n", a.context_text("cpu"), a.context_text("compiler"));
  for (const auto& [key, title] : {std::pair{"host_name", "host"}, std::pair{"seed", "seed, and so the rays"}})
    if (a.context_text(key) != b.context_text(key))
      text += fmt::format("differs: {}: {} against {}\n", title, a.context_text(key), b.context_text(key));
  if (a.configuration_hash != b.configuration_hash)
    text +=
        "differs: configuration (effective.yaml); cells are matched by name, and compared where they did the same "
        "work\n";
  for (const SettingDifference& setting : settings) text += fmt::format("differs: {}\n", setting.text());
  return text + busy_text(a, b);
}

std::string comparison_text(const Comparison& comparison, bool all) {
  std::string text;
  if (!comparison.cells.empty()) {
    text += cell_table(comparison, true, all) + cell_table(comparison, false, all) + mean_table(comparison) +
            legend(comparison) + machine_text(comparison) + wrong_table(comparison) + structure_table(comparison);
  }
  std::vector<std::string> other;
  for (const auto& [name, why] : comparison.incomparable) other.push_back(fmt::format("{}: {}", name, why));
  const std::string how = comparison.other_settings == 0
                              ? ""
                              : " (--allow-different-settings compares those that did it for other settings)";
  return text + name_list(other, fmt::format("in both that did other work, not compared{}:", how)) +
         name_list(comparison.only_a, "only in A:") + name_list(comparison.only_b, "only in B:");
}

std::pair<ExitStatus, std::string> verdict(const Comparison& comparison) {
  if (comparison.cells.empty() && !comparison.left_nothing.empty())
    return {ExitStatus::kNothingMeasured, "nothing to compare: " + comparison.left_nothing};
  if (comparison.cells.empty()) {
    return {ExitStatus::kNothingMeasured,
            fmt::format("nothing to compare: {} only in A, {} only in B, {} in both but not the same work",
                        counted(comparison.only_a.size(), "cell"), comparison.only_b.size(),
                        comparison.incomparable.size())};
  }
  std::vector<std::string> counts;
  for (Verdict v : {Verdict::faster, Verdict::slower, Verdict::indistinguishable, Verdict::undecided})
    if (const std::size_t n = comparison.count(v); n > 0) counts.push_back(fmt::format("{} {}", n, to_string(v)));
  if (const std::size_t n = comparison.more_wrong(); n > 0)
    counts.push_back(fmt::format("{} with more wrong answers", n));
  const std::string of = fmt::format("of {} {}", counted(comparison.cells.size(), "cell"), fmt::join(counts, ", "));
  const std::string beyond = beyond_text(comparison);
  if (comparison.is_regression())
    return {ExitStatus::kRegression, fmt::format("regression: {}{}; exit status 3", of, beyond)};
  return {ExitStatus::kDone,
          fmt::format("no regression{}: {}{}", comparison.count(Verdict::undecided) > 0 ? " found" : "", of, beyond)};
}

}  // namespace arboretum
