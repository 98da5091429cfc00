#include "experiments/rendered_rays.h"

#include <algorithm>
#include <array>

#include "scenes/material_kind.h"

namespace arboretum {
namespace {

constexpr std::array<std::string_view, 2> kNames{"whitted", "path"};

/// The oracle in a structure's place. Keeps the rays that it is asked and its answers, in order; one thread at a time.
class RecordingOracle : public Accel {
 public:
  RecordingOracle(const Oracle& oracle, Workload& closest, Workload& any, std::vector<ExactHit>& closest_truth,
                  std::vector<std::uint8_t>& any_truth)
      : oracle_(oracle), closest_(closest), any_(any), closest_truth_(closest_truth), any_truth_(any_truth) {}

  [[nodiscard]] static KernelRow row() {
    KernelRow row{.structure = kInfo.name, .leaf = {}, .intersector = "exact", .box = {}, .traversal = {}};
    row.timed = {[](const Accel& accel, const KernelRow&, RayBatch rays, std::span<Hit> hits, Counters*) {
                   static_cast<const RecordingOracle&>(accel).answer(rays, hits);
                 },
                 [](const Accel& accel, const KernelRow&, RayBatch rays, std::span<std::uint8_t> occluded, Counters*) {
                   static_cast<const RecordingOracle&>(accel).answer(rays, occluded);
                 }};
    return row;
  }

  [[nodiscard]] const StructureInfo& info() const noexcept override { return kInfo; }
  void build(const TriangleMesh&, const BuildSettings&, BuildReport&) override {}
  [[nodiscard]] bool visit(StructureVisitor&) const override { return false; }
  [[nodiscard]] std::size_t bytes() const noexcept override { return 0; }

 private:
  static void keep(Workload& workload, const RayBatch& rays) {
    workload.rays.insert(workload.rays.end(), rays.rays.begin(), rays.rays.end());
    workload.times.insert(workload.times.end(), rays.times.begin(), rays.times.end());
  }
  void answer(const RayBatch& rays, std::span<Hit> hits) const {
    keep(closest_, rays);
    const std::vector<ExactHit> exact = oracle_.closest_hit(rays);
    std::ranges::transform(exact, hits.begin(), &ExactHit::hit);
    closest_truth_.insert(closest_truth_.end(), exact.begin(), exact.end());
  }
  void answer(const RayBatch& rays, std::span<std::uint8_t> occluded) const {
    keep(any_, rays);
    const std::vector<std::uint8_t> exact = oracle_.any_hit(rays);
    std::ranges::copy(exact, occluded.begin());
    any_truth_.insert(any_truth_.end(), exact.begin(), exact.end());
  }

  static inline const StructureInfo kInfo{.name = "oracle", .summary = "exact answers", .builders = {}, .leaves = {}};
  const Oracle& oracle_;
  Workload &closest_, &any_;
  std::vector<ExactHit>& closest_truth_;
  std::vector<std::uint8_t>& any_truth_;
};

/// As it is rendered: structures hold all triangles, so what cannot be seen is passed through instead of taken out.
Scene for_whole_mesh(const Scene& scene, Vec3d light) {
  Scene ready = scene;
  for (Material& m : ready.materials)
    if (is_invisible(m)) m = Material{.name = m.name, .opacity = 0.0f};
  if (!is_lit(called_for(effects_of(ready))))
    ready.lights = {Light{.position = to_float(light), .intensity = {1, 1, 1}}};
  return ready;
}

}  // namespace

std::span<const std::string_view> rendered_workload_names() { return kNames; }

bool is_rendered(std::string_view workload) noexcept { return std::ranges::find(kNames, workload) != kNames.end(); }

RenderedRays::RenderedRays(std::string_view workload, const Scene& scene, const View& view, Vec3d light,
                           const Oracle& oracle) {
  const Scene ready = for_whole_mesh(scene, light);
  scene_ = std::make_unique<const RenderScene>(ready, called_for(effects_of(ready)));
  settings_ = {.integrator = parse_integrator(std::string(workload)),
               .width = view.width,
               .height = view.height,
               .samples = 1,
               .seed = view.seed};
  closest_.name = any_.name = workload, any_.query = Query::any_hit;
  const RecordingOracle recorder(oracle, closest_, any_, closest_truth_, any_truth_);
  RenderStatistics statistics;
  picture_ = render(recorder, RecordingOracle::row(), {}, 1, statistics);
}

Picture RenderedRays::render(const Accel& accel, const KernelRow& kernel, TraversalSettings settings, unsigned threads,
                             RenderStatistics& statistics) const {
  RenderSettings own = settings_;
  own.threads = threads;
  return arboretum::render(BatchTracer(*scene_, accel, kernel, settings), own, statistics);
}

}  // namespace arboretum
