#include "understory/registration/stems/sparse_icp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "understory/registration/icp/nearest_pairs.h"
#include "understory/registration/icp/nearest_table.h"
#include "understory/registration/stems/go_icp.h"
#include "understory/registration/stems/test_stems.h"
#include "understory/registration/stems/tilt_about.h"
#include "understory/registration/stems/yaw_vote.h"

namespace understory {
namespace {

using testing::make_pair;
using testing::Pair;
using testing::yaw_pose;

// What is not searched again is what a search would find, wherever the source goes.
TEST(NearestPairs, AreThoseOfASearchWhileTheSourceMoves) {
  for (const double weight : {0.0, 0.05, 1.0}) {
    const Pair pair = make_pair(11, 130, 0.1, 0.3, Pose());
    const PlaneGrid grid(pair.target);
    NearestPairs nearest(grid, pair.source.size(), weight);
    Vector6d step;
    step << 0.002, -0.003, 0.01, 0.08, -0.05, 0.01;
    Pose pose;
    for (int round = 0; round < 60; ++round) {
      for (std::size_t i = 0; i < pair.source.size(); ++i) {
        const Eigen::Vector3d at = pose * pair.source[i];
        const auto expected = grid.nearest(at, 1e9, weight);
        const auto found = nearest.of(i, at);
        ASSERT_EQ(found.index, expected.index) << "round " << round << ", weight " << weight;
        ASSERT_DOUBLE_EQ(found.squared_m2, expected.squared_m2);
      }
      pose = pose * Pose::exp(step * (round % 3 == 0 ? 3.0 : round % 7 == 0 ? -1.5 : 0.2));
    }
  }
  EXPECT_EQ(NearestPairs(PlaneGrid({}), 1, 1.0).of(0, Eigen::Vector3d::Zero()).index, -1);
}

TEST(PlaneGrid, NearestIsThatOfAllPoints) {
  const Pair pair = make_pair(3, 140, 0.0, 0.0, Pose());
  const PlaneGrid grid(pair.target);
  const NearestTable table(grid, 2.0);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> place(-60.0, 60.0);
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d at(place(random), place(random), 0.05 * place(random));
    double plane = 1e300;
    double space = 1e300;
    for (const auto& point : pair.target) {
      plane = std::min(plane, (point - at).head<2>().squaredNorm());
      space = std::min(space, (point - at).squaredNorm());
    }
    EXPECT_NEAR(grid.nearest(at, 1e9, 0.0).squared_m2, plane, 1e-9 * plane);
    EXPECT_NEAR(grid.nearest(at, 1e9, 1.0).squared_m2, space, 1e-9 * space);
    EXPECT_NEAR(table.squared_distance(at.x(), at.y()), plane, 1e-9 * plane);
    EXPECT_EQ(grid.nearest(at, 1.0, 0.0).index >= 0, plane <= 1.0);
  }
}

TEST(SparseIcp, FindsTheMotionInSpaceDespiteOutliers) {
  const Pose truth = Pose(so3_exp({0.02, -0.01, 0.06}), {0.5, -0.4, 0.3});
  const Pair pair = make_pair(5, 150, 0.02, 0.4, truth);
  const auto result = register_sparse_icp(SparseTarget(pair.target), pair.source, Pose(), {});
  EXPECT_EQ(result.status, SparseIcpStatus::kConverged);
  const Pose error = truth.inverse() * result.target_from_source;
  EXPECT_LT(error.translation().norm(), 0.02);
  EXPECT_LT(error.angle(), 0.002);
  EXPECT_NEAR(result.overlap, 0.8, 0.1);
  EXPECT_NEAR(result.outlier_ratio, 1.0 - result.overlap, 1e-12);
  EXPECT_NEAR(result.sigma_plane_m, 0.02, 0.015);
}

TEST(SparseIcp, PlaneLeavesHeightAndTilt) {
  const Pose truth = yaw_pose(0.05, 0.4, 0.3, 0.7);
  const Pair pair = make_pair(6, 120, 0.01, 0.2, truth);
  SparseIcpConfig config;
  config.metric = SparseIcpConfig::Metric::kPlane;
  const auto result = register_sparse_icp(SparseTarget(pair.target), pair.source, Pose(), config);
  const Pose& found = result.target_from_source;
  EXPECT_NEAR(found.translation().x(), 0.4, 0.02);
  EXPECT_NEAR(found.translation().y(), 0.3, 0.02);
  EXPECT_NEAR(found.translation().z(), 0.0, 1e-3);
  EXPECT_GT((found.rotation() * Eigen::Vector3d::UnitZ()).z(), 1.0 - 1e-6);
}

// Half of the source's feet are guessed up to a metre too high, and it says so.
TEST(SparseIcp, HeightsWeighByWhatIsKnownOfThem) {
  const Pose truth = Pose(so3_exp({0.01, -0.01, 0.05}), {0.4, -0.3, 0.2});
  Pair pair = make_pair(8, 150, 0.02, 0.2, truth);
  std::vector<double> source_sd;
  std::mt19937 random(9);
  std::uniform_real_distribution<double> too_high(0.0, 1.0);
  for (Eigen::Vector3d& point : pair.source) {
    const bool guessed = point.x() > 0.0;
    if (guessed) point.z() += too_high(random);
    source_sd.push_back(guessed ? 1.0 : 0.05);
  }
  const std::vector<double> target_sd(pair.target.size(), 0.05);
  const auto tilt = [&](const SparseIcpResult& result) {
    const Eigen::Vector3d up =
        (truth.inverse() * result.target_from_source).rotation() * Eigen::Vector3d::UnitZ();
    return up.head<2>().norm();
  };
  const auto blind = register_sparse_icp(SparseTarget(pair.target), pair.source, Pose(), {});
  const auto told =
      register_sparse_icp(SparseTarget(pair.target, target_sd), pair.source, Pose(), {}, source_sd);
  EXPECT_GT(tilt(blind), 0.005);
  EXPECT_LT(tilt(told), 0.002);
  const Pose error = truth.inverse() * told.target_from_source;
  EXPECT_LT(error.translation().norm(), 0.03);
  EXPECT_GT(told.overlap, 0.7);
  // One side that does not say: as before.
  const auto half =
      register_sparse_icp(SparseTarget(pair.target), pair.source, Pose(), {}, source_sd);
  EXPECT_EQ(half.target_from_source.matrix(), blind.target_from_source.matrix());
}

// Where a tilt is uncertain, the middle of the points is not. The tilt changes neither its place
// nor its covariance, but the origin 3 m above it moves by 3 m times the tilt.
TEST(TiltAbout, LeavesTheMiddleOfThePointsInPlace) {
  const SparsePoints points = {{2.0, -1.0, -3.5}, {8.0, 5.0, -2.5}};
  const Eigen::Vector3d middle = middle_of(points);
  EXPECT_TRUE(middle.isApprox(Eigen::Vector3d(5.0, 2.0, -3.0)));
  const Matrix6d covariance = tilt_about(middle, 0.01);
  Eigen::Matrix<double, 3, 6> moves;
  moves << -skew(middle), Eigen::Matrix3d::Identity();
  EXPECT_LT((moves * covariance * moves.transpose()).norm(), 1e-12);
  EXPECT_NEAR(covariance(0, 0), 1e-4, 1e-12);
  EXPECT_NEAR(covariance(2, 2), 0.0, 1e-15);
  EXPECT_NEAR(std::sqrt(covariance(3, 3)), 0.03, 1e-9);
  EXPECT_TRUE(middle_of({}).isZero());
}

TEST(SparseIcp, FewStemsAreSaid) {
  const SparsePoints few = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto result = register_sparse_icp(SparseTarget(few), few, Pose(), {});
  EXPECT_EQ(result.status, SparseIcpStatus::kTooFewPoints);
  EXPECT_FALSE(result.reason.empty());
  EXPECT_EQ(register_go_icp(SparseTarget(few), few, Pose(), {}).status, GoIcpStatus::kTooFewPoints);
}

// P0 (25) with the paper's numbers, as corrected in the errata: gamma 0.6 gives 4.5 degrees.
TEST(SparseIcp, ConvergenceRegionOfThePaper) {
  const ConvergenceRegion region = convergence_region(3.5, 35.0, 0.6);
  EXPECT_DOUBLE_EQ(region.delta0_m, 1.75);
  EXPECT_NEAR(region.theta0_rad * 180.0 / M_PI, 4.53, 0.01);
  EXPECT_NEAR(convergence_region(3.5, 35.0, 0.4).theta0_rad * 180.0 / M_PI, 3.70, 0.01);
  EXPECT_TRUE(region.contains(1.7, 0.0, 0.0));
  EXPECT_FALSE(region.contains(1.3, 0.06, 0.0));
}

TEST(YawVote, FindsAnyTurn) {
  for (const double yaw : {-2.9, -1.0, 0.4, 2.2}) {
    const Pose truth = yaw_pose(yaw, 3.0, -4.0, 0.4);
    const Pair pair = make_pair(7, 150, 0.05, 0.5, truth);
    const auto found = vote_yaw(SparseTarget(pair.target), pair.source, Pose(), {});
    ASSERT_FALSE(found.empty());
    const Pose error = truth.inverse() * found.front().target_from_source;
    EXPECT_LT(error.translation().norm(), 1.0);
    EXPECT_LT(error.angle(), 0.06);
  }
}

}  // namespace
}  // namespace understory
