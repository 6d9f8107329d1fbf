#include "understory/graph/loops/stem_loops.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace understory {
namespace {

constexpr double kStep = 1e-4;  // m^2 and rad^2: variance of a step

// A walk through a stand along a road and back on it: the views of the way back face the other way.
struct WalkAndBack {
  std::vector<SparsePoints> views;
  std::vector<Pose> truth;
};

// `missed`: share of the stems in reach that a view does not see, another one each time.
// `half_angle`: rad to each side of the way that a view sees.
WalkAndBack walk_there_and_back(int views_each_way, double missed = 0.2, double half_angle = M_PI) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> along(-30.0, 2.0 * views_each_way + 30.0);
  std::uniform_real_distribution<double> across(-30.0, 30.0);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.04);
  SparsePoints stand;
  const double area = 60.0 * (2.0 * views_each_way + 60.0);
  for (int i = 0; i < static_cast<int>(area * 0.05); ++i) {
    const double x = along(random);
    const double y = across(random);
    stand.emplace_back(x, y, std::sin(0.1 * x) + 0.05 * y);
  }
  WalkAndBack walk;
  for (int i = 0; i < 2 * views_each_way; ++i) {
    const bool back = i >= views_each_way;
    const double x = 2.0 * (back ? 2 * views_each_way - 1 - i : i);
    const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(back ? 3.0 : 0.1 * std::sin(i),
                                                         Eigen::Vector3d::UnitZ())),
                    {x, back ? 0.7 : 0.0, std::sin(0.1 * x)});
    SparsePoints view;
    for (const auto& tree : stand) {
      if ((tree - pose.translation()).head<2>().norm() > 25.0 || unit(random) < missed) continue;
      const Eigen::Vector3d seen =
          pose.inverse() * (tree + Eigen::Vector3d(noise(random), noise(random), noise(random)));
      if (std::abs(std::atan2(seen.y(), seen.x())) <= half_angle) view.push_back(seen);
    }
    walk.views.push_back(view);
    walk.truth.push_back(pose);
  }
  return walk;
}

// How many views of the walk found a view at their place, and how many of these loops are verified.
// Of those the motion must be right, too.
struct Found {
  int right = 0;
  int verified = 0;
};
// `turn`: what the odometry gets wrong at each step.
Found loops_of_the_way_back(const WalkAndBack& walk, StemLoopConfig config, double turn = 0.0) {
  config.exclude_recent = 20;
  std::vector<Pose> odometry = walk.truth;
  const Pose wrong(Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())),
                   Eigen::Vector3d::Zero());
  for (std::size_t i = 1; i < odometry.size(); ++i)
    odometry[i] = odometry[i - 1] * walk.truth[i - 1].inverse() * walk.truth[i] * wrong;
  // Poses that know nothing of the return: the way back is said to lie far away.
  for (std::size_t i = 60; i < odometry.size(); ++i)
    odometry[i] = Pose(Eigen::Quaterniond::Identity(), {0.0, 500.0, 0.0}) * odometry[i];
  const std::vector<Matrix6d> covariances(odometry.size(), kStep * Matrix6d::Identity());
  Found found;
  for (const StemLoop& loop : find_stem_loops({walk.views, odometry, covariances}, config)) {
    const auto query = static_cast<std::size_t>(loop.query);
    const auto match = static_cast<std::size_t>(loop.match);
    EXPECT_LE(loop.match, loop.query - config.exclude_recent);
    const Pose truth = walk.truth[match].inverse() * walk.truth[query];
    const Pose error = truth.inverse() * loop.match_from_query;
    const bool right = truth.translation().norm() < 3.1 && error.translation().norm() < 0.3;
    found.right += right ? 1 : 0;
    if (!loop.verified) continue;
    EXPECT_LT(error.translation().norm(), 0.1) << loop.query;
    EXPECT_LT(error.angle(), 0.02) << loop.query;
    EXPECT_LT(truth.translation().norm(), 3.1);
    ++found.verified;
  }
  return found;
}

TEST(StemLoops, FindsTheWayBackWithoutAGuess) {
  // Of the 60 views on the way back those from 70 on have a place at least 20 views before.
  EXPECT_GE(loops_of_the_way_back(walk_there_and_back(60), {}).verified, 48);
}

// Other ones each time: neighbouring views laid together show what one of them misses.
TEST(StemLoops, FindsTheWayBackWhereMostStemsAreMissed) {
  const WalkAndBack walk = walk_there_and_back(60, 0.65);
  EXPECT_GE(loops_of_the_way_back(walk, {}).right, 48);
  StemLoopConfig single;
  single.gather_l0 = 0.0;
  EXPECT_LE(loops_of_the_way_back(walk, single).right, 24);
}

// Views of 180 degrees that face opposite ways have next to nothing in common: what is laid
// together tells how they lie to each other.
TEST(StemLoops, FindsTheWayBackWhereViewsFaceOppositeWays) {
  const WalkAndBack walk = walk_there_and_back(60, 0.2, 0.5 * M_PI);
  EXPECT_GE(loops_of_the_way_back(walk, {}).verified, 40);
  StemLoopConfig alone;
  alone.min_gathered_overlap = 1.0;
  EXPECT_LE(loops_of_the_way_back(walk, alone).verified, 5);
}

// Adds points that are no stems, other ones in each view.
void clutter(WalkAndBack& walk) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (SparsePoints& view : walk.views) {
    const std::size_t stems = view.size();
    for (std::size_t i = 0; i < stems; ++i) {
      const double range = 25.0 * std::sqrt(unit(random));
      const double angle = 2.0 * M_PI * unit(random);
      view.emplace_back(range * std::cos(angle), range * std::sin(angle), 0.0);
    }
  }
}

// Over many views such points lie near each other by chance: two sights make no stem.
TEST(StemLoops, FindsTheWayBackAmongMuchThatIsNoStem) {
  WalkAndBack walk = walk_there_and_back(60);
  clutter(walk);
  EXPECT_GE(loops_of_the_way_back(walk, {}).verified, 40);
}

// Where the odometry errs, the motion within what was laid together is as wrong: the covariance
// grows with it.
TEST(StemLoops, WhatIsLaidTogetherCarriesTheErrorsOfTheSteps) {
  const WalkAndBack walk = walk_there_and_back(60, 0.2, 0.5 * M_PI);
  StemLoopConfig config;
  config.exclude_recent = 20;
  const auto shift_sd = [&](double step_variance) {
    const std::vector<Matrix6d> steps(walk.views.size(), step_variance * Matrix6d::Identity());
    double largest = 0.0;
    for (const StemLoop& loop : find_stem_loops({walk.views, walk.truth, steps}, config)) {
      if (loop.verified) largest = std::max(largest, std::sqrt(loop.covariance(3, 3)));
    }
    return largest;
  };
  // Thirteen steps to each side of both views, a quarter of each.
  EXPECT_NEAR(std::pow(shift_sd(0.01), 2) - std::pow(shift_sd(0.0), 2), 0.13, 0.04);
}

// An odometry that turns too far lays neighbours askew: loops must not learn of it.
TEST(StemLoops, MotionsAreThoseOfTheViewsThemselves) {
  EXPECT_GE(loops_of_the_way_back(walk_there_and_back(60), {}, 0.01).verified, 40);
}

TEST(StemLoops, NothingIsFoundWhereNothingReturns) {
  WalkAndBack walk = walk_there_and_back(60);
  walk.views.resize(60);
  walk.truth.resize(60);
  StemLoopConfig config;
  config.exclude_recent = 25;  // 50 m, views reach 25 m
  const std::vector<Matrix6d> covariances(walk.views.size(), kStep * Matrix6d::Identity());
  for (const StemLoop& loop : find_stem_loops({walk.views, walk.truth, covariances}, config))
    EXPECT_FALSE(loop.verified) << loop.query << " " << loop.match << " " << loop.score;
}

}  // namespace
}  // namespace understory
