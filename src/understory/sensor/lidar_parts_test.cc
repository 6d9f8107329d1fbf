#include "understory/sensor/lidar_parts.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Rig two_lidars() {
  Rig rig;
  rig.body_from_lidar = Pose(Eigen::Quaterniond::Identity(), {1.0, 0.0, 2.0});
  const Eigen::Quaterniond back(Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::UnitZ()));
  rig.further_lidars.push_back({Pose(back, {-3.0, 0.0, 0.5}), kRingsALidar});
  return rig;
}

TEST(LidarParts, EachLidarGetsItsPointsInItsOwnFrameAndWithItsOwnRings) {
  Scan merged;
  merged.stamp = 7;
  merged.points.push_back({5.0F, 1.0F, 0.0F, 3.0F, 10, 2});
  // Five metres before the second lidar, which looks back: at x = -3 - 5.
  merged.points.push_back({-8.0F, 0.0F, 0.5F, 4.0F, 20, kRingsALidar + 4});
  const std::vector<LidarPart> parts = lidar_parts(merged, two_lidars());
  ASSERT_EQ(parts.size(), 2U);
  ASSERT_EQ(parts[0].scan.points.size(), 1U);
  EXPECT_EQ(parts[0].scan.points[0].x, 5.0F);
  ASSERT_EQ(parts[1].scan.points.size(), 1U);
  const ScanPoint& point = parts[1].scan.points[0];
  EXPECT_NEAR(point.x, 5.0F, 1e-6F);
  EXPECT_NEAR(point.y, 0.0F, 1e-6F);
  EXPECT_NEAR(point.z, 0.0F, 1e-6F);
  EXPECT_EQ(point.ring, 4);
  EXPECT_EQ(point.t_ns, 20U);
  EXPECT_EQ(parts[1].from, std::vector<std::size_t>{1});
  EXPECT_TRUE(parts[1].body_from_lidar.translation().isApprox(Eigen::Vector3d(-2.0, 0.0, 2.5)));
}

TEST(LidarParts, RangesCountFromTheLidarThatMeasured) {
  const RayOrigins origins(two_lidars());
  EXPECT_FLOAT_EQ(origins.range({3.0F, 4.0F, 0.0F, 0.0F, 0, 15}), 5.0F);
  EXPECT_FLOAT_EQ(origins.range({-3.0F, 4.0F, 0.5F, 0.0F, 0, kRingsALidar}), 4.0F);
}

}  // namespace
}  // namespace understory
