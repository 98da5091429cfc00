#include "experiments/commands.h"
#include "scenes/fetch.h"

namespace arboretum {

ExitStatus command_fetch(const std::vector<std::string>& scenes) {
  for (const std::string& scene : scenes) fetch_scene(scene);
  return ExitStatus::kDone;
}

}  // namespace arboretum
