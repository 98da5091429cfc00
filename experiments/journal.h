// Journal: what a run has measured so far, on disk. cells.jsonl holds the cells that are done,
// repetitions.jsonl every repetition as it ended; --resume reads both.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "experiments/append_file.h"
#include "experiments/plan.h"
#include "experiments/result.h"

namespace arboretum {

/// Throws UserError where `folder` holds results of the configuration of hash `there`, and `here` is another.
void refuse_other_configuration(const std::filesystem::path& folder, const std::string& there, const std::string& here);

class Journal {
 public:
  /// Opens the files in `folder`. With `resume`, takes up what they hold of `plan`, cells of `elsewhere` too; without,
  /// starts them anew. Throws UserError when the folder holds another configuration's results, or cannot be written.
  Journal(std::filesystem::path folder, std::string configuration_hash, const Plan& plan, bool resume);

  /// Results of the cells that are done, by name.
  [[nodiscard]] const std::map<std::string, CellResult>& done() const noexcept { return done_; }
  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }
  /// Repetitions of a cell that is not done, by index.
  [[nodiscard]] std::vector<Repetition> started(const std::string& name) const;

  void add(const std::string& name, const Repetition& repetition);
  /// Appends the cell to cells.jsonl.
  void finish(const CellResult& result);

 private:
  std::filesystem::path folder_;
  std::string hash_;
  std::map<std::string, CellResult> done_;
  std::map<std::string, std::map<unsigned, Repetition>> started_;
  AppendFile cells_, repetitions_;
};

}  // namespace arboretum
