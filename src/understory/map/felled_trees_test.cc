#include "understory/map/felled_trees.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

struct WalkPastTrees {
  std::vector<StemView> views;
  std::vector<Pose> poses;
  std::vector<MappedStem> trees;
};

// 60 views all around along 12 m; `sees(view, tree)` says what each sees.
template <typename Sees>
WalkPastTrees walk_past(const std::vector<Eigen::Vector3d>& trees, const Sees& sees) {
  WalkPastTrees result;
  for (const Eigen::Vector3d& place : trees) {
    result.trees.emplace_back();
    result.trees.back().point_in_world = place;
  }
  for (int i = 0; i < 60; ++i) {
    const Pose pose(Eigen::Quaterniond::Identity(), {0.2 * i, 0.0, 0.0});
    StemView view;
    for (std::size_t t = 0; t < trees.size(); ++t) {
      if (!sees(i, t)) continue;
      Stem stem;
      stem.point = (pose.inverse() * trees[t]).cast<float>();
      view.stems.push_back(stem);
    }
    result.views.push_back(view);
    result.poses.push_back(pose);
  }
  return result;
}

std::vector<Eigen::Vector3d> stand() {
  std::vector<Eigen::Vector3d> trees;
  for (int k = 0; k < 40; ++k)
    trees.emplace_back(-12.0 + 4.1 * (k % 10), -13.0 + 8.7 * (k / 10), 0.0);
  return trees;
}

TEST(FelledTrees, TellsWhichTreeFellAndWhen) {
  const auto trees = stand();
  // Tree 14 is cut at view 33; each is missed now and then, tree 25 more often than seen.
  const WalkPastTrees seen = walk_past(trees, [](int i, std::size_t t) {
    if (t == 14) return i < 33 && i % 5 != 2;
    if (t == 25) return i % 4 == 0 && i < 44;
    return (i + static_cast<int>(t)) % 6 != 0;
  });
  const auto felled = felled_trees(seen.views, seen.poses, seen.trees, {});
  ASSERT_EQ(felled.size(), 1U);
  EXPECT_EQ(felled[0].tree, 14U);
  EXPECT_EQ(felled[0].last_seen, 31);
  EXPECT_GE(felled[0].first_missed, 32);
  EXPECT_LE(felled[0].first_missed, 36);
  EXPECT_GT(felled[0].missed, 10);
}

TEST(FelledTrees, WhatIsHiddenOrOutOfReachIsNotFelled) {
  auto trees = stand();
  // A new stem, the one that the machine holds, comes before tree 14 and goes along with it.
  const Eigen::Vector3d hidden = trees[14];
  WalkPastTrees seen = walk_past(trees, [](int i, std::size_t t) { return t != 14 || i < 30; });
  EXPECT_EQ(felled_trees(seen.views, seen.poses, seen.trees, {}).size(), 1U);
  for (std::size_t i = 30; i < 60; ++i) {
    Stem held;
    held.point = (0.5 * (seen.poses[i].inverse() * hidden)).cast<float>();
    seen.views[i].stems.push_back(held);
  }
  EXPECT_TRUE(felled_trees(seen.views, seen.poses, seen.trees, {}).empty());
  FelledConfig near;
  near.reach_m = 2.0;
  const WalkPastTrees far =
      walk_past(trees, [](int i, std::size_t t) { return t != 14 || i < 30; });
  EXPECT_TRUE(felled_trees(far.views, far.poses, far.trees, near).empty());
  EXPECT_TRUE(felled_trees({}, {}, {}, {}).empty());
}

// A scanner of 210 degrees drives among trees. Those that it has passed are behind it, and stand.
// Its mounting is not known: the body is the lidar, which looks backwards, aside, or lies. Trees
// behind such a body were told to be felled once.
TEST(FelledTrees, TreesBehindAScannerThatIsMountedAnyhowStand) {
  const auto trees = stand();
  for (const auto& [roll, yaw] :
       {std::pair(0.0, 0.0), {0.0, M_PI}, {0.0, -1.6}, {1.6, 0.0}, {M_PI, 0.5}, {0.6, M_PI}}) {
    const Pose view_from_body(
        Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
            Eigen::Quaterniond(Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX())),
        {0.0, 0.0, 0.0});
    const auto in_front = [&](int i, std::size_t t) {
      const Eigen::Vector3d ahead = trees[t] - Eigen::Vector3d(0.2 * i, 0.0, 0.0);
      return std::abs(std::atan2(ahead.y(), ahead.x())) < 105.0 * M_PI / 180.0;
    };
    WalkPastTrees seen = walk_past(
        trees, [&](int i, std::size_t t) { return in_front(i, t) && (t != 15 || i < 20); });
    for (std::size_t i = 0; i < seen.views.size(); ++i) {
      seen.poses[i] = seen.poses[i] * view_from_body;
      for (Stem& stem : seen.views[i].stems)
        stem.point = (view_from_body.inverse() * stem.point.cast<double>()).cast<float>();
    }
    const auto felled = felled_trees(seen.views, seen.poses, seen.trees, {});
    ASSERT_EQ(felled.size(), 1U) << roll << " " << yaw;
    EXPECT_EQ(felled[0].tree, 15U);
  }
}

// Undergrowth hides tree 14 from behind. It stands, and where nobody fells nothing says otherwise;
// once it is not seen from where it was seen before, it is gone.
TEST(FelledTrees, WhereNobodyFellsOnlyPlacesThatShowedTheTreeTell) {
  const auto trees = stand();
  const FelledConfig unattended = FelledConfig::unattended();
  const auto before = [](int i, std::size_t t) { return t != 14 || i < 30; };
  WalkPastTrees once = walk_past(trees, before);
  EXPECT_EQ(felled_trees(once.views, once.poses, once.trees, {}).size(), 1U);
  // Beyond 3 m from the last place that showed it: 12 m are walked in 60 views.
  for (std::size_t i = 30; i < 60; ++i)
    once.poses[i] = Pose(Eigen::Quaterniond::Identity(), {9.5 + 0.02 * i, 0.0, 0.0});
  for (std::size_t i = 30; i < 60; ++i) {
    once.views[i].stems.clear();
    for (std::size_t t = 0; t < trees.size(); ++t) {
      if (t == 14) continue;
      once.views[i].stems.emplace_back();
      once.views[i].stems.back().point = (once.poses[i].inverse() * trees[t]).cast<float>();
    }
  }
  EXPECT_EQ(felled_trees(once.views, once.poses, once.trees, {}).size(), 1U);
  EXPECT_TRUE(felled_trees(once.views, once.poses, once.trees, unattended).empty());
  WalkPastTrees again = once;
  const WalkPastTrees first = walk_past(trees, [](int, std::size_t t) { return t != 14; });
  again.views.insert(again.views.end(), first.views.begin(), first.views.end());
  again.poses.insert(again.poses.end(), first.poses.begin(), first.poses.end());
  const auto gone = felled_trees(again.views, again.poses, again.trees, unattended);
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_EQ(gone[0].tree, 14U);
  EXPECT_EQ(gone[0].last_seen, 29);
  EXPECT_EQ(gone[0].first_missed, 60);
}

}  // namespace
}  // namespace understory
