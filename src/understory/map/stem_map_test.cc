#include "understory/map/stem_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

// Views of known trees from known poses, with noise: each tree once, at its place.
TEST(StemMap, GathersEachTreeOnce) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::vector<Eigen::Vector3d> trees;
  for (int x = 0; x < 10; ++x) {
    for (int y = 0; y < 6; ++y)
      trees.emplace_back(3.0 * x, 3.3 * y, 0.1 * x);
  }
  std::vector<StemView> views;
  std::vector<Pose> poses;
  for (int i = 0; i < 20; ++i) {
    Vector6d xi;
    xi << 0.05 * std::sin(i), 0.04, 0.3 * i, 1.4 * i, 2.0, 1.0;
    const Pose pose(so3_exp(xi.head<3>()), xi.tail<3>());
    StemView view;
    view.frame = i;
    for (const auto& tree : trees) {
      Stem stem;
      const Eigen::Vector3d seen = tree + Eigen::Vector3d(noise(random), noise(random), 0.0);
      stem.point = (pose.inverse() * seen).cast<float>();
      stem.axis = (pose.rotation().conjugate() * Eigen::Vector3d::UnitZ()).cast<float>();
      if (i % 2 == 0) stem.dbh_m = 0.3F;
      view.stems.push_back(stem);
    }
    Stem once;  // seen by one view only: no tree
    once.point = Eigen::Vector3f(0.0F, 50.0F + static_cast<float>(3 * i), 0.0F);
    view.stems.push_back(once);
    views.push_back(view);
    poses.push_back(pose);
  }
  const auto map = build_stem_map(views, poses, {});
  ASSERT_EQ(map.size(), trees.size());
  for (std::size_t i = 0; i < map.size(); ++i) {
    EXPECT_LT((map[i].point_in_world - trees[i]).norm(), 0.06);
    EXPECT_EQ(map[i].sights, 20);
    EXPECT_EQ(map[i].dbh_sights, 10);
    EXPECT_NEAR(map[i].dbh_m, 0.3, 1e-6);
    EXPECT_NEAR(std::sqrt(map[i].variance_m2.x()), 0.05, 0.03);
    EXPECT_GT(map[i].axis_in_world.z(), 0.9999);
    EXPECT_EQ(map[i].first_view, 0);
    EXPECT_EQ(map[i].last_view, 19);
  }
  // The same by alpha shapes, P1 section 2.3; a radius that reaches from tree to tree joins them.
  StemMapConfig shapes;
  shapes.alpha_radius_m = 0.5;
  const auto by_shape = build_stem_map(views, poses, shapes);
  ASSERT_EQ(by_shape.size(), trees.size());
  for (std::size_t i = 0; i < map.size(); ++i) {
    EXPECT_LT((by_shape[i].point_in_world - map[i].point_in_world).norm(), 1e-9);
    EXPECT_EQ(by_shape[i].sights, map[i].sights);
  }
  shapes.alpha_radius_m = 5.0;
  EXPECT_EQ(build_stem_map(views, poses, shapes).size(), 1U);
}

// P1's vertical angular noise: sights lean to and fro about their tree by a known angle.
TEST(StemMap, TellsTheNoiseOfTheAxes) {
  std::vector<StemView> views;
  constexpr double kLean = 0.04;
  for (int i = 0; i < 200; ++i) {
    Stem stem;
    stem.point = Eigen::Vector3f(3.0F, 1.0F, 0.0F);
    const double off = 0.03 + (i % 2 == 0 ? kLean : -kLean);
    stem.axis = Eigen::Vector3d(std::sin(off), 0.0, std::cos(off)).cast<float>();
    StemView view;
    view.frame = i;
    view.stems = {stem};
    views.push_back(view);
  }
  const auto map = build_stem_map(views, std::vector<Pose>(views.size()), {});
  ASSERT_EQ(map.size(), 1U);
  EXPECT_EQ(map[0].axis_sights, 200);
  EXPECT_NEAR(map[0].axis_noise_rad, kLean, 0.001);
  EXPECT_NEAR(map[0].axis_in_world.x(), std::sin(0.03), 0.001);
}

struct Ring {
  std::vector<StemView> views;
  std::vector<Pose> poses;
};

// Views all around from places along a line; what `sees` says is seen.
template <typename Sees>
Ring ring(const std::vector<Eigen::Vector3d>& trees, const Sees& sees) {
  Ring result;
  for (int i = 0; i < 60; ++i) {
    const Pose pose(Eigen::Quaterniond::Identity(), {0.2 * i, 0.0, 0.0});
    StemView view;
    for (std::size_t t = 0; t < trees.size(); ++t) {
      if (!sees(i, t)) continue;
      Stem stem;
      stem.point = (pose.inverse() * trees[t]).cast<float>();
      stem.dbh_m = t == 0 ? 0.2F : 0.3F;
      view.stems.push_back(stem);
    }
    result.views.push_back(view);
    result.poses.push_back(pose);
  }
  return result;
}

std::vector<Eigen::Vector3d> some_trees() {
  std::vector<Eigen::Vector3d> trees = {{5.0, 5.0, 0.0}, {5.0, 5.9, 0.0}};
  for (int k = 0; k < 40; ++k)
    trees.emplace_back(-10.0 + 4.0 * (k % 10), -12.0 + 6.0 * (k / 10), 0.0);
  return trees;
}

TEST(StemMap, ImagesOfOneTreeThatWereNeverSeenTogetherAreOne) {
  const auto trees = some_trees();
  const Ring bent = ring(trees, [](int i, std::size_t t) {
    return t > 1 || (i < 30) == (t == 0);  // the path bends in the middle
  });
  const auto plain = build_stem_map(bent.views, bent.poses, {});
  EXPECT_EQ(plain.size(), trees.size());
  const auto joined = build_stem_map(bent.views, bent.poses, tree_list_config());
  ASSERT_EQ(joined.size(), trees.size() - 1);
  EXPECT_NEAR(joined[0].point_in_world.y(), 5.45, 1e-4);
  EXPECT_EQ(joined[0].sights, 60);
  EXPECT_NEAR(joined[0].dbh_m, 0.25, 1e-6);
  EXPECT_NEAR(joined[0].variance_m2.y(), 0.45 * 0.45 * 60.0 / 59.0, 1e-4);
  EXPECT_EQ(joined[0].last_view, 59);
}

TEST(StemMap, TreesSideBySideStayTwo) {
  const auto trees = some_trees();
  const Ring seen = ring(trees, [](int i, std::size_t t) { return t > 1 || i % 2 == 0 || t == 0; });
  EXPECT_EQ(build_stem_map(seen.views, seen.poses, tree_list_config()).size(), trees.size());
}

TEST(StemMap, WhatIsSeenNowAndThenIsNoTree) {
  const auto trees = some_trees();
  const Ring seen = ring(trees, [](int i, std::size_t t) { return t != 1 || i % 15 == 0; });
  EXPECT_EQ(build_stem_map(seen.views, seen.poses, {}).size(), trees.size());
  const auto list = build_stem_map(seen.views, seen.poses, tree_list_config());
  ASSERT_EQ(list.size(), trees.size() - 1);
  EXPECT_NEAR(list[0].presence, 1.0, 1e-9);
}

// A view of stems whose diameters are given, each at its place and from the origin.
StemView view_of_diameters(int frame, const std::vector<double>& dbh_m) {
  StemView view;
  view.frame = frame;
  for (std::size_t i = 0; i < dbh_m.size(); ++i) {
    Stem stem;
    stem.point = Eigen::Vector3f(3.0F * static_cast<float>(i % 20 + 1),
                                 3.0F * static_cast<float>(i / 20 + 1), 0.0F);
    stem.dbh_m = static_cast<float>(dbh_m[i]);
    stem.radius_sd_m = 0.005F;
    view.stems.push_back(stem);
  }
  return view;
}

// The standard deviation was once that of a mean of independent sights, from their scatter alone.
// Half of the errors were within it at lieksa1 to lieksa3. All sights share that a stem is not
// round, and few sights agree by chance.
TEST(StemMap, TheDeviationOfADiameterHoldsWhatAllSightsShare) {
  constexpr double kTrue = 0.2;
  constexpr std::size_t kTrees = 400;
  for (const int sights : {3, 6, 30}) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    std::vector<double> seen(kTrees);
    for (double& dbh : seen)
      dbh = kTrue * (1.0 + 0.015 * normal(random));
    std::vector<StemView> views;
    for (int i = 0; i < sights; ++i) {
      std::vector<double> noisy = seen;
      for (double& dbh : noisy)
        dbh += 0.01 * normal(random);
      views.push_back(view_of_diameters(i, noisy));
    }
    const auto map = build_stem_map(views, std::vector<Pose>(views.size()), {});
    ASSERT_EQ(map.size(), kTrees);
    double once = 0.0;
    double twice = 0.0;
    for (const MappedStem& stem : map) {
      const double error = std::abs(stem.dbh_m - kTrue);
      once += error <= dbh_sd_m(stem, 0.0) ? 1.0 / kTrees : 0.0;
      twice += error <= 2.0 * dbh_sd_m(stem, 0.0) ? 1.0 / kTrees : 0.0;
    }
    EXPECT_NEAR(once, 0.683, 0.06) << sights;
    EXPECT_NEAR(twice, 0.954, 0.03) << sights;
  }
}

// What beams add is the same in all sights: it does not become smaller in their mean.
TEST(StemMap, WideBeamsMakeADiameterLessSure) {
  std::vector<StemView> views;
  for (int i = 0; i < 100; ++i)
    views.push_back(view_of_diameters(i, {0.2}));
  const auto map = build_stem_map(views, std::vector<Pose>(views.size()), {});
  ASSERT_EQ(map.size(), 1U);
  EXPECT_NEAR(map[0].dbh_range_m, std::hypot(3.0, 3.0), 1e-6);
  EXPECT_LT(dbh_sd_m(map[0], 0.0), 0.0035);
  EXPECT_GT(dbh_sd_m(map[0], 0.02), 0.015);
}

TEST(StemMap, ALoneSightIsAsSureAsItStates) {
  StemMapConfig config;
  config.min_sights = 1;
  StemView view = view_of_diameters(0, {0.2});
  const auto sd = [&] { return dbh_sd_m(build_stem_map({view}, {Pose()}, config).at(0), 0.0); };
  EXPECT_NEAR(sd(), std::hypot(0.01, 0.003), 1e-6);
  view.stems[0].radius_sd_m = Stem::kUnknown;
  EXPECT_TRUE(std::isnan(sd()));
  view.stems[0].dbh_m = Stem::kUnknown;
  EXPECT_TRUE(std::isnan(sd()));
}

}  // namespace
}  // namespace understory
