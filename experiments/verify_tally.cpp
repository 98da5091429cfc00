#include "experiments/verify_tally.h"

#include <algorithm>
#include <cmath>

namespace arboretum {
namespace {

constexpr int kLowest = -32, kHighest = 40, kPerOctave = 16;  // exponents of two
constexpr std::size_t kBins = std::size_t{kHighest - kLowest} * kPerOctave + 1;

/// Bin b > 0 holds what is above 2^(kLowest + (b - 1) / kPerOctave) and not above the next; bin 0 all that is below.
double upper_end(std::size_t bin) { return std::exp2(double(kLowest) + double(bin) / kPerOctave); }

}  // namespace

void ErrorHistogram::add(double error) {
  double place = 0;
  if (error > 0) place = std::ceil((std::log2(error) - kLowest) * kPerOctave);
  const auto bin = static_cast<std::size_t>(std::clamp(place, 0.0, double(kBins - 1)));
  if (bins_.size() <= bin) bins_.resize(bin + 1);
  ++bins_[bin];
  ++count_;
  max_ = std::max(max_, error);
}

ErrorHistogram& ErrorHistogram::operator+=(const ErrorHistogram& other) {
  if (bins_.size() < other.bins_.size()) bins_.resize(other.bins_.size());
  for (std::size_t i = 0; i < other.bins_.size(); ++i) bins_[i] += other.bins_[i];
  count_ += other.count_;
  max_ = std::max(max_, other.max_);
  return *this;
}

double ErrorHistogram::quantile(double p) const {
  const auto rank = static_cast<std::uint64_t>(std::ceil(p * double(count_)));
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    below += bins_[i];
    if (below >= rank) return i == 0 ? 0.0 : std::min(upper_end(i), max_);
  }
  return 0.0;
}

VerifyTally& VerifyTally::operator+=(const VerifyTally& o) {
  rays += o.rays, exact_hits += o.exact_hits;
  missed += o.missed, false_hits += o.false_hits, wrong_surface += o.wrong_surface,
      wrong_primitive += o.wrong_primitive;
  cracks += o.cracks, any_missed += o.any_missed, any_false += o.any_false;
  self_hits += o.self_hits, differs += o.differs, broken += o.broken, in_company += o.in_company;
  t_ulp += o.t_ulp, uv += o.uv;
  if (!o.first.what.empty() && (first.what.empty() || o.first.ray < first.ray)) first = o.first;
  return *this;
}

}  // namespace arboretum
