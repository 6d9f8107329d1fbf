#include "understory/odometry/dense/scan_parts.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "understory/geometry/matrix_inverse.h"

namespace understory {
namespace {

// 100 points, a millisecond apart.
Scan hundred_points() {
  Scan scan;
  scan.stamp = 5'000'000'000;
  scan.ring_count = 16;
  for (std::uint32_t i = 0; i < 100; ++i)
    scan.points.push_back({static_cast<float>(i), 0.0F, 0.0F, 1.0F, i * 1'000'000, 3, 0, 0});
  return scan;
}

TEST(ScanParts, QuartersHoldEachPointOnceAtItsTime) {
  const Scan scan = hundred_points();
  const std::vector<Scan> parts = parts_of(scan, 0.25);
  ASSERT_EQ(parts.size(), 4U);
  std::size_t next = 0;
  for (const Scan& part : parts) {
    EXPECT_EQ(part.points.size(), 25U);
    EXPECT_EQ(part.points.front().t_ns, 0U);
    EXPECT_EQ(part.ring_count, 16);
    for (const ScanPoint& point : part.points) {
      EXPECT_EQ(point.x, static_cast<float>(next));
      EXPECT_EQ(part.stamp + point.t_ns, scan.stamp + scan.points[next].t_ns);
      ++next;
    }
  }
  EXPECT_EQ(next, scan.points.size());
}

TEST(ScanParts, TheRestOfAFractionGoesWithTheLastPart) {
  const std::vector<Scan> parts = parts_of(hundred_points(), 0.3);  // 0.3, 0.3, 0.4
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(parts[0].points.size(), 30U);
  EXPECT_EQ(parts[2].points.size(), 40U);
  EXPECT_EQ(parts_of(hundred_points(), 1.0).size(), 1U);
}

TEST(ScanParts, AScanWithoutTimesHasNone) {
  Scan scan = hundred_points();
  scan.has_point_times = false;
  for (ScanPoint& point : scan.points)
    point.t_ns = 0;
  EXPECT_TRUE(parts_of(scan, 0.25).empty());
}

// Two beliefs of one pose: the weighted mean of least squares, found here by the normal equations.
TEST(ScanParts, FusionIsTheLeastSquaresMeanOfPredictionAndMatch) {
  NavState predicted;
  predicted.world_from_body =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.1, 0.2, 1.0).normalized())),
           {3.0, -2.0, 1.0});
  Matrix6d root = Matrix6d::Identity();
  root(0, 3) = 0.4;
  root(4, 1) = -0.3;
  predicted.pose_covariance = 1e-4 * root * root.transpose();
  Matrix6d covariance = 4e-4 * Matrix6d::Identity();
  covariance(5, 5) = 1e-2;
  Vector6d off;
  off << 1e-4, -2e-4, 1e-4, 0.01, -0.02, 0.03;
  const Pose match = predicted.world_from_body * Pose::exp(off);
  const Matrix6d a = inverse_matrix(predicted.pose_covariance);
  const Matrix6d b = inverse_matrix(covariance);
  const Vector6d expected = (a + b).ldlt().solve(b * off);
  const Vector6d found =
      right_difference(fuse(predicted, match, covariance), predicted.world_from_body);
  EXPECT_LT((found - expected).norm(), 1e-9);
  EXPECT_GT(expected.norm(), 1e-3);
}

}  // namespace
}  // namespace understory
