#include "experiments/verify_breaches.h"

#include <fmt/format.h>

#include "experiments/case_file.h"
#include "experiments/verify_reduce.h"
#include "experiments/verify_report.h"

namespace arboretum {
namespace {

constexpr std::size_t kMostCases = 20;  // breaches that are told
constexpr unsigned kMostTries = 16;     // at a case of one cell

}  // namespace

void KeptBreaches::keep(std::vector<VerifiedCell>& cells, const TriangleMesh& mesh, std::size_t variant,
                        const std::string& name) {
  kept_.resize(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Breach breach = std::exchange(cells[i].newest, {});
    Kept& kept = kept_[i];
    if (breach.what.empty() || kept.has_case || kept.tries == kMostTries || cases_.size() >= kMostCases) continue;
    const RayNumber ray{variant, breach.ray};
    // One case for a ray, however many cells it defeats.
    if (case_rays_.contains(ray)) {
      kept.has_case = true;
      continue;
    }
    ++kept.tries;
    const std::string id = fmt::format("{}-ray{}", name, breach.ray),
                      why = fmt::format("{}: {}", cell_label(cells[i].cell), breach.what);
    if (const auto part = reduce(cells[i], registry_, mesh, breach)) {
      cases_.push_back(case_json(id, why, *part, breach.given));
      case_rays_.insert(ray), kept.has_case = true;
    } else if (kept.words.empty()) {
      kept.ray = ray, kept.words = ray_json(id, why, breach.given, breach.time);
    }
  }
}

/// Of cells that have no case; one for a ray.
std::vector<std::string> KeptBreaches::unreduced() const {
  std::vector<std::string> lines;
  std::set<RayNumber> told;
  for (const Kept& kept : kept_)
    if (!kept.has_case && !kept.words.empty() && lines.size() < kMostCases && !case_rays_.contains(kept.ray) &&
        told.insert(kept.ray).second)
      lines.push_back(kept.words);
  return lines;
}

std::string KeptBreaches::document() const {
  const std::vector<std::string> rest = unreduced();
  if (cases_.empty() && rest.empty()) return {};
  std::string text = fmt::format("{{\"cases\": [\n{}\n]", fmt::join(cases_, ",\n"));
  if (!rest.empty()) text += fmt::format(", \"unreduced\": [\n{}\n]", fmt::join(rest, ",\n"));
  return text + "}\n";
}

PromisesKept promises_kept(const std::vector<VerifiedCell>& cells) {
  PromisesKept sums;
  for (const VerifiedCell& cell : cells) {
    const VerifyTally sum = cell.sum();
    if (sum.rays == 0) {
      ++sums.untested;
      continue;
    }
    sums.promising += cell.promise.any();
    if (sum.broken == 0) continue;
    if (++sums.broken <= kMostCases) sums.lines += describe_breach(cell, sum) + "\n";
  }
  return sums;
}

}  // namespace arboretum
