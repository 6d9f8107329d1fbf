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
}

}  // namespace
}  // namespace understory
