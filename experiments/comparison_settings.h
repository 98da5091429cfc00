// Settings by which two runs differ, as their effective.yaml have them. Of two revisions a default that has changed
// looks the same as a value that was asked for.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace arboretum {

struct SettingDifference {
  std::string name;  ///< as in the file: "parameters: bins", "measure: resolution"
  std::string a, b;  ///< values; a list with brackets
  /// "parameters: bins: [4] against [64]"
  [[nodiscard]] std::string text() const { return name + ": " + a + " against " + b; }
};

/// Of axes, parameters, rays, measure and metrics, in A's order; of scenes, include and exclude nothing, which names
/// and hashes tell. None where a folder has no effective.yaml that can be read, and of what only one of them knows.
[[nodiscard]] std::vector<SettingDifference> setting_differences(const std::filesystem::path& a,
                                                                 const std::filesystem::path& b);

}  // namespace arboretum
