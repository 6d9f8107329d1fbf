#include "understory/evaluation/trees/tree_changes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/evaluation/trees/tree_match_chance.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// A plot of 60 m by 60 m with 250 trees of 10 to 40 cm, at least 1.5 m apart.
std::vector<Tree> plot(std::uint64_t seed) {
  Random random(seed);
  std::vector<Tree> trees;
  while (trees.size() < 250) {
    Tree tree;
    tree.x = random.uniform(0.0, 60.0);
    tree.y = random.uniform(0.0, 60.0);
    tree.dbh_m = random.uniform(0.10, 0.40);
    tree.dbh_sd_m = 0.004;
    tree.height_m = 15.0 + 20.0 * tree.dbh_m;
    tree.stem_volume_m3 = 5.0 * tree.dbh_m * tree.dbh_m;
    tree.stem_volume_sd_m3 = 0.05;
    bool free = true;
    for (const Tree& other : trees)
      free = free && std::hypot(other.x - tree.x, other.y - tree.y) > 1.5;
    if (free) trees.push_back(tree);
    trees.back().id = static_cast<int>(trees.size());
  }
  return trees;
}

// One measurement of it: errors of 3 cm in place and of the standard deviations that it states.
std::vector<Tree> measured(std::vector<Tree> trees, std::uint64_t seed) {
  Random random(seed);
  for (Tree& tree : trees) {
    tree.x += random.normal(0.0, 0.03);
    tree.y += random.normal(0.0, 0.03);
    tree.dbh_m += random.normal(0.0, tree.dbh_sd_m);
    tree.height_m += random.normal(0.0, 0.3);
    tree.stem_volume_m3 += random.normal(0.0, tree.stem_volume_sd_m3);
  }
  return trees;
}

TreeChanges changes_of(const std::vector<Tree>& before, const std::vector<Tree>& after) {
  return tree_changes(before, after, assign_trees(before, after, {}), EpochArea::from_trees(before),
                      EpochArea::from_trees(after));
}

TEST(TreeChanges, GoneNewAndGrownAreWhatHappened) {
  const std::vector<Tree> truth = plot(1);
  std::vector<Tree> later;
  std::vector<int> gone;
  for (const Tree& tree : truth) {
    const bool inside = tree.x > 10.0 && tree.x < 50.0 && tree.y > 10.0 && tree.y < 50.0;
    if (inside && tree.id % 10 == 0) {
      gone.push_back(tree.id);
      continue;
    }
    later.push_back(tree);
    later.back().dbh_m += tree.id % 2 == 0 ? 0.03 : 0.0;
    later.back().height_m += 2.0;
  }
  Tree sapling = truth[0];
  sapling.id = 1000;
  sapling.x = sapling.y = 30.0;
  sapling.dbh_m = 0.08;
  later.push_back(sapling);
  const std::vector<Tree> before = measured(truth, 2);
  const std::vector<Tree> after = measured(later, 3);
  const TreeChanges changes = changes_of(before, after);
  EXPECT_EQ(changes.count(TreeFate::kGone), gone.size());
  EXPECT_EQ(changes.count(TreeFate::kNew), 1U);
  EXPECT_EQ(changes.count(TreeFate::kMissedBefore), 0U);
  EXPECT_EQ(changes.count(TreeFate::kStays), truth.size() - gone.size());
  int grown = 0;
  int false_grown = 0;
  for (const TreeChange& change : changes.trees) {
    if (change.fate == TreeFate::kGone) {
      EXPECT_EQ(before[*change.in_old].id % 10, 0);
    }
    if (change.fate != TreeFate::kStays) continue;
    EXPECT_NEAR(change.dbh_m.sd, std::hypot(0.004, 0.004), 1e-12);
    const bool grew = before[*change.in_old].id % 2 == 0;
    grown += grew && change.dbh_m.significant ? 1 : 0;
    false_grown += !grew && change.dbh_m.significant ? 1 : 0;
  }
  // 3 cm are 5.3 standard deviations; of those that did not grow one in twenty seems to.
  EXPECT_GT(grown, 100);
  EXPECT_LT(false_grown, 15);
  EXPECT_NEAR(changes.height.mean, 2.0, 4.0 * changes.height.mean_sd);
  // No list tells the error of heights: the spread, 0.3 m of each list, stands in.
  EXPECT_NEAR(changes.height.stand_in_sd, 0.3 * std::sqrt(2.0), 0.08);
  EXPECT_TRUE(std::isnan(changes.dbh.stand_in_sd));
  EXPECT_NEAR(changes.volume.mean, 0.0, 4.0 * changes.volume.mean_sd);
  EXPECT_LT(changes.volume.grown + changes.volume.shrunk, changes.volume.known / 8);
}

TEST(TreeChanges, CopiedFiguresTellNoSpreadAndNothingIsSignificant) {
  const std::vector<Tree> before = plot(16);
  std::vector<Tree> after = before;
  after[0].height_m += 1.0;
  const TreeChanges changes = changes_of(before, after);
  EXPECT_TRUE(std::isnan(changes.height.stand_in_sd));
  EXPECT_EQ(changes.height.grown, 0U);
}

TEST(TreeChanges, HeightsHaveTheirOwnDeviationAndLowerBoundsTellNoGrowth) {
  std::vector<Tree> before = plot(16);
  for (Tree& tree : before)
    tree.height_sd_m = 0.6;
  std::vector<Tree> after = before;
  after[0].height_m += 1.5;
  after[1].height_m += 2.0;
  after[2].height_m += 9.0;
  after[3].height_m += 9.0;
  after[2].height_is_lower_bound = 1.0;
  before[3].height_is_lower_bound = 1.0;
  const TreeChanges changes = changes_of(before, after);
  EXPECT_TRUE(std::isnan(changes.height.stand_in_sd));  // none was needed
  EXPECT_EQ(changes.height.known, before.size() - 2);
  EXPECT_EQ(changes.height.grown, 1U);
  for (const TreeChange& change : changes.trees) {
    if (change.in_old == 1U) {
      EXPECT_NEAR(change.height_m.sd, 0.6 * std::sqrt(2.0), 1e-12);
      EXPECT_TRUE(change.height_m.significant);  // 2.0 m over 1.96 times 0.85 m
    }
    if (change.in_old == 2U || change.in_old == 3U) {
      EXPECT_TRUE(std::isnan(change.height_m.value));
      EXPECT_TRUE(std::isnan(change.volume_m3.value));
    }
  }
}

TEST(TreeChanges, WhatTheOtherDidNotSeeIsNeitherGoneNorNew) {
  const std::vector<Tree> truth = plot(4);
  std::vector<Tree> west;
  std::vector<Tree> east;
  for (const Tree& tree : truth) {
    if (tree.x < 40.0) west.push_back(tree);
    if (tree.x > 20.0) east.push_back(tree);
  }
  const TreeChanges changes = changes_of(measured(west, 5), measured(east, 6));
  EXPECT_EQ(changes.count(TreeFate::kGone), 0U);
  EXPECT_EQ(changes.count(TreeFate::kNew) + changes.count(TreeFate::kMissedBefore), 0U);
  EXPECT_GT(changes.count(TreeFate::kOutsideNew), 50U);
  EXPECT_GT(changes.count(TreeFate::kOutsideOld), 50U);
}

TEST(TreeChanges, ThickTreesThatWereMissedAreNotNewAndTellHowManyAreMissed) {
  const std::vector<Tree> truth = plot(7);
  Random random(8);
  std::vector<Tree> before;
  std::vector<Tree> after;
  for (const Tree& tree : truth) {
    if (!random.chance(0.1)) before.push_back(tree);
    if (!random.chance(0.1)) after.push_back(tree);
  }
  const TreeChanges changes = changes_of(measured(before, 9), measured(after, 10));
  // Nothing happened. Nine in ten of the trees that OLD missed are too thick to be new.
  EXPECT_GT(changes.count(TreeFate::kMissedBefore), 4 * changes.count(TreeFate::kNew));
  EXPECT_NEAR(changes.missed_share, 0.1, 0.05);
  const auto gone = static_cast<double>(changes.count(TreeFate::kGone));
  EXPECT_GT(gone, 10.0);
  EXPECT_NEAR(changes.expected_missed, gone, 3.0 * changes.expected_missed_sd);
}

TEST(TreeChanges, AreasSeenByHullAndByPath) {
  const std::vector<Tree> trees = plot(11);
  const EpochArea hull = EpochArea::from_trees(trees);
  EXPECT_TRUE(hull.holds(30.0, 30.0));
  EXPECT_FALSE(hull.holds(30.0, 61.0));
  EXPECT_FALSE(hull.holds(-1.0, 30.0));
  EXPECT_FALSE(EpochArea::from_trees({}).holds(0.0, 0.0));
  // A path along the southern border, trees only within 8 m of it: the bend of an L is not seen.
  Trajectory path;
  for (int k = 0; k <= 60; ++k)
    path.push_back({k, Pose(Eigen::Quaterniond::Identity(), {double(k), 0.0, 0.0})});
  for (int k = 0; k <= 60; ++k)
    path.push_back({k + 61, Pose(Eigen::Quaterniond::Identity(), {60.0, double(k), 0.0})});
  std::vector<Tree> near;
  for (const Tree& tree : trees)
    if (tree.y < 8.0 || tree.x > 52.0) near.push_back(tree);
  const EpochArea along = EpochArea::from_path(near, path);
  EXPECT_TRUE(along.holds(30.0, 5.0));
  EXPECT_TRUE(along.holds(55.0, 55.0));
  EXPECT_FALSE(along.holds(30.0, 12.0));
  EXPECT_TRUE(EpochArea::from_trees(near).holds(40.0, 15.0)) << "a hull covers the bay";
  EXPECT_FALSE(along.holds(40.0, 15.0));
}

TEST(TreeChanges, AnotherStandIsNoMoreThanChance) {
  const std::vector<Tree> one = plot(12);
  const std::vector<Tree> other = plot(13);
  const auto judged = [](const std::vector<Tree>& a, const std::vector<Tree>& b) {
    return match_chance(a, b, assign_trees(a, b, {}), 0.5, false);
  };
  EXPECT_FALSE(judged(one, other).beyond_chance);
  EXPECT_FALSE(judged(one, {}).beyond_chance);
  // Of the same stand two trees in three were felled.
  std::vector<Tree> thinned;
  for (const Tree& tree : measured(one, 14))
    if (tree.id % 3 == 0) thinned.push_back(tree);
  EXPECT_TRUE(judged(measured(one, 15), thinned).beyond_chance);
}

}  // namespace
}  // namespace understory
