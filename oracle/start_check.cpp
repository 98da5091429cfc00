#include "oracle/start_check.h"

#include <stdexcept>

#include "oracle/answer_check.h"

namespace arboretum {
namespace {

void expect_one_size(std::size_t truth, std::size_t answers) {
  if (truth != answers) throw std::invalid_argument("start check: as many exact as given answers are needed");
}

}  // namespace

StartCheck check_closest_starts(std::span<const ExactHit> truth, std::span<const Hit> answers,
                                std::span<const std::uint32_t> sources) {
  expect_one_size(truth.size(), answers.size()), expect_one_size(truth.size(), sources.size());
  StartCheck check;
  check.rays = truth.size();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Hit &exact = truth[i].hit, &given = answers[i];
    if (given.is_hit() && given.primitive == sources[i]) {
      ++check.self_hits;
    } else if (given.primitive != exact.primitive) {  // kNoPrimitive: a miss
      const double tolerance = surface_tolerance(truth[i].t);
      if (given.is_hit() && (!exact.is_hit() || !(given.t >= truth[i].t - tolerance))) ++check.near_hits;
      if (exact.is_hit() && (!given.is_hit() || given.t > truth[i].t + tolerance)) ++check.leaks;
    }
  }
  return check;
}

StartCheck check_any_starts(std::span<const ExactHit> truth, std::span<const std::uint8_t> answers) {
  expect_one_size(truth.size(), answers.size());
  StartCheck check;
  check.rays = truth.size();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    check.self_hits += answers[i] != 0 && !truth[i].hit.is_hit();
    check.leaks += answers[i] != 1 && truth[i].hit.is_hit();
  }
  return check;
}

}  // namespace arboretum
