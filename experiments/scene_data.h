// SceneData: a scene with the rays of its workloads and their true answers, each made once and shared by all
// cells.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "experiments/config.h"
#include "experiments/rendered_rays.h"
#include "experiments/result.h"
#include "oracle/start_check.h"
#include "rendering/workload.h"
#include "scenes/scene.h"

namespace arboretum {

/// Takes one line for the user: what was made, and how long it took.
using NoteFunction = std::function<void(const std::string&)>;

class SceneData {
 public:
  /// Loads the scene and notes what the loader found; without `note` that waits for note_to(). Throws UserError.
  SceneData(const SceneChoice& choice, const MeasureSettings& measure, NoteFunction note = {});
  SceneData(const SceneData&) = delete;
  SceneData& operator=(const SceneData&) = delete;

  /// Where notes go from now on, those that wait first.
  void note_to(NoteFunction note);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return scene_.mesh; }
  /// Hash of the mesh, as loaded and placed, and of the camera, shutter, lights, environment, materials and images that
  /// come with it: what a scene's name alone does not tell.
  [[nodiscard]] std::string geometry() const;
  /// Of a scene that is placed: `offset`, `radius` (half the diagonal), `triangle_aspect_median`.
  [[nodiscard]] const Json& facts() const noexcept { return facts_; }
  /// `start`: of workloads whose rays start on surfaces. The reference stays.
  [[nodiscard]] const Workload& workload(const std::string& name, SurfaceStart start = {});
  /// `whitted` or `path`, with the exact answers to its recorded rays.
  [[nodiscard]] const RenderedRays& rendered(const std::string& name);
  /// Against the oracle; the truth is computed at the first call for a workload, which is one of workload().
  [[nodiscard]] AnswerCheck check(const Workload& workload, std::span<const Hit> answers);
  [[nodiscard]] AnswerCheck check(const Workload& workload, std::span<const std::uint8_t> answers);
  [[nodiscard]] AnswerCheck check(const RenderedRays& rays, std::span<const Hit> answers);
  [[nodiscard]] AnswerCheck check(const RenderedRays& rays, std::span<const std::uint8_t> answers);
  /// Of `camera_edges`: where in the picture rays are aimed at an edge or vertex that the camera sees.
  [[nodiscard]] std::vector<std::array<float, 2>> seen_pixels(const Workload& workload);
  /// Of `camera_edges`: where in the picture answers are cracks.
  [[nodiscard]] std::vector<std::array<float, 2>> leak_pixels(const Workload& workload, std::span<const Hit> answers);
  /// Of rays that start on surfaces.
  [[nodiscard]] StartCheck check_starts(const Workload& workload, std::span<const Hit> answers);
  [[nodiscard]] StartCheck check_starts(const Workload& workload, std::span<const std::uint8_t> answers);
  /// What of the scene was read and what dropped, for the context of results: `triangles`, `triangles_read`, `dropped`
  /// by reason, `warnings`.
  [[nodiscard]] Json load_report() const;
  /// How far from their hit points rays begin on average, as a share of the scene's diagonal.
  [[nodiscard]] double start_distance(const Workload& workload) const;

 private:
  /// Before any ray is made.
  void place(const Placing& placing);
  Oracle& oracle();
  /// Computes, and notes how long it took; `of` says more of the rays.
  template <class Answers, class Compute>
  const Answers& truth(Answers& entry, const Workload& workload, std::string_view of, const Compute& compute);
  const std::vector<Hit>& primary_hits();
  const std::vector<ExactHit>& closest_truth(const Workload& workload);
  const std::vector<std::uint8_t>& any_truth(const Workload& workload);
  const std::vector<ExactHit>& start_truth(const Workload& workload);

  std::string name_;
  View view_;
  NoteFunction note_;
  std::vector<std::string> waiting_;  ///< notes from before there was anyone to take them
  Scene scene_;
  std::unique_ptr<Oracle> oracle_;
  Json facts_ = Json::object();
  std::vector<Hit> primary_hits_;  ///< the oracle's
  std::map<std::pair<std::string, SelfIntersection>, Workload> workloads_;
  std::map<std::string, RenderedRays> rendered_;
  std::map<const Workload*, std::vector<ExactHit>> closest_truth_;
  std::map<const Workload*, std::vector<std::uint8_t>> any_truth_;
  std::map<std::string, std::vector<ExactHit>> start_truth_;  ///< the same for all ways of leaving the surface
};

/// Of the `scenes` of a context, a line each: those that lost triangles which could have been hit, not merely ones
/// without area.
[[nodiscard]] std::vector<std::string> dropped_warnings(const Json& scenes);

/// A scene that was loaded before its turn.
struct LoadedScene {
  std::size_t index = 0;                 ///< of the experiment's scenes
  std::unique_ptr<SceneData> data = {};  ///< null: none was
};

}  // namespace arboretum
