#include "experiments/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "core/error.h"
#include "core/missing_isa.h"
#include "experiments/call_axis.h"
#include "experiments/name_filter.h"
#include "experiments/why_impossible.h"
#include "rendering/workload.h"

namespace arboretum {

std::string Cell::name() const {
  return fmt::format("{}/{}/{}/{}/{}/{}/{}/{}/{}/{}/threads:{}", to_string(metric), scene, structure, builder_name(),
                     leaf, intersector, box, traversal_name(), to_string(isa), workload_name(), threads);
}

namespace {

bool contains(const std::vector<std::string>& list, std::string_view value) {
  return std::ranges::find(list, value) != list.end();
}

class Planner {
 public:
  Planner(const Experiment& experiment, const Registry& registry) : experiment_(experiment), registry_(registry) {
    points_ = parameter_points(experiment.parameters);
  }

  Plan run() {
    for (std::size_t scene = 0; scene < experiment_.scenes.size(); ++scene) {
      std::vector<Cell> traced;
      elsewhere_.clear();
      product(scene, experiment_.axes, traced);
      for (std::size_t i = 0; i < experiment_.include.size(); ++i) add_include(i, scene, traced);
      if (experiment_.metrics.build) add_builds(traced), add_builds_elsewhere();
      if (experiment_.metrics.trace) {
        std::ranges::move(traced, std::back_inserter(plan_.cells));
        std::ranges::move(elsewhere_, std::back_inserter(plan_.elsewhere));
      }
    }
    say_once();
    refuse_ineffective();
    return std::move(plan_);
  }

 private:
  /// The structures of a scene, as they are built.
  void product(std::size_t scene, const AxisLists& lists, std::vector<Cell>& out) {
    for (const std::string& structure : lists[index_of(Axis::structure)])
      for (const std::string& builder : builders_of(structure, lists[index_of(Axis::builder)]))
        for (const ParameterPoint& point : points_)
          for (const std::string& leaf : lists[index_of(Axis::leaf)]) {
            Cell cell;
            cell.scene_index = scene, cell.scene = experiment_.scenes[scene].name;
            cell.structure = structure, cell.builder = builder, cell.leaf = leaf;
            cell.parameters = point.parameters.builder, cell.parameter_label = point.label;
            cell.settings = point.parameters.traversal, cell.setting_label = point.traversal_label;
            add_kernels(cell, lists, out);
          }
  }

  /// What traces such a structure.
  void add_kernels(Cell cell, const AxisLists& lists, std::vector<Cell>& out) {
    for (const std::string& intersector : lists[index_of(Axis::intersector)])
      for (const std::string& box : lists[index_of(Axis::box)])
        for (const std::string& traversal : lists[index_of(Axis::traversal)])
          for (const std::string& call : lists[index_of(Axis::call)])
            for (const std::string& isa : lists[index_of(Axis::isa)]) {
              cell.intersector = intersector, cell.box = box, cell.traversal = traversal, cell.call = call;
              cell.isa = *parse_isa(isa);
              add_rays(cell, lists, out);
            }
  }

  /// Which rays are traced so, and by how many threads.
  void add_rays(Cell cell, const AxisLists& lists, std::vector<Cell>& out) {
    for (const std::string& workload : lists[index_of(Axis::workload)]) {
      const std::vector<SelfIntersection> starts = starts_of(workload);
      for (const SelfIntersection start : starts)
        for (const std::string& threads : lists[index_of(Axis::threads)]) {
          cell.workload = workload, cell.threads = static_cast<unsigned>(std::stoul(threads));
          cell.start = {start, experiment_.rays.epsilon};
          cell.start_label = starts.size() > 1 ? fmt::format(":self_intersection={}", to_string(start)) : "";
          add(cell, out);
        }
    }
  }

  /// The ways of leaving a surface that make cells of the workload; the usual one for rays that start elsewhere.
  std::vector<SelfIntersection> starts_of(const std::string& workload) const {
    return starts_on_surfaces(workload) ? experiment_.rays.self_intersection
                                        : std::vector{SelfIntersection::error_bound};
  }

  /// `all` is each builder of the structure; one that is named beside it does not come twice.
  std::vector<std::string> builders_of(const std::string& structure, const std::vector<std::string>& named) const {
    const StructureEntry* entry = registry_.structure(structure);
    std::vector<std::string> builders;
    for (const std::string& name : named) {
      if (name == kAll && entry)
        builders.insert(builders.end(), entry->info.builders.begin(), entry->info.builders.end());
      else
        builders.push_back(name == kAll ? std::string(kAuto) : name);
    }
    return builders;
  }

  /// Fills in `auto` and the ISA's own widths, as far as the structure is known.
  void resolve(Cell& cell, const StructureEntry* entry) {
    cell.traversal = resolve_traversal(cell.traversal, cell.isa);
    keep_settings(cell);
    if (cell.call != kCalls.front()) cell.setting_label += fmt::format(":call={}", cell.call);
    cell.box = std::string(resolve_box(cell.box, cell.intersector));
    // What stands above another structure takes that one's defaults.
    const StructureEntry* below =
        entry && entry->info.takes_below ? registry_.structure(cell.parameters.below) : nullptr;
    if (cell.builder == kAuto) {
      const StructureEntry* of = below ? below : entry;
      cell.builder = of && !of->info.builders.empty() ? of->info.builders.front() : kNone;
    }
    if (cell.leaf == kAuto) {
      const std::string_view leaf =
          entry ? registry_.default_leaf(below ? below->info.name : cell.structure, cell.intersector, cell.isa) : "";
      cell.leaf = leaf.empty() ? kNone : leaf;
    }
    keep_parameters(cell);
  }

  /// Those that the cell's builder reads: to the others they mean nothing, and what differs in them alone is one cell.
  void keep_parameters(Cell& cell) {
    const std::string below = cell.parameters.below;
    for (const auto& [name, values] : experiment_.parameters) {
      if (is_of_traversal(name) || reads(name, cell.structure, cell.builder, below)) continue;
      reset_parameter(cell.parameters, name);
      drop_label(cell.parameter_label, name);
    }
  }

  bool reads(const std::string& parameter, const std::string& structure, const std::string& builder,
             const std::string& below) {
    const auto [known, is_new] = reads_.try_emplace({parameter, structure, builder, below}, false);
    if (is_new) known->second = registry_.reads(parameter, structure, builder, below);
    return known->second;
  }

  /// Those that the cell's way of traversal reads: as of builders.
  void keep_settings(Cell& cell) const {
    for (const auto& [name, values] : experiment_.parameters) {
      if (concerns(name, cell.traversal)) continue;
      reset_parameter(cell.settings, name);
      drop_label(cell.setting_label, name);
    }
  }

  /// Why this machine lacks what the cell needs; empty where it has it.
  std::string lacking(const Cell& cell) const {
    const std::string& missing = experiment_.scenes[cell.scene_index].missing;
    if (!missing.empty()) return missing;
    return registry_.has(cell.isa) ? "" : missing_isa_reason(cell.isa);
  }

  static bool names_scene(const CellChoice& choice, const SceneChoice& scene) {
    return choice.scenes.empty() ||
           std::ranges::any_of(choice.scenes, [&](const std::string& word) { return scene.is_called(word); });
  }

  bool matches(const CellChoice& choice, const Cell& cell) const {
    if (!names_scene(choice, experiment_.scenes[cell.scene_index])) return false;
    const std::string values[kAxisCount] = {cell.structure, cell.builder,
                                            cell.leaf,      cell.intersector,
                                            cell.box,       cell.traversal,
                                            cell.call,      std::string(to_string(cell.isa)),
                                            cell.workload,  std::to_string(cell.threads)};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (choice.axes[i].empty() || contains(choice.axes[i], values[i])) continue;
      const bool by_width =
          static_cast<Axis>(i) == Axis::traversal && std::ranges::any_of(choice.axes[i], [&](const auto& t) {
            return resolve_traversal(t, cell.isa) == values[i];
          });
      if (!by_width) return false;
    }
    return true;
  }

  void add(Cell cell, std::vector<Cell>& out) {
    const StructureEntry* entry = registry_.structure(cell.structure);
    resolve(cell, entry);
    for (std::size_t i = 0; i < experiment_.exclude.size(); ++i) {
      if (!matches(experiment_.exclude[i], cell)) continue;
      used_excludes_.insert(i);
      ++taken_away_;
      // Once, however many values of what it does not read there are
      const std::string name = listed_name(cell);
      excluded_.insert(name);
      if (include_ && excluded_of_include_.emplace(include_, name).second)
        excluded_includes_.emplace_back(name, fmt::format("{}  excluded: {} takes away what {} adds", name,
                                                          experiment_.exclude[i].where, include_->where));
      return;
    }
    if (!names_.insert(cell.name()).second) return;
    ++added_;
    traversals_.insert(cell.traversal);
    for (const auto& [parameter, where] : experiment_.parameter_places)
      if (!is_of_traversal(parameter) && reads(parameter, cell.structure, cell.builder, cell.parameters.below))
        parameters_read_.insert(parameter);
    const std::string never = why_impossible(cell, experiment_.scenes[cell.scene_index].moves, registry_),
                      here = lacking(cell);
    if (never.empty() && here.empty()) {
      out.push_back(std::move(cell));
      return;
    }
    // Said first, whatever else is the matter
    const bool missing = !experiment_.scenes[cell.scene_index].missing.empty();
    skip({listed_name(cell), never.empty() || missing ? here : never}, never.empty());
    if (never.empty()) elsewhere_.push_back(std::move(cell));
  }

  /// What is left out of a sweep that traces nothing are builds, whatever would have had them traced.
  std::string listed_name(const Cell& trace) const {
    return experiment_.metrics.trace ? trace.name() : build_of(trace).name();
  }

  /// A name once; of several reasons the one that other machines do not have.
  void skip(SkippedCell cell, bool elsewhere) {
    const auto [place, is_new] = skipped_.try_emplace(cell.name, plan_.skipped.size());
    if (is_new)
      plan_.skipped.push_back(std::move(cell));
    else if (elsewhere)
      plan_.skipped[place->second] = std::move(cell);
  }

  /// A build may be planned for one trace, skipped for another and excluded for a third: the first of these holds.
  void say_once() {
    std::set<std::string> planned;
    for (const Cell& cell : plan_.cells) planned.insert(cell.name());
    std::erase_if(plan_.skipped, [&](const SkippedCell& cell) { return planned.contains(cell.name); });
    const auto is_told = [&](const std::string& name) { return planned.contains(name) || skipped_.contains(name); };
    std::erase_if(excluded_, is_told);
    plan_.excluded = excluded_.size();
    for (auto& [name, line] : excluded_includes_)
      if (!is_told(name)) plan_.excluded_includes.push_back(std::move(line));
  }

  /// The structures that an include means. Where it names none they are those of the sweep that take a builder and a
  /// leaf that it names; where none does, all, so that the reason is seen.
  std::vector<std::string> structures_of(const CellChoice& choice) const {
    const auto& named = choice.axes[index_of(Axis::structure)];
    if (!named.empty()) return named;
    std::vector<std::string> taking = experiment_.axes[index_of(Axis::structure)];
    std::erase_if(taking, [&](const std::string& structure) {
      const StructureEntry* entry = registry_.structure(structure);
      const auto takes = [&](Axis axis, const std::vector<std::string_view>& taken) {
        const auto& values = choice.axes[index_of(axis)];
        return values.empty() || std::ranges::any_of(values, [&](const std::string& v) {
                 return v == kAuto || v == kAll || std::ranges::find(taken, v) != taken.end();
               });
      };
      return entry && !(takes(Axis::builder, entry->info.builders) && takes(Axis::leaf, entry->info.leaves));
    });
    return taking.empty() ? experiment_.axes[index_of(Axis::structure)] : taking;
  }

  /// Axes that an include does not name take the sweep's values where they apply: a builder, leaf or
  /// traversal that the structure does not take gives way to its own default.
  void add_include(std::size_t index, std::size_t scene, std::vector<Cell>& out) {
    const CellChoice& choice = experiment_.include[index];
    if (!names_scene(choice, experiment_.scenes[scene])) return;
    for (const std::string& structure : structures_of(choice)) {
      AxisLists lists = choice.axes;
      lists[index_of(Axis::structure)] = {structure};
      const StructureEntry* entry = registry_.structure(structure);
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        if (!lists[i].empty()) continue;
        lists[i] = experiment_.axes[i];
        if (!entry) continue;
        const auto keep = [&](auto&& taken) {
          std::erase_if(lists[i], [&](const std::string& v) {
            return v != kAuto && v != kAll && std::ranges::find(taken, v) == taken.end();
          });
          if (lists[i].empty()) lists[i] = {std::string(kAuto)};
        };
        if (static_cast<Axis>(i) == Axis::builder) keep(entry->info.builders);
        if (static_cast<Axis>(i) == Axis::leaf) keep(entry->info.leaves);
      }
      const std::size_t before = added_;
      const std::size_t taken_away_before = taken_away_;
      include_ = &choice;
      product(scene, lists, out);
      include_ = nullptr;
      if (added_ > before || taken_away_ > taken_away_before) used_includes_.insert(index);
    }
  }

  /// The build cell of the structure that a trace cell needs.
  static Cell build_of(Cell cell) {
    cell.metric = Cell::Metric::build;
    cell.kernel = nullptr;
    cell.intersector = cell.box = cell.traversal = cell.workload = kNone;
    cell.start = {}, cell.start_label.clear();
    cell.settings = {}, cell.call = kNone, cell.setting_label.clear();
    return cell;
  }

  /// One for each structure that the trace cells need, ISA and thread count.
  void add_builds(const std::vector<Cell>& traced) {
    for (const Cell& trace : traced) {
      Cell cell = build_of(trace);
      if (builds_.insert(cell.name()).second) plan_.cells.push_back(std::move(cell));
    }
  }

  void add_builds_elsewhere() {
    for (const Cell& trace : elsewhere_) {
      Cell cell = build_of(trace);
      if (builds_.insert(cell.name()).second) plan_.elsewhere.push_back(std::move(cell));
    }
  }

  void refuse_ineffective() const {
    if (experiment_.overridden) return;
    for (std::size_t i = 0; i < experiment_.include.size(); ++i) {
      if (!used_includes_.contains(i)) {
        throw UserError(experiment_.include[i].where +
                        ": this include adds no cell: the axes hold all of it; take it out");
      }
    }
    for (std::size_t i = 0; i < experiment_.exclude.size(); ++i) {
      if (!used_excludes_.contains(i)) {
        throw UserError(
            experiment_.exclude[i].where +
            ": this exclude takes no cell away: nothing of it is in the sweep, or others take it; take it out");
      }
    }
    for (const auto& [name, where] : experiment_.parameter_places) {
      if (!is_of_traversal(name)) {
        if (parameters_read_.contains(name)) continue;
        throw UserError(fmt::format(
            "{}: {} has no effect: no cell's builder reads it, only {}; add one to the axes, or take it out", where,
            name, registry_.readers_of(name)));
      }
      if (std::ranges::any_of(traversals_, [&key = name](const std::string& t) { return concerns(key, t); })) continue;
      throw UserError(
          fmt::format("{}: {} has no effect: no cell's traversal is {}; add one to the axis, or take it out", where,
                      name, fmt::join(traversals_reading(name), " or ")));
    }
  }

  const Experiment& experiment_;
  const Registry& registry_;
  std::vector<ParameterPoint> points_;
  Plan plan_;
  std::vector<Cell> elsewhere_;  ///< of the scene under way: possible, but for what this machine lacks
  std::set<std::string> names_, traversals_, builds_, parameters_read_;
  std::map<std::array<std::string, 4>, bool> reads_;  ///< of parameter, structure, builder, below
  std::set<std::size_t> used_includes_, used_excludes_;
  std::size_t added_ = 0, taken_away_ = 0;      ///< the latter: by excludes, a cell as often as it came up
  std::set<std::string> excluded_;              ///< names
  std::map<std::string, std::size_t> skipped_;  ///< names, and their places in the plan
  std::vector<std::pair<std::string, std::string>> excluded_includes_;  ///< name and line
  std::set<std::pair<const CellChoice*, std::string>> excluded_of_include_;
  const CellChoice* include_ = nullptr;  ///< the one whose cells are being added
};

}  // namespace

Plan make_plan(const Experiment& experiment, const Registry& registry) { return Planner(experiment, registry).run(); }

void apply_filter(Plan& plan, const std::string& filter, const std::string& skip) {
  const std::size_t before = plan.cells.size();
  const NameFilter wanted(filter, skip);
  for (std::vector<Cell>* cells : {&plan.cells, &plan.elsewhere})
    std::erase_if(*cells, [&](const Cell& cell) { return !wanted(cell.name()); });
  std::erase_if(plan.skipped, [&](const SkippedCell& cell) { return !wanted(cell.name); });
  plan.filtered += before - plan.cells.size();
}

std::vector<std::pair<std::string, std::size_t>> group_reasons(const std::vector<SkippedCell>& skipped) {
  std::map<std::string, std::size_t> counts;
  for (const SkippedCell& cell : skipped) ++counts[cell.reason];
  std::vector<std::pair<std::string, std::size_t>> groups(counts.begin(), counts.end());
  std::ranges::stable_sort(groups, std::greater<>{}, &std::pair<std::string, std::size_t>::second);
  return groups;
}

}  // namespace arboretum
