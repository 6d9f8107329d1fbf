#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "understory/evaluation/alignment.h"
#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_matching.h"
#include "understory/sensor/tree.h"
#include "understory/util/progress.h"

namespace understory {

// Reads trees.csv (docs/reference/outputs.md); of its columns only x and y are needed; a time in
// felled_at marks a tree as felled. Those of a run in north, east, down are turned back
// (world_frame.h). Throws InputError with the line where a position is missing, a cell is no
// number, or a diameter is not positive. A diameter that no tree has throws too, where the list
// itself is in metres.
[[nodiscard]] std::vector<Tree> read_trees(const std::filesystem::path& path);

// Finds the motion that lays A on B without a start value. Pairs of trees of A and equally distant
// pairs of B give hypotheses, of which the one with most matches is taken. Least squares over the
// matches follow until they stay the same. `yaw` turns about the vertical and shifts; `se3` uses
// heights and turns fully. Empty if no hypothesis matches three trees. Polls `progress`.
[[nodiscard]] std::optional<Pose> align_trees(const std::vector<Tree>& a,
                                              const std::vector<Tree>& b, Alignment alignment,
                                              double radius_m, const ProgressSink& progress = {});

// The trees' feet and leans after a motion; sizes stay.
[[nodiscard]] std::vector<Tree> moved(const std::vector<Tree>& trees,
                                      const Pose& target_from_source);

// Errors of the trees A against the trees B (the truth). NaN where nothing can be compared. A
// felled tree of B is neither missed nor found: it counts nowhere, nor does the tree of A that
// matches it.
struct TreeErrors {
  std::size_t trees_a = 0;
  std::size_t trees_b = 0;
  std::size_t matched = 0;
  double recall = 0.0;           // completeness: matched of B
  double precision = 0.0;        // correctness: matched of A
  double position_rmse_m = 0.0;  // horizontal
  double dbh_rmse_m = 0.0;       // of pairs in which both have a diameter
  double dbh_bias_m = 0.0;       // mean of A minus B
  double height_rmse_m = 0.0;
  double height_bias_m = 0.0;
  double x_bias_m = 0.0;
  double y_bias_m = 0.0;
  double volume_rmse_m3 = 0.0;  // of the stem
  double volume_bias_m3 = 0.0;
  // Pairs whose stems overlap, seen from above: their distance is at most the sum of both radii (0
  // where a diameter is unknown). The ratio is over B, P4 section 3.4.1.
  std::size_t overlapping = 0;
  double overlapping_tree_ratio = 0.0;
};
// Over `pairs` of A and B, at most one for each tree.
[[nodiscard]] TreeErrors errors_of_pairs(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                         const std::vector<TreePair>& pairs);
// The same for groups of trees, such as classes of diameter: each tree has its group, or -1. A
// pair counts in the group of its tree of B, and so does its tree of A.
[[nodiscard]] std::vector<TreeErrors> errors_by_group(
    const std::vector<Tree>& a, const std::vector<Tree>& b, const std::vector<TreePair>& pairs,
    const std::vector<int>& group_of_a, const std::vector<int>& group_of_b, std::size_t groups);
// Over the pairs that match_trees finds, the nearest first.
[[nodiscard]] TreeErrors compare_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                       double radius_m);

// Trees of one class of diameter. A tree without a diameter is in none.
struct ErrorsOfClass {
  double from_m = 0.0;  // within the class
  double to_m = 0.0;    // not within it
  TreeErrors errors;
};
// Classes that are `width_m` wide and hold a tree, thin ones first. Throws InputError where there
// would be more than a thousand.
[[nodiscard]] std::vector<ErrorsOfClass> errors_by_diameter(const std::vector<Tree>& a,
                                                            const std::vector<Tree>& b,
                                                            const std::vector<TreePair>& pairs,
                                                            double width_m);

// The same for what the scanner could have seen. Felled trees of B are not expected, and a tree of
// A that matches one is not false.
struct VisibleTreeErrors {
  std::size_t expected = 0;     // of B: near the path and with enough returns
  std::size_t found = 0;        // of these, matched
  double recall = 0.0;          // found / expected
  std::size_t reported = 0;     // of A: near the path
  std::size_t false_trees = 0;  // of these, not paired with any tree of B
  double false_share = 0.0;     // false_trees / reported
};
struct Visibility {
  std::map<int, long> returns_by_tree;  // tree id -> lidar returns over the whole run
  long min_returns = 30;
  Trajectory path;  // world frame of B
  double within_m = 15.0;
};
[[nodiscard]] VisibleTreeErrors compare_visible_trees(const std::vector<Tree>& a,
                                                      const std::vector<Tree>& b,
                                                      const std::vector<TreePair>& pairs,
                                                      const Visibility& visibility);

// Agreement of two maps of one place near a path, P1 (10): trees of either that are paired one to
// one, over all trees of both. A pair across the limit counts on the side that is within.
struct MapAgreement {
  std::size_t trees_a = 0;  // within the distance of the path
  std::size_t trees_b = 0;
  std::size_t paired_a = 0;  // of these, with a partner in the other map
  std::size_t paired_b = 0;
  double agreement = 0.0;  // (paired_a + paired_b) / (trees_a + trees_b); NaN if both are empty
};
[[nodiscard]] MapAgreement compare_maps(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                        const std::vector<TreePair>& pairs, const Trajectory& path,
                                        double within_m);

// Sums the column `returns` per `tree_id` of a truth folder's returns.csv.gz. Throws InputError.
[[nodiscard]] std::map<int, long> read_returns(const std::filesystem::path& path);

}  // namespace understory
