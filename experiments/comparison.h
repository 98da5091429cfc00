// Two runs cell by cell: how much faster B is than A, how sure that is, and what else changed.
//
// A cell is faster or slower where the whole bootstrap interval of the ratio of medians lies beyond the smallest
// difference that counts, and a test adjusted for the number of cells finds it significant: the Mann-Whitney test, or,
// where there are so few repetitions that its smallest p-value would not stand out among so many cells, Welch's of the
// logarithms of the times. Which of the two is a matter of numbers, not of times, so p-values stay p-values. A cell of
// one repetition is undecided, never indistinguishable.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "experiments/comparison_settings.h"
#include "experiments/result.h"
#include "experiments/sampling.h"
#include "experiments/significance.h"

namespace arboretum {

struct CompareOptions {
  double min_difference = 3.0;  ///< per cent
  double significance = 0.05;   ///< of the adjusted p-values
  /// regular expression: cells whose geometric mean speeds are taken relative to, those of rays to its traces' and
  /// those of builds to its builds'; empty: none
  std::string control = {};
  std::set<std::string> other_scenes = {};  ///< names of scenes that hold something else in B than in A
  std::vector<SettingDifference> settings = {};
  bool allow_different_settings = false;  ///< cells that did other work for them, or left surfaces otherwise, compare
  bool strict = false;  ///< an undecided cell whose whole interval is beyond the limit on the slow side is a regression
};

enum class Verdict { faster, slower, indistinguishable, undecided };
[[nodiscard]] std::string_view to_string(Verdict verdict) noexcept;

struct ComparedCell {
  CellResult a, b;
  /// medians of rays (trace) or triangles (build) a second: thread CPU time with one thread, else wall time
  double rate_a = 0.0, rate_b = 0.0;
  Interval ratio;  ///< rate of B over rate of A, with the bootstrap interval of the ratio of the medians
  SignificanceTest test = SignificanceTest::none;
  double p = 1.0, adjusted_p = 1.0;
  Verdict verdict = Verdict::undecided;
  bool equal = false;   ///< the whole interval lies within the smallest difference that counts
  bool beyond = false;  ///< the whole interval lies beyond it, to one side

  [[nodiscard]] bool is_trace() const noexcept { return a.is_trace(); }
  [[nodiscard]] bool is_tested() const noexcept { return test != SignificanceTest::none; }
  [[nodiscard]] bool is_suspect() const noexcept {
    return verdict == Verdict::undecided && beyond && ratio.median < 1.0;
  }
  /// Wrong answers that B has more than A; std::nullopt where one of them was not checked.
  [[nodiscard]] std::optional<double> more_wrong_answers() const;
};

/// Geometric mean of the ratios of some cells.
struct MeanRatio {
  std::string axis, value;  ///< "", "rays" and "", "builds": all of them
  Interval ratio;           ///< of the repetitions' noise alone: another choice of cells is another mean
  std::size_t cells = 0, faster = 0, slower = 0, indistinguishable = 0, undecided = 0;
};

/// A structure whose SAH cost or size changed.
struct StructureChange {
  std::string structure;  ///< scene/structure/builder/leaf
  std::optional<double> sah_a, sah_b, bytes_a, bytes_b;
};

struct Comparison {
  CompareOptions options;
  std::vector<ComparedCell> cells;                                ///< in A's order
  std::vector<std::string> only_a, only_b;                        ///< names
  std::vector<std::pair<std::string, std::string>> incomparable;  ///< in both, but not the same work: name and reason
  std::size_t other_settings = 0;                                 ///< of these, those that settings tell apart
  std::vector<MeanRatio> means;
  std::vector<StructureChange> structures;
  /// What left nothing to compare: "--filter 'zzz' leaves none of A's 12 cells nor of B's 12 cells".
  std::string left_nothing = {};
  /// What the speeds of rays and of builds are relative to: the cells of each that `control` finds; none of one kind is
  /// possible.
  std::optional<MeanRatio> control_of_rays, control_of_builds;
  std::optional<MeanRatio> embree;  ///< of its trace cells, where there is no control

  [[nodiscard]] std::size_t count(Verdict verdict) const;
  /// Cells with more wrong answers in B.
  [[nodiscard]] std::size_t more_wrong() const;
  /// Undecided cells that look slower: their whole interval is beyond the smallest difference.
  [[nodiscard]] std::size_t suspects() const;
  [[nodiscard]] bool is_regression() const {
    return count(Verdict::slower) > 0 || more_wrong() > 0 || (options.strict && suspects() > 0);
  }
};

/// Throws UserError for a control that finds no cell of both.
[[nodiscard]] Comparison compare_results(const std::vector<CellResult>& a, const std::vector<CellResult>& b,
                                         const CompareOptions& options);

}  // namespace arboretum
