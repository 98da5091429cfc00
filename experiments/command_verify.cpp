// `verify`: cells against exact arithmetic, on a scene, on a cases file, or on random small meshes.
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <thread>

#include "core/instances.h"
#include "core/names.h"
#include "core/timer.h"
#include "experiments/append_file.h"
#include "experiments/axis_words.h"
#include "experiments/case_file.h"
#include "experiments/commands.h"
#include "experiments/config_scenes.h"
#include "experiments/crash_note.h"
#include "experiments/progress.h"
#include "experiments/summary.h"
#include "experiments/verify_breaches.h"
#include "experiments/verify_plan.h"
#include "experiments/verify_report.h"
#include "oracle/random_cases.h"

namespace arboretum {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 17;  // rays made, answered and traced at a time
constexpr std::size_t kSpreadBatch = std::size_t{1} << 14, kLeastSpreadBatch = 256;
constexpr std::size_t kSubjectRays = 64;            // of one random mesh
constexpr std::size_t kBruteForceTriangles = 2000;  // left out above it, unless it is asked for
constexpr std::size_t kCompany = 64;                // rays that a case is traced among: the largest packets'

enum class Subject { scene, cases, random };

class Verify {
 public:
  Verify(const VerifyCommand& command, const Registry& registry)
      : command_(command), registry_(registry),
        threads_(command.threads.value_or(std::max(1u, std::thread::hardware_concurrency()))), breaches_(registry) {
    if (command.subject == "random")
      subject_ = Subject::random;
    else if (std::filesystem::path(command.subject).extension() == ".json")
      subject_ = Subject::cases;
    if (subject_ != Subject::scene && (!command.offsets.empty() || !command.scales.empty()))
      throw UserError(
          "verify: --offset and --scale move and scale a scene; leave them out for cases files and random meshes");
    if (subject_ != Subject::scene && (!command.kinds.empty() || command.spread))
      throw UserError("verify: --kinds and --spread are for scenes; leave them out for cases files and random meshes");
    if (command.rays && *command.rays == 0) throw UserError("verify: --rays must be 1 or more");
    for (double offset : command.offsets)
      if (!(std::fabs(offset) <= 1e30)) throw UserError(fmt::format("verify: --offset {} is not within 1e30", offset));
    for (int exponent : command.scales)
      if (std::abs(exponent) > 120)
        throw UserError(fmt::format("verify: --scale {} is an exponent of two, -120 to 120", exponent));
    for (const std::string& kind : command.kinds) (void)kind_of(kind);
    refuse_doubled("verify: --kinds", command.kinds);
    refuse_doubled("verify: --offset", command.offsets), refuse_doubled("verify: --scale", command.scales);
  }

  ExitStatus run() {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads_);
    const CrashNote crash("");
    if (!command_.out.empty()) make_output_folder(command_.out);
    if (subject_ == Subject::scene) scene();
    if (subject_ == Subject::cases) cases();
    if (subject_ == Subject::random) random(nullptr, command_.rays.value_or(kVerifyRays));
    if (cells_.empty()) return nothing();
    return report();
  }

 private:
  static HardKind kind_of(const std::string& name) {
    std::vector<std::string> known(kHardKindNames.begin(), kHardKindNames.begin() + kMadeKinds);
    const auto found = std::ranges::find(known, name);
    if (found == known.end())
      throw UserError(fmt::format("verify: --kinds: {}", unknown_name_message("kind of ray", name, known)));
    return static_cast<HardKind>(found - known.begin());
  }

  // Cells.

  void make_cells(const SceneChoice& scene, std::size_t triangles) {
    plan_ =
        make_verify_plan(command_, scene, subject_ == Subject::scene && triangles > kBruteForceTriangles, registry_);
    for (const Cell& cell : plan_.cells)
      cells_.push_back({cell, promise_of(cell.structure, cell.intersector, cell.box), {}, {}});
  }

  ExitStatus nothing() const {
    fmt::print("{}", skipped_lines(plan_, {}));
    flush_output();
    fmt::print(stderr, "arboretum: nothing to verify: {} combinations skipped, {} filtered out\n", plan_.skipped.size(),
               plan_.filtered);
    return ExitStatus::kNothingMeasured;
  }

  // Subjects.

  void scene() {
    const SceneChoice choice = scene_of_word(command_.subject);
    const Scene loaded = load_scene(choice.spec);
    const TriangleMesh& mesh = loaded.mesh;
    make_cells(choice, mesh.size());
    if (cells_.empty()) return;
    variants_.clear();
    for (double offset : command_.offsets.empty() ? std::vector<double>{0.0} : command_.offsets)
      for (int exponent : command_.scales.empty() ? std::vector<int>{0} : command_.scales)
        variants_.push_back({offset, exponent});
    const std::uint64_t rays = command_.rays.value_or(kVerifyRays),
                        each = (rays + variants_.size() - 1) / variants_.size();
    expect_instances_stay(choice.name, mesh);
    title_ = fmt::format("{}: {} triangles", choice.name, mesh.size());
    Progress progress(variants_.size(), variants_.size() * each);
    for (std::size_t v = 0; v < variants_.size(); ++v) {
      const VerifyVariant& variant = variants_[v];
      const std::string name = fmt::format("{}-offset{}-scale{}", choice.name, variant.offset, variant.exponent);
      const TriangleMesh placed = moved_and_scaled(mesh, variant.offset, variant.exponent);
      const Bounds3f box = placed.bounds();
      if (!is_finite(box.lower) || !is_finite(box.upper))
        throw UserError(
            fmt::format("verify: {}: coordinates beyond float32; choose a smaller --offset or --scale", name));
      const double begin = wall_seconds();
      trace(placed, v, each, progress, name);
      progress.cell_done(
          name, fmt::format("{} rays on {} cells in {}", each, cells_.size(), format_duration(wall_seconds() - begin)));
    }
  }

  /// moved_and_scaled() leaves instances out, and two_level would then be verified on one: an answer about something
  /// else.
  void expect_instances_stay(const std::string& name, const TriangleMesh& mesh) const {
    const bool moves =
        std::ranges::any_of(variants_, [](const VerifyVariant& v) { return v.offset != 0.0 || v.exponent != 0; });
    const bool reads = std::ranges::any_of(
        cells_, [this](const VerifiedCell& v) { return registry_.structure(v.cell.structure)->info.takes_below; });
    if (mesh.instancing && moves && reads)
      throw UserError(
          fmt::format("verify: {}: --offset and --scale move its triangles and not its {} instances, which two_level "
                      "is built over; "
                      "leave those out, or two_level by --skip two_level",
                      name, mesh.instancing->instances.size()));
  }

  void trace(const TriangleMesh& mesh, std::size_t variant, std::uint64_t rays, Progress& progress,
             const std::string& name) {
    const Oracle oracle(mesh);
    const HardRayMaker maker(mesh);
    std::vector<HardKind> kinds;
    for (std::size_t k = 0; k < kMadeKinds; ++k) {
      const bool wanted =
          command_.kinds.empty() || std::ranges::find(command_.kinds, kHardKindNames[k]) != command_.kinds.end();
      if (!wanted) continue;
      if (maker.has(static_cast<HardKind>(k)))
        kinds.push_back(static_cast<HardKind>(k));
      else if (!command_.kinds.empty())
        progress.note(fmt::format("{}: has no {} to aim at", name, kHardKindNames[k]));
    }
    if (kinds.empty())
      throw UserError(fmt::format("verify: {}: has nothing that rays of these --kinds are aimed at", name));
    StructureShelf shelf(mesh, registry_, threads_);
    const std::size_t batch_size = command_.spread ? spread_batch(rays) : kBatch;
    const std::uint64_t batches = (rays + batch_size - 1) / batch_size, before = cells_reached_;
    // A cell's batches follow each other, so that its structure need not be kept for a second round.
    const std::uint64_t reached = std::min<std::uint64_t>(batches, cells_.size());
    const auto cell_of = [&](std::uint64_t batch) -> VerifiedCell& {
      return cells_[(before + batch * reached / batches) % cells_.size()];
    };
    if (command_.spread)
      for (std::uint64_t batch = 0; batch < batches; ++batch) shelf.expect(cell_of(batch).cell, 1);
    else
      for (const VerifiedCell& verified : cells_) shelf.expect(verified.cell, batches);
    cells_reached_ += reached;
    for (std::uint64_t begin = 0; begin < rays; begin += batch_size) {
      const std::size_t count = std::min<std::uint64_t>(batch_size, rays - begin);
      const HardRays made = maker.make(command_.seed, begin, count, kinds);
      const VerifyBatch batch{mesh, oracle, made, oracle.closest_hit(made.batch()), begin};
      if (command_.spread) {
        VerifiedCell& cell = cell_of(begin / batch_size);
        std::vector<Hit> hits;
        cell.add(variant, verify_cell(cell.cell, shelf.get(cell.cell), batch, hits, {}));
      } else {
        verify_all(cells_, variant, shelf, batch);
      }
      breaches_.keep(cells_, mesh, variant, name);
      progress.step(name, count);
    }
  }

  /// So that each cell has a share, where the rays are enough for shares that are worth it.
  std::size_t spread_batch(std::uint64_t rays) const {
    return std::clamp(std::size_t(rays / cells_.size()), kLeastSpreadBatch, kSpreadBatch);
  }

  void cases() {
    const std::vector<VerifyCase> given = read_case_file(command_.subject);
    make_cells({.spec = {}, .name = std::filesystem::path(command_.subject).stem().string()}, 0);
    if (cells_.empty()) return;
    title_ = fmt::format("{}: {} cases", command_.subject, given.size());
    for (const VerifyCase& c : given) {
      HardRays ray;
      ray.rays = {c.ray}, ray.kinds = {HardKind::given}, ray.sources = {kNoPrimitive};
      std::vector<std::uint64_t> wrong_before;
      for (const VerifiedCell& v : cells_) wrong_before.push_back(faults(v));
      const std::size_t place = (7 * total_rays_ + 3) % kCompany;
      const Company company{in_company(c.ray, command_.seed, kCompany, place), place};
      small_subject(c.mesh, ray, total_rays_++, c.id, &company);
      for (std::size_t i = 0; i < cells_.size(); ++i)
        if (faults(cells_[i]) > wrong_before[i]) cells_[i].wrong_cases.push_back(c.id);
    }
    if (command_.rays && *command_.rays > given.size()) random(&given, *command_.rays - given.size());
  }

  static std::uint64_t faults(const VerifiedCell& cell) {
    if (cell.tallies.empty()) return 0;
    return cell.tallies[0][static_cast<std::size_t>(HardKind::given)].faults();
  }

  /// Random meshes, or mutations of the cases given that have a triangle.
  void random(const std::vector<VerifyCase>* given, std::uint64_t rays) {
    std::vector<const VerifyCase*> bases;
    if (given) {
      for (const VerifyCase& c : *given)
        if (c.mesh.size() > 0) bases.push_back(&c);
      if (bases.empty())
        return Progress(1, 1).note("no case has a triangle of finite corners to mutate: each goes alone");
    } else {
      make_cells({.spec = {}, .name = "random"}, 0);
      if (cells_.empty()) return;
    }
    const std::uint64_t subjects = (rays + kSubjectRays - 1) / kSubjectRays;
    title_ += fmt::format("{}{} random meshes", title_.empty() ? "" : " and ", subjects);
    Progress progress(1, subjects);
    for (std::uint64_t i = 0; i < subjects; ++i) {
      const std::size_t count = std::min<std::uint64_t>(kSubjectRays, rays - i * kSubjectRays);
      const VerifyCase* base = given ? bases[i % bases.size()] : nullptr;
      const RandomSubject subject = base ? mutated_subject(base->mesh, base->ray, command_.seed, i, count)
                                         : random_subject(command_.seed, i, count);
      small_subject(subject.mesh, subject.rays, total_rays_,
                    fmt::format("{}-seed{}-{}", base ? base->id : "random", command_.seed, i));
      total_rays_ += count;
      progress.step("random meshes", 1);
    }
    progress.cell_done("random meshes", fmt::format("{} rays", rays));
  }

  void small_subject(const TriangleMesh& mesh, const HardRays& rays, std::uint64_t first, const std::string& name,
                     const Company* company = nullptr) {
    tbb::task_arena(1).execute([&] {  // too little work to share out
      const Oracle oracle(mesh);
      StructureShelf shelf(mesh, registry_, 1);
      verify_all(cells_, 0, shelf, {mesh, oracle, rays, oracle.closest_hit(rays.batch()), first}, company);
    });
    breaches_.keep(cells_, mesh, 0, name);
  }

  ExitStatus report() {
    std::uint64_t rays = 0;
    for (const VerifiedCell& cell : cells_) rays = command_.spread ? rays + cell.sum().rays : cell.sum().rays;
    fmt::print("{}, {} rays{}, {} cells\n{}", title_, rays, command_.spread ? " in all" : "", cells_.size(),
               verify_tables(cells_, subject_ != Subject::cases || command_.rays));
    fmt::print("{}", skipped_lines(plan_, {}));
    const auto [broken, promising, untested, lines] = promises_kept(cells_);
    if (!lines.empty()) fmt::print("\n{}", lines);
    const std::string document = breaches_.document();
    if (!document.empty()) fmt::print("\n{}", document);
    if (!command_.out.empty()) {
      write_whole(command_.out / "verify.csv", verify_csv(cells_, variants_));
      std::error_code ignored;
      if (!document.empty())
        write_whole(command_.out / "cases.json", document);
      else
        std::filesystem::remove(command_.out / "cases.json", ignored);  // of a run before
      fmt::print("\n{}\n", (command_.out / "verify.csv").string());
    }
    if (untested > 0)
      fmt::print("{} of {} cells had no ray and are not judged: --rays {} and more reaches all of them\n", untested,
                 cells_.size(), kLeastSpreadBatch * cells_.size());
    if (broken > 0) {
      fmt::print("{} of {} cells that promise something break it\n", broken, promising);
      return ExitStatus::kWrongAnswers;
    }
    fmt::print("all {} cells that promise something keep it; {} promise nothing\n", promising,
               cells_.size() - untested - promising);
    return ExitStatus::kDone;
  }

  const VerifyCommand& command_;
  const Registry& registry_;
  unsigned threads_;
  Subject subject_ = Subject::scene;
  Plan plan_;
  std::vector<VerifiedCell> cells_;
  std::vector<VerifyVariant> variants_{{}};
  std::string title_;
  std::uint64_t cells_reached_ = 0;  ///< by rays that are spread, over all variants
  std::uint64_t total_rays_ = 0;
  KeptBreaches breaches_;
};

}  // namespace

ExitStatus command_verify(const VerifyCommand& command, const Registry& registry) {
  return Verify(command, registry).run();
}

ExitStatus command_verify(const VerifyCommand& command) { return command_verify(command, this_registry()); }

}  // namespace arboretum
