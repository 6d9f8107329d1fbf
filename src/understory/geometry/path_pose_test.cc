#include "understory/geometry/path_pose.h"

#include <gtest/gtest.h>

#include <vector>

namespace understory {
namespace {

Pose at_x(double x) {
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0.0, 0.0)};
}

const std::vector<StampedPose> kPath = {{from_seconds(10.0), at_x(1.0)},
                                        {from_seconds(10.1), at_x(2.0)},
                                        {from_seconds(10.3), at_x(6.0)}};

double x_at(double seconds, double beyond = 0.0) {
  return pose_on_path(kPath, from_seconds(seconds), beyond).translation().x();
}

TEST(PathPose, LiesBetweenTheNeighbours) {
  EXPECT_NEAR(x_at(10.05), 1.5, 1e-9);
  EXPECT_NEAR(x_at(10.1), 2.0, 1e-9);
  EXPECT_NEAR(x_at(10.15), 3.0, 1e-9);
}

TEST(PathPose, OutsideItStaysOrGoesOnAsFarAsAllowed) {
  EXPECT_EQ(x_at(9.0), 1.0);
  EXPECT_EQ(x_at(9.0, 1.0), 1.0);
  EXPECT_EQ(x_at(10.4), 6.0);
  EXPECT_NEAR(x_at(10.4, 1.0), 8.0, 1e-9);
  EXPECT_NEAR(x_at(11.0, 1.0), 10.0, 1e-9);
  const std::vector<StampedPose> one(kPath.begin(), kPath.begin() + 1);
  EXPECT_EQ(pose_on_path(one, from_seconds(12.0), 1.0).translation().x(), 1.0);
}

}  // namespace
}  // namespace understory
