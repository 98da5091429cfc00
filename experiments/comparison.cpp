#include "experiments/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <span>

#include "core/error.h"
#include "experiments/axes.h"
#include "experiments/name_filter.h"
#include "experiments/plan_record.h"
#include "experiments/ratio_bootstrap.h"
#include "experiments/results_writer.h"

namespace arboretum {
namespace {

constexpr const char* kMachine = "machine";  // the group of embree's cells, which is no axis of the table

/// CPU time is what ratios on a shared machine are made of, as long as one thread does the work.
std::vector<double> rates(const CellResult& r) { return r.rates(r.cell.threads == 1); }

class Comparer {
 public:
  Comparer(const std::vector<CellResult>& a, const std::vector<CellResult>& b, const CompareOptions& options) {
    out_.options = options, match(a, b);
  }

  Comparison run() {
    for (const ComparedCell& cell : out_.cells)
      centres_.push_back(std::log(median(rates(cell.b)) / median(rates(cell.a))));
    if (!out_.options.control.empty()) take_relative();
    choose_tests();
    const std::vector<Group> groups = make_groups();
    std::vector<std::vector<std::size_t>> groups_of(out_.cells.size());
    std::vector<Replicates> sums(groups.size(), Replicates(kResamples, 0.0));
    for (std::size_t g = 0; g < groups.size(); ++g)
      for (std::size_t i : groups[g].cells) groups_of[i].push_back(g);
    // One cell's replicates at a time: those of a large sweep would fill gigabytes.
    for (std::size_t i = 0; i < out_.cells.size(); ++i) {
      Replicates logs = replicates(i);
      for (std::size_t g : groups_of[i]) add(sums[g], logs);
      estimate(i, std::move(logs));
    }
    judge();
    for (std::size_t g = 0; g < groups.size(); ++g) add_mean(groups[g], std::move(sums[g]));
    add_structures();
    return std::move(out_);
  }

 private:
  void match(const std::vector<CellResult>& a, const std::vector<CellResult>& b) {
    std::map<std::string, const CellResult*> of_b;
    for (const CellResult& r : b) of_b.emplace(r.cell.name(), &r);
    std::set<std::string> of_a;
    for (const CellResult& r : a) {
      const std::string name = r.cell.name();
      of_a.insert(name);
      const auto found = of_b.find(name);
      if (found == of_b.end()) {
        out_.only_a.push_back(name);
      } else if (std::string why = other_settings(r, *found->second, out_.options); !why.empty()) {
        out_.incomparable.emplace_back(name, std::move(why));
        ++out_.other_settings;
      } else if (why = other_work(r, *found->second, out_.options.other_scenes); !why.empty()) {
        out_.incomparable.emplace_back(name, std::move(why));
      } else {
        ComparedCell& cell = out_.cells.emplace_back();
        cell.a = r, cell.b = *found->second;
      }
    }
    for (const CellResult& r : b)
      if (!of_a.contains(r.cell.name())) out_.only_b.push_back(r.cell.name());
  }

  /// The first setting by which the two did other work although their names are equal; empty: none.
  static std::string other_settings(const CellResult& a, const CellResult& b, const CompareOptions& options) {
    if (options.allow_different_settings) return {};
    const auto way = [](const CellResult& r) { return r.facts.value("self_intersection", ""); };
    if (a.has_fact("self_intersection") && b.has_fact("self_intersection") && way(a) != way(b))
      return fmt::format("self_intersection {} in A, {} in B", way(a), way(b));
    const Json in_a = a.facts.value("parameters", Json::object()), in_b = b.facts.value("parameters", Json::object());
    for (const auto& [name, value] : in_a.items())
      if (const auto other = in_b.find(name); other != in_b.end() && *other != value)
        return fmt::format("{} {} in A, {} in B", name, plain_text(value), plain_text(*other));
    for (const SettingDifference& d : options.settings)
      if ((d.name == "measure: resolution" && a.is_trace()) ||
          (d.name == "rays: epsilon" && way(a) == to_string(SelfIntersection::epsilon)))
        return fmt::format("{} {} in A, {} in B", d.name, d.a, d.b);
    return {};
  }

  /// Why the two do not compare although their names are equal; empty where they do.
  static std::string other_work(const CellResult& a, const CellResult& b, const std::set<std::string>& other_scenes) {
    if (other_scenes.contains(a.cell.scene))
      return fmt::format("measured with different scenes called {} ({})", a.cell.scene, kHeldByGeometry);
    for (const char* fact : {"triangles", "rays"}) {
      if (a.fact(fact) != b.fact(fact))
        return fmt::format("{:.0f} {} in A, {:.0f} in B", a.fact(fact), fact, b.fact(fact));
    }
    for (const CellResult* r : {&a, &b}) {
      const std::vector<double> of = rates(*r);
      if (of.empty() || std::ranges::min(of) <= 0.0)
        return fmt::format("no time was measured in {}", r == &a ? "A" : "B");
    }
    return {};
  }

  template <class Choose>
  std::vector<std::size_t> places(const Choose& choose) const {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < out_.cells.size(); ++i)
      if (std::invoke(choose, out_.cells[i])) found.push_back(i);
    return found;
  }

  /// Cells of which there is a geometric mean.
  struct Group {
    std::string axis, value;
    std::vector<std::size_t> cells;
  };

  static void add(Replicates& sum, const Replicates& logs) {
    for (std::size_t k = 0; k < kResamples; ++k) sum[k] += logs[k];
  }

  /// Logarithms of the cell's ratio, relative to the control's.
  Replicates replicates(std::size_t i) const {
    const ComparedCell& cell = out_.cells[i];
    Replicates logs = log_ratios(cell.a.cell.name(), rates(cell.a), rates(cell.b));
    if (const Replicates& control = control_[cell.is_trace()]; !control.empty())
      for (std::size_t k = 0; k < kResamples; ++k) logs[k] -= control[k];
    return logs;
  }

  double mean_centre(const std::vector<std::size_t>& cells) const {
    double sum = 0.0;
    for (std::size_t i : cells) sum += centres_[i];
    return sum / static_cast<double>(cells.size());
  }

  /// Of the sums of its cells' replicates.
  MeanRatio mean_of(const Group& group, Replicates sums) const {
    for (double& v : sums) v /= static_cast<double>(group.cells.size());
    MeanRatio mean{group.axis, group.value, ratio_interval(mean_centre(group.cells), std::move(sums)),
                   group.cells.size()};
    for (std::size_t i : group.cells) {
      const Verdict v = out_.cells[i].verdict;
      ++(v == Verdict::faster      ? mean.faster
         : v == Verdict::slower    ? mean.slower
         : v == Verdict::undecided ? mean.undecided
                                   : mean.indistinguishable);
    }
    return mean;
  }

  void add_mean(const Group& group, Replicates sums) {
    MeanRatio mean = mean_of(group, std::move(sums));
    if (group.axis == kMachine)
      out_.embree = std::move(mean);
    else
      out_.means.push_back(std::move(mean));
  }

  /// Divides all ratios by those of the control cells: trace by trace, builds by builds where the control has some.
  void take_relative() {
    const std::regex expression = name_expression(out_.options.control, "--control");
    bool any = false;
    for (bool trace : {true, false}) {
      const auto is_control = [&](const ComparedCell& c) {
        return c.is_trace() == trace && std::regex_search(c.a.cell.name(), expression);
      };
      const std::vector<std::size_t> cells = places(is_control);
      if (cells.empty()) continue;
      any = true;
      Replicates sum(kResamples, 0.0);
      for (std::size_t i : cells) add(sum, replicates(i));
      (trace ? out_.control_of_rays : out_.control_of_builds) = mean_of({"control", out_.options.control, cells}, sum);
      const double centre = mean_centre(cells);
      for (std::size_t i : places([&](const ComparedCell& c) { return c.is_trace() == trace; })) centres_[i] -= centre;
      for (double& v : sum) v /= static_cast<double>(cells.size());
      control_[trace] = std::move(sum);
    }
    if (!any)
      throw UserError(
          fmt::format("--control '{}' finds no cell that is in both; it is a regular expression on cell names, as in "
                      "--control /embree/",
                      out_.options.control));
  }

  void estimate(std::size_t i, Replicates logs) {
    ComparedCell& cell = out_.cells[i];
    const std::vector<double> a = rates(cell.a);
    std::vector<double> b = rates(cell.b);
    cell.rate_a = median(a), cell.rate_b = median(b);
    cell.ratio = ratio_interval(centres_[i], std::move(logs));
    const double machine = cell.ratio.median / (cell.rate_b / cell.rate_a);  // 1 without a control
    if (!out_.options.control.empty())
      for (double& rate : b) rate *= machine;
    cell.p = p_value(cell.test, a, b);
  }

  /// The same for all cells of as many repetitions, whatever was measured.
  void choose_tests() {
    const std::vector<std::size_t> tested =
        places([](const ComparedCell& c) { return std::min(c.a.repetitions.size(), c.b.repetitions.size()) > 1; });
    for (std::size_t i : tested) {
      ComparedCell& cell = out_.cells[i];
      const double least =
          smallest_p(cell.a.repetitions.size(), cell.b.repetitions.size()) * static_cast<double>(tested.size());
      cell.test = least <= out_.options.significance ? SignificanceTest::mann_whitney : SignificanceTest::welch;
    }
  }

  void judge() {
    const CompareOptions& o = out_.options;
    const double limit = 1.0 + 0.01 * o.min_difference;
    for (ComparedCell& cell : out_.cells) {
      cell.beyond = cell.ratio.low > limit || cell.ratio.high < 1.0 / limit;
      cell.equal = cell.is_tested() && cell.ratio.low > 1.0 / limit && cell.ratio.high < limit;
    }
    const std::vector<std::size_t> tested = places(&ComparedCell::is_tested);
    std::vector<double> p;
    for (std::size_t i : tested) p.push_back(out_.cells[i].p);
    p = benjamini_hochberg(p);
    for (std::size_t k = 0; k < tested.size(); ++k) {
      ComparedCell& cell = out_.cells[tested[k]];
      cell.adjusted_p = p[k];
      const bool differs = cell.beyond && cell.adjusted_p <= o.significance;
      cell.verdict = !differs ? Verdict::indistinguishable : cell.ratio.low > 1.0 ? Verdict::faster : Verdict::slower;
    }
  }

  /// All rays, the values of each axis that varies, all builds; and Embree's cells, which tell of the machine.
  std::vector<Group> make_groups() const {
    std::vector<Group> groups;
    const auto add_group = [&](std::string axis, std::string value, std::vector<std::size_t> cells) {
      if (!cells.empty()) groups.push_back({std::move(axis), std::move(value), std::move(cells)});
    };
    const std::vector<std::size_t> traced = places([](const ComparedCell& c) { return c.is_trace(); });
    add_group("", "rays", traced);
    std::vector<Json> axes(traced.size(), Json::object());
    for (std::size_t k = 0; k < traced.size(); ++k) add_axes(axes[k], out_.cells[traced[k]].a.cell);
    for (const char* axis :
         {"scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "workload", "threads"}) {
      std::vector<std::pair<std::string, std::vector<std::size_t>>> by_value;
      for (std::size_t k = 0; k < traced.size(); ++k) {
        std::string text = plain_text(axes[k][axis]);
        auto entry = std::ranges::find(by_value, text, &std::pair<std::string, std::vector<std::size_t>>::first);
        if (entry == by_value.end()) entry = by_value.insert(entry, {std::move(text), {}});
        entry->second.push_back(traced[k]);
      }
      if (by_value.size() < 2) continue;
      for (auto& [value, cells] : by_value) add_group(axis, std::move(value), std::move(cells));
    }
    add_group("", "builds", places([](const ComparedCell& c) { return !c.is_trace(); }));
    if (out_.options.control.empty())
      add_group(kMachine, "embree",
                places([](const ComparedCell& c) { return c.is_trace() && c.a.cell.structure == "embree"; }));
    return groups;
  }

  /// Trees are the same from run to run, so any difference is a change. Each is told once.
  void add_structures() {
    std::set<std::string> seen;
    for (const ComparedCell& c : out_.cells) {
      const auto fact = [](const CellResult& r, const char* name) {
        return r.has_fact(name) ? std::optional(r.fact(name)) : std::nullopt;
      };
      StructureChange change{
          fmt::format("{}/{}/{}/{}", c.a.cell.scene, c.a.cell.structure, c.a.cell.builder_name(), c.a.cell.leaf),
          fact(c.a, "sah_cost"), fact(c.b, "sah_cost"), fact(c.a, "bytes"), fact(c.b, "bytes")};
      const auto changed = [](const std::optional<double>& a, const std::optional<double>& b) {
        return a && b && std::abs(*a - *b) > 1e-9 * std::abs(*a);
      };
      if (!changed(change.sah_a, change.sah_b) && !changed(change.bytes_a, change.bytes_b)) continue;
      const auto figure = [](const std::optional<double>& v) { return v.value_or(0.0); };
      if (seen.insert(fmt::format("{} {} {} {} {}", change.structure, figure(change.sah_a), figure(change.sah_b),
                                  figure(change.bytes_a), figure(change.bytes_b)))
              .second)
        out_.structures.push_back(std::move(change));
    }
  }

  Comparison out_;
  std::vector<double> centres_;  // of each cell, the logarithm of its ratio
  Replicates control_[2];        // mean replicates of the control's builds and rays; empty: none
};

}  // namespace

std::string_view to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::faster: return "faster";
    case Verdict::slower: return "slower";
    case Verdict::indistinguishable: return "indistinguishable";
    case Verdict::undecided: return "undecided";
  }
  return "";
}

std::optional<double> ComparedCell::more_wrong_answers() const {
  if (!a.has_fact("wrong_answers") || !b.has_fact("wrong_answers")) return std::nullopt;
  return b.fact("wrong_answers") - a.fact("wrong_answers");
}

std::size_t Comparison::count(Verdict verdict) const {
  return static_cast<std::size_t>(std::ranges::count(cells, verdict, &ComparedCell::verdict));
}

std::size_t Comparison::more_wrong() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(cells, [](const ComparedCell& c) { return c.more_wrong_answers().value_or(0.0) > 0.0; }));
}

std::size_t Comparison::suspects() const {
  return static_cast<std::size_t>(std::ranges::count_if(cells, &ComparedCell::is_suspect));
}

Comparison compare_results(const std::vector<CellResult>& a, const std::vector<CellResult>& b,
                           const CompareOptions& options) {
  return Comparer(a, b, options).run();
}

}  // namespace arboretum
