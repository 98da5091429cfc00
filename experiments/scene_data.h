// SceneData: a scene with the rays of its workloads and their true answers, each made once and shared by all
// cells.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "oracle/oracle.h"
#include "rendering/workload.h"
#include "scenes/scene.h"

namespace arboretum {

/// Takes one line for the user: what was made, and how long it took.
using NoteFunction = std::function<void(const std::string&)>;

class SceneData {
 public:
  /// Loads the scene and notes what the loader found. Throws UserError.
  SceneData(const SceneChoice& choice, const MeasureSettings& measure, NoteFunction note);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return scene_.mesh; }
  [[nodiscard]] const Workload& workload(const std::string& name);
  /// Against the oracle; the truth is computed at the first call for a workload.
  [[nodiscard]] AnswerCheck check(const Workload& workload, std::span<const Hit> answers);
  [[nodiscard]] AnswerCheck check(const Workload& workload, std::span<const std::uint8_t> answers);

 private:
  Oracle& oracle();
  const std::vector<ExactHit>& closest_truth(const Workload& workload);
  const std::vector<std::uint8_t>& any_truth(const Workload& workload);

  std::string name_;
  View view_;
  NoteFunction note_;
  Scene scene_;
  std::unique_ptr<Oracle> oracle_;
  std::vector<Hit> primary_hits_;  ///< the oracle's
  std::map<std::string, Workload> workloads_;
  std::map<std::string, std::vector<ExactHit>> closest_truth_;
  std::map<std::string, std::vector<std::uint8_t>> any_truth_;
};

}  // namespace arboretum
