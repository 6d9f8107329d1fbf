#include "understory/odometry/dense/scan_tops.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <utility>

#include "understory/util/random.h"

namespace understory {
namespace {

void add(const Eigen::Vector3f& point, BodyCloud& cloud) {
  cloud.points.push_back(point);
  const auto n = static_cast<float>(cloud.points.size());
  cloud.intensity.push_back(n);
  cloud.range.push_back(2.0F * n);
  cloud.ring.push_back(static_cast<std::uint16_t>(cloud.points.size() % 16));
  cloud.t_ns.push_back(static_cast<std::uint32_t>(cloud.points.size()));
}

// Three crowns of 150 points 3 m below the body, a bush as dense below each, and flat ground, z up.
BodyCloud crowns_and_bushes(std::uint64_t seed) {
  Random random(seed);
  BodyCloud cloud;
  cloud.stamp = 5;
  for (const auto& [x, y] : {std::pair{4.0, 0.0}, {-3.0, 6.0}, {0.0, -8.0}}) {
    for (int k = 0; k < 150; ++k) {
      const double r = 0.7 * std::sqrt(random.uniform());
      const double angle = random.uniform(0.0, 2.0 * M_PI);
      add(Eigen::Vector3d(x + r * std::cos(angle), y + r * std::sin(angle),
                          -3.0 - 1.5 * r - 0.3 * random.uniform())
              .cast<float>(),
          cloud);
      add(Eigen::Vector3d(x + 0.4 * random.uniform(-1.0, 1.0), y + 0.4 * random.uniform(-1.0, 1.0),
                          -6.5 + 0.4 * random.uniform())
              .cast<float>(),
          cloud);
    }
  }
  for (int k = 0; k < 600; ++k)  // beside the trees
    add(Eigen::Vector3f(static_cast<float>(random.uniform(7.0, 27.0)),
                        static_cast<float>(random.uniform(-10.0, 10.0)), -7.0F),
        cloud);
  return cloud;
}

ScanTopsConfig tops_only() {
  ScanTopsConfig config;
  config.points = ScanPoints::kTreeTops;
  return config;
}

TEST(ScanTops, AllPointsCountUnlessTopsAreAskedFor) {
  EXPECT_FALSE(keep_tree_tops(crowns_and_bushes(1), Pose(), ScanTopsConfig{}).has_value());
}

TEST(ScanTops, CrownsStayWithAllThatIsKnownOfTheirPoints) {
  const BodyCloud cloud = crowns_and_bushes(2);
  const auto tops = keep_tree_tops(cloud, Pose(), tops_only());
  ASSERT_TRUE(tops.has_value());
  EXPECT_EQ(tops->stamp, cloud.stamp);
  EXPECT_GT(tops->size(), 400U);
  EXPECT_LE(tops->size(), 450U) << "no point of a bush or of the ground";
  for (std::size_t n = 0; n < tops->size(); ++n) {
    const auto i = static_cast<std::size_t>(tops->intensity[n]) - 1;
    EXPECT_EQ(tops->points[n], cloud.points[i]);
    EXPECT_EQ(tops->range[n], cloud.range[i]);
    EXPECT_EQ(tops->ring[n], cloud.ring[i]);
    EXPECT_EQ(tops->t_ns[n], cloud.t_ns[i]);
  }
}

// A top is the highest in the world, however the body hangs.
TEST(ScanTops, UpIsThatOfTheWorld) {
  const Pose world_from_body(
      Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1.0, 2.0, 0.5).normalized())),
      Eigen::Vector3d(100.0, -50.0, 30.0));
  const BodyCloud level = crowns_and_bushes(3);
  BodyCloud turned = level;
  const Eigen::Matrix3f back = world_from_body.rotation_matrix().transpose().cast<float>();
  for (Eigen::Vector3f& point : turned.points)
    point = back * point;
  const auto expected = keep_tree_tops(level, Pose(), tops_only());
  const auto found = keep_tree_tops(turned, world_from_body, tops_only());
  ASSERT_TRUE(expected.has_value());
  ASSERT_TRUE(found.has_value());
  const std::set<float> known(expected->intensity.begin(), expected->intensity.end());
  std::size_t same = 0;
  for (const float id : found->intensity)
    same += known.count(id);
  EXPECT_GT(same, expected->size() * 98 / 100);
  EXPECT_LT(found->size(), expected->size() * 102 / 100);
}

TEST(ScanTops, ScansWithFewOfThemKeepAllPoints) {
  ScanTopsConfig config = tops_only();
  config.least_points = 451;
  EXPECT_FALSE(keep_tree_tops(crowns_and_bushes(4), Pose(), config).has_value());
  config.least_points = 400;
  EXPECT_TRUE(keep_tree_tops(crowns_and_bushes(4), Pose(), config).has_value());
}

TEST(ScanTops, OfAnEmptyScanThereAreNone) {
  EXPECT_FALSE(keep_tree_tops(BodyCloud(), Pose(), tops_only()).has_value());
}

}  // namespace
}  // namespace understory
