#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/plane_cells.h"
#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_matching.h"
#include "understory/sensor/tree.h"

namespace understory {

// The part of the plane where a scan can have found trees. Immutable, thread-safe.
class EpochArea {
 public:
  // The convex hull of the trees. It covers gaps and bays that the scan may not have seen.
  static EpochArea from_trees(const std::vector<Tree>& trees);
  // Places within reach of the path (not empty): the distance within which nine tenths of the trees
  // stand.
  static EpochArea from_path(const std::vector<Tree>& trees, const Trajectory& path);

  [[nodiscard]] bool holds(double x, double y) const;
  // What it rests on, in words.
  [[nodiscard]] const std::string& meaning() const { return meaning_; }

 private:
  std::vector<Eigen::Vector2d> hull_;  // counterclockwise; empty with a path
  std::vector<Eigen::Vector2d> path_;
  std::optional<PlaneCells> cells_;  // of the path
  double reach_m_ = 0.0;
  std::string meaning_;
};

// What became of a tree between two epochs.
enum class TreeFate {
  kStays,         // in both lists
  kGone,          // only in OLD, where NEW saw
  kNew,           // only in NEW, where OLD saw, and thin enough to have grown in
  kMissedBefore,  // only in NEW, where OLD saw, but too thick to be new: OLD missed it
  kOutsideNew,    // only in OLD, where NEW did not see: nothing is known
  kOutsideOld,    // only in NEW, where OLD did not see
};
// The word of a fate in tables: stays, gone, new, missed_before, outside_new, outside_old.
[[nodiscard]] std::string to_string(TreeFate fate);

// NEW less OLD of one figure of a tree. NaN where unknown, as heights and volumes are where one of
// the heights is a lower bound.
struct Increment {
  double value = Tree::kUnknown;
  double sd = Tree::kUnknown;  // of both measurements together
  bool significant = false;    // beyond 1.96 standard deviations, 95 %
};

// One tree of either list.
struct TreeChange {
  TreeFate fate = TreeFate::kStays;
  std::optional<std::size_t> in_old;  // indices
  std::optional<std::size_t> in_new;
  Increment dbh_m;
  Increment height_m;
  Increment volume_m3;
};

// All increments of one figure over the trees that stay.
struct IncrementSummary {
  std::size_t known = 0;
  double mean = Tree::kUnknown;
  double mean_sd = Tree::kUnknown;  // of the mean, from the spread of the increments
  std::size_t grown = 0;            // significantly larger
  std::size_t shrunk = 0;           // significantly smaller
  // Standard deviation that stands in where the lists tell none: the spread of all increments, so
  // it includes differences in growth. NaN where none was needed, or too few are known.
  double stand_in_sd = Tree::kUnknown;
};

// Two epochs of one stand.
struct TreeChanges {
  std::vector<TreeChange> trees;        // of OLD in its order, then those of NEW alone
  std::array<std::size_t, 6> counts{};  // by TreeFate
  IncrementSummary dbh;
  IncrementSummary height;
  IncrementSummary volume;
  // Thicker than this a tree cannot have grown in since OLD; NaN: too few diameters tell it.
  double ingrowth_limit_m = Tree::kUnknown;
  // Share of the trees above that limit that OLD missed. From it follows the number of trees that
  // NEW missed among the gone, with its standard deviation: both scans are taken to miss alike.
  double missed_share = Tree::kUnknown;
  double expected_missed = Tree::kUnknown;
  double expected_missed_sd = Tree::kUnknown;

  // Whether so many thick trees are in NEW alone that the lists do not fit together.
  [[nodiscard]] bool misfit() const;
  [[nodiscard]] std::size_t count(TreeFate fate) const {
    return counts[static_cast<std::size_t>(fate)];
  }
};

// Both lists in one frame, `pairs` of OLD and NEW at most one for each tree.
[[nodiscard]] TreeChanges tree_changes(const std::vector<Tree>& old_trees,
                                       const std::vector<Tree>& new_trees,
                                       const std::vector<TreePair>& pairs,
                                       const EpochArea& old_area, const EpochArea& new_area);

}  // namespace understory
