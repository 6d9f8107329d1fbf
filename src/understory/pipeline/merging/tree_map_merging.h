#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "understory/evaluation/trees/tree_match_chance.h"
#include "understory/evaluation/trees/tree_merge.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory merge`: two tree maps of one place, each a run folder or a trees.csv.
struct MergeRequest {
  std::string a;
  std::string b;
  std::filesystem::path folder;  // of the results
  bool overwrite = false;        // what an earlier run left in the folder
  double weight = 0.5;           // 0: trees stay where A has them, 1: where B has them
  bool align = false;            // lay B, and the reference, on A first by the trees alone
  std::string reference;         // tree list that tells the best weight; empty: none
  TreeMergeConfig merge;
};

// The weight at which the merged trees lie nearest to the reference.
struct BestWeight {
  double weight = 0.0;
  double position_rmse_m = 0.0;
};

// What `understory merge` tells when it is done.
struct MergeOutcome : RunOutcome {
  std::size_t trees_a = 0;
  std::size_t trees_b = 0;
  std::size_t trees = 0;
  std::size_t joined = 0;      // trees of A and B that became one
  double apart_m = 0.0;        // distance of these once moved, root mean square
  double deformation_m = 0.0;  // mean distance before
  std::size_t felled = 0;
  MatchChance chance;
  std::optional<BestWeight> best;
};

// Joins two tree maps and writes trees.csv, felled.csv, deformation.csv, run.json and report.html.
// Untrusted where nothing tells that both maps are of one place. Throws InputError or OutputError,
// and Stopped where the user stops it: the folder is as it was.
[[nodiscard]] MergeOutcome run_merging(const MergeRequest& request, Log& log,
                                       const ProgressSink& progress = {});

}  // namespace understory
