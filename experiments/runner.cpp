#include "experiments/runner.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <new>
#include <thread>

#include "core/error.h"
#include "core/parse_number.h"
#include "experiments/append_file.h"
#include "experiments/build_job.h"
#include "experiments/crash_note.h"
#include "experiments/interleave.h"
#include "experiments/json_text.h"
#include "experiments/parameters.h"
#include "experiments/plan_record.h"
#include "experiments/progress.h"
#include "experiments/sampling.h"
#include "experiments/scene_data.h"
#include "experiments/structure_pool.h"
#include "experiments/render_job.h"
#include "experiments/table_text.h"
#include "experiments/trace_job.h"

namespace arboretum {
namespace {

constexpr std::size_t kMostSeenPoints = 30000;
constexpr std::size_t kPrepareUnits = 2;  // making a cell ready takes about two repetitions
constexpr const char* kNoMemory = "out of memory; lower `measure: memory`, the resolution or the number of triangles";

class Runner {
 public:
  Runner(const Experiment& experiment, const Plan& plan, const Registry& registry, Journal& journal,
         const RunOptions& options, LoadedScene loaded)
      : experiment_(experiment), plan_(plan), registry_(registry), journal_(journal), options_(options),
        loaded_(std::move(loaded)), cpu_(std::ranges::all_of(plan.cells, allows_cpu_time)),
        progress_(pending_cells(), pending_units()),
        cache_(experiment.measure.structure_cache, [this](const std::string& line) { progress_.note(line); }) {}

  RunOutcome run() {
    try {
      for (std::size_t scene = 0; scene < experiment_.scenes.size() && !outcome_.stopped; ++scene) run_scene(scene);
    } catch (const UserError& e) {
      outcome_.error = e.what();
    } catch (const std::bad_alloc&) {
      outcome_.error = kNoMemory;
    }
    for (const Cell& cell : plan_.cells) {
      const std::string name = cell.name();
      if (const auto old = journal_.done().find(name); old != journal_.done().end())
        outcome_.results.push_back(old->second);
      else if (const auto fresh = finished_.find(name); fresh != finished_.end())
        outcome_.results.push_back(fresh->second);
    }
    return std::move(outcome_);
  }

 private:
  /// A cell on its way: what is known of it and the repetitions so far.
  struct Running {
    CellResult result;
    std::size_t wanted = 0;
  };

  unsigned repetitions() const { return experiment_.measure.repetitions; }

  bool pending(const Cell& cell) const { return !journal_.done().contains(cell.name()); }

  std::size_t pending_cells() const {
    return static_cast<std::size_t>(std::ranges::count_if(plan_.cells, [&](const Cell& c) { return pending(c); }));
  }

  std::size_t pending_units() const {
    std::size_t units = 0;
    for (const Cell& cell : plan_.cells)
      if (pending(cell)) units += kPrepareUnits + repetitions() - journal_.started(cell.name()).size();
    return units;
  }

  void run_scene(std::size_t index) {
    std::vector<const Cell*> builds, traces;
    for (const Cell& cell : plan_.cells) {
      if (cell.scene_index != index || !pending(cell)) continue;
      (cell.metric == Cell::Metric::build ? builds : traces).push_back(&cell);
    }
    if (builds.empty() && traces.empty()) return;
    std::unique_ptr<SceneData> scene = std::move(loaded_.data);
    if (!scene || loaded_.index != index) {
      scene.reset();  // before the next one is loaded
      scene = std::make_unique<SceneData>(experiment_.scenes[index], experiment_.measure);
    }
    SceneData& data = *scene;
    refuse_changed(data);
    outcome_.scenes[data.name()] = data.load_report();
    data.note_to([this](const std::string& line) { progress_.note(line); });
    StructurePool pool(data.mesh(), registry_, experiment_.metrics.quality, cache_);
    if (!builds.empty()) run_builds(builds, data, pool);
    run_traces(traces, data, pool);
  }

  /// Between the plan and its turn a scene's files may have been edited.
  void refuse_changed(const SceneData& data) const {
    const auto begun = options_.geometry.find(data.name());
    if (begun == options_.geometry.end() || begun->second == data.geometry()) return;
    throw UserError(
        fmt::format("scene {} is not what it was when the run began ({}); put its files back and go on with --resume",
                    data.name(), kHeldByGeometry));
  }

  /// Cells that share a structure stay together; as many structures are held at once as fit the memory.
  void run_traces(const std::vector<const Cell*>& traces, SceneData& data, StructurePool& pool) {
    std::vector<std::string> order;
    std::map<std::string, std::vector<const Cell*>> by_structure;
    for (const Cell* cell : traces) {
      auto& cells = by_structure[pool.key(*cell)];
      if (cells.empty()) order.push_back(pool.key(*cell));
      cells.push_back(cell);
    }
    for (std::size_t next = 0; next < order.size() && !outcome_.stopped;) {
      std::vector<const Cell*> batch;
      do {
        const auto& cells = by_structure[order[next++]];
        if (try_for(cells, [&] {
              begin_to("the build for " + cells.front()->name(), [&] { (void)pool.get(*cells.front()); });
            }))
          batch.insert(batch.end(), cells.begin(), cells.end());
      } while (next < order.size() && pool.held_bytes() + pool.expected_bytes(*by_structure[order[next]].front()) <=
                                          experiment_.measure.memory);
      run_batch(batch, data, pool);
    }
  }

  /// All cells of a batch, one workload after the other; a structure is freed when its last cell has ended.
  void run_batch(const std::vector<const Cell*>& batch, SceneData& data, StructurePool& pool) {
    std::vector<std::string> workloads;
    std::map<std::string, std::size_t> users;
    for (const Cell* cell : batch) {
      ++users[pool.key(*cell)];
      if (std::ranges::find(workloads, cell->workload_name()) == workloads.end())
        workloads.push_back(cell->workload_name());
    }
    for (const std::string& name : workloads) {
      std::vector<const Cell*> cells;
      std::ranges::copy_if(batch, std::back_inserter(cells), [&](const Cell* c) { return c->workload_name() == name; });
      if (!outcome_.stopped) trace_workload(cells, data, pool);
      for (const Cell* cell : cells)
        if (--users[pool.key(*cell)] == 0) pool.release(pool.key(*cell));
    }
  }

  void trace_workload(const std::vector<const Cell*>& cells, SceneData& data, StructurePool& pool) {
    const std::string& name = cells.front()->workload;
    if (is_rendered(name)) return measure<RenderJob>(cells, data.rendered(name), data, pool);
    const Workload& workload = data.workload(name, cells.front()->start);
    if (workload.rays.empty()) {
      for (const Cell* cell : cells)
        fail(*cell, fmt::format("no {} rays: no primary ray hits the scene", workload.name));
      return;
    }
    if (experiment_.metrics.accuracy && !workload.pixels.empty()) keep_seen_points(data, workload);
    measure<TraceJob>(cells, workload, data, pool);
  }

  /// Job: TraceJob or RenderJob, of the rays that it takes.
  template <class Job, class Rays>
  void measure(const std::vector<const Cell*>& cells, const Rays& rays, SceneData& data, StructurePool& pool) {
    AnswerBuffers buffers;
    std::deque<Job> jobs;
    std::vector<InterleavedJob> interleaved;
    for (const Cell* cell : cells) {
      Json facts = Json::object();
      const auto prepare = [&] {
        const Accel& accel = pool.get(*cell);
        facts.update(pool.facts(*cell, accel));
        facts.update(data.facts());
        pool.add_build_facts(*cell, facts);
        jobs.emplace_back(*cell, accel, rays, buffers).prepare(facts, data, experiment_.measure);
      };
      if (!try_for({cell}, [&] { begin_to(cell->name(), prepare); })) continue;
      Job& job = jobs.back();
      Running& running = begin(*cell);
      running.result.facts.update(facts);
      interleaved.push_back(
          interleaved_job(running, job.passes(), [&job](TimedLoop& loop) { return job.measure(loop); }));
      if (options_.fail_fast && running.result.fact("wrong_answers") > 0) {
        outcome_.stopped = true;
        break;
      }
    }
    run_interleaved(std::move(interleaved));
  }

  /// What the picture of leaks is drawn on.
  void keep_seen_points(SceneData& data, const Workload& workload) const {
    const MeasureSettings& m = experiment_.measure;
    const Json file{{"scene", data.name()},
                    {"width", m.width},
                    {"height", m.height},
                    {"points", picture_points(data.seen_pixels(workload), kMostSeenPoints)}};
    write_whole(journal_.folder() / seen_points_file(data.name()), to_text(file) + "\n", kGoesOn);
  }

  void run_builds(const std::vector<const Cell*>& cells, SceneData& data, StructurePool& pool) {
    std::deque<BuildJob> jobs;
    std::vector<InterleavedJob> interleaved;
    for (const Cell* cell : cells) {
      BuildJob& job = jobs.emplace_back(*cell, data.mesh(), registry_);
      Json facts = Json::object();
      const auto prepare = [&] { job.prepare(facts, pool, experiment_.measure); };
      if (!try_for({cell}, [&] { begin_to(cell->name(), prepare); })) continue;
      Running& running = begin(*cell);
      running.result.facts.update(facts);
      interleaved.push_back(
          interleaved_job(running, job.builds(), [&job](TimedLoop& loop) { return job.measure(loop); }));
    }
    run_interleaved(std::move(interleaved));
  }

  /// The parameters that the cell depends on: those that its builder reads, and of rays those of their traversal.
  Json parameter_facts(const Cell& cell) const {
    Json facts = Json::object();
    for (const std::string& name : parameter_names()) {
      const bool read = is_of_traversal(name)
                            ? cell.metric == Cell::Metric::trace && concerns(name, cell.traversal)
                            : registry_.reads(name, cell.structure, cell.builder, cell.parameters.below);
      if (!read) continue;
      const std::string text = parameter_text({cell.parameters, cell.settings}, name);
      const auto whole = parse_number<std::uint64_t>(text);
      const auto number = parse_number<double>(text);
      facts["parameters"][name] = whole ? Json(*whole) : number ? Json(*number) : Json(text);
    }
    return facts;
  }

  Running& begin(const Cell& cell) {
    const std::string name = cell.name();
    Running& running = running_[name];
    running.result = {.cell = cell, .repetitions = journal_.started(name), .facts = parameter_facts(cell)};
    running.wanted = repetitions();
    std::erase_if(running.result.repetitions, [&](const Repetition& r) { return r.index >= running.wanted; });
    progress_.step(name, kPrepareUnits);
    return running;
  }

  InterleavedJob interleaved_job(Running& running, std::uint64_t iterations,
                                 std::function<Repetition(TimedLoop&)> measure) {
    InterleavedJob job{
        .name = running.result.cell.name(), .indices = {}, .iterations = iterations, .measure = {}, .ended = {}};
    for (unsigned i = 0; i < running.wanted; ++i)
      if (std::ranges::find(running.result.repetitions, i, &Repetition::index) == running.result.repetitions.end())
        job.indices.push_back(i);
    job.measure = [name = job.name, measure = std::move(measure)](TimedLoop& loop) {
      const UnderWay measuring(name);
      return measure(loop);
    };
    job.ended = [this, &running, name = job.name](Repetition repetition) {
      repetition.origin = options_.origin;
      journal_.add(name, repetition);
      running.result.repetitions.push_back(repetition);
      progress_.step(name, 1);
      if (running.result.repetitions.size() == running.wanted) finish(running);
    };
    if (job.indices.empty()) finish(running);  // killed between the last repetition and the cell's line
    return job;
  }

  void finish(Running& running) {
    CellResult& result = running.result;
    std::ranges::sort(result.repetitions, {}, &Repetition::index);
    journal_.finish(result);
    const std::string name = result.cell.name();
    const double rate = median(result.rates(result.is_trace() && cpu_));
    std::string outcome =
        fmt::format("{} {}", figure(rate * 1e-6, 1), result.is_trace() ? rate_unit(cpu_) : "Mtriangle/s");
    if (result.has_fact("wrong_answers"))
      outcome += fmt::format(", {} wrong", result.facts["wrong_answers"].get<std::uint64_t>());
    progress_.cell_done(name, outcome);
    finished_.insert_or_assign(name, std::move(result));
  }

  /// Does what crashes would name so; nothing that crashed before.
  void begin_to(const std::string& what, const std::function<void()>& work) const {
    if (options_.crashed.contains(what))
      throw UserError(fmt::format("left out, since {} crashed before; to try it again remove its line from {}", what,
                                  (journal_.folder() / kCrashFile).string()));
    const UnderWay under_way(what);
    work();
  }

  /// Runs `work`; a UserError of it fails the cells and is no end of the run.
  bool try_for(const std::vector<const Cell*>& cells, const std::function<void()>& work) {
    try {
      work();
      return true;
    } catch (const UserError& e) {
      for (const Cell* cell : cells) fail(*cell, e.what());
    } catch (const std::bad_alloc&) {
      for (const Cell* cell : cells) fail(*cell, kNoMemory);
    }
    if (options_.fail_fast) throw UserError(outcome_.failed.back().name + ": " + outcome_.failed.back().reason);
    return false;
  }

  void fail(const Cell& cell, const std::string& reason) {
    outcome_.failed.push_back({cell.name(), reason});
    progress_.note(fmt::format("skipped {}: {}", cell.name(), reason));
    progress_.step(cell.name(), kPrepareUnits + repetitions());
  }

  const Experiment& experiment_;
  const Plan& plan_;
  const Registry& registry_;
  Journal& journal_;
  const RunOptions& options_;
  LoadedScene loaded_;
  const bool cpu_;  ///< whether rays a second are by thread CPU time, as in the table
  Progress progress_;
  StructureCache cache_;
  RunOutcome outcome_;
  std::map<std::string, Running> running_;
  std::map<std::string, CellResult> finished_;
};

}  // namespace

RunOutcome run_plan(const Experiment& experiment, const Plan& plan, const Registry& registry, Journal& journal,
                    const RunOptions& options, LoadedScene loaded) {
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  for (const Cell& cell : plan.cells) threads = std::max(threads, cell.threads);
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, threads);
  return Runner(experiment, plan, registry, journal, options, std::move(loaded)).run();
}

}  // namespace arboretum
