#include "understory/evaluation/trajectory_errors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDeg = M_PI / 180.0;

// A walk of `n` poses at 10 Hz, `step` metres apart, along a wavy line.
Trajectory walk(std::size_t n, double step) {
  Trajectory poses;
  Pose pose;
  for (std::size_t i = 0; i < n; ++i) {
    poses.push_back({static_cast<TimeNs>(i) * 100'000'000, pose});
    const double turn = 0.02 * std::sin(0.05 * static_cast<double>(i));
    pose = pose * Pose(so3_exp({0.1 * turn, -0.05 * turn, turn}), Eigen::Vector3d(step, 0, 0));
  }
  return poses;
}

Trajectory transformed(const Trajectory& poses, const Pose& motion) {
  Trajectory result = poses;
  for (StampedPose& pose : result)
    pose.world_from_body = motion * pose.world_from_body;
  return result;
}

TrajectoryErrors errors_of(const Trajectory& estimate, const Trajectory& truth,
                           Alignment alignment) {
  EvaluationOptions options;
  options.alignment = alignment;
  options.rpe_deltas_m = {10.0, 1.0};
  const auto errors = evaluate_trajectory(estimate, truth, options);
  EXPECT_TRUE(errors.has_value());
  return errors.value_or(TrajectoryErrors());
}

// The definitions of docs/reference/evaluation.md written out once more, pose by pose, with
// matrices.
double matrix_rpe(const Trajectory& estimate, const Trajectory& truth, double delta) {
  double sum = 0.0;
  int n = 0;
  double path = 0.0;
  std::size_t from = 0;
  for (std::size_t i = 1; i < estimate.size(); ++i) {
    path += (estimate[i].world_from_body.matrix().block<3, 1>(0, 3) -
             estimate[i - 1].world_from_body.matrix().block<3, 1>(0, 3))
                .norm();
    if (path < delta) continue;
    const Eigen::Matrix4d q =
        truth[from].world_from_body.matrix().inverse() * truth[i].world_from_body.matrix();
    const Eigen::Matrix4d p =
        estimate[from].world_from_body.matrix().inverse() * estimate[i].world_from_body.matrix();
    sum += (q.inverse() * p).block<3, 1>(0, 3).squaredNorm();
    ++n;
    path = 0.0;
    from = i;
  }
  return std::sqrt(sum / n);
}

TEST(TrajectoryErrors, UnalignedByDefaultSoAShiftShows) {
  const Trajectory truth = walk(300, 0.1);
  const Trajectory estimate =
      transformed(truth, Pose(so3_exp({0, 0, 0}), Eigen::Vector3d(3, 4, 12)));
  const TrajectoryErrors errors = errors_of(estimate, truth, EvaluationOptions().alignment);
  EXPECT_EQ(errors.alignment, Alignment::kNone);
  EXPECT_NEAR(errors.ape_rmse_m, 13.0, 1e-9);
  EXPECT_NEAR(errors.ape_plane_rmse_m, 5.0, 1e-9);
  EXPECT_NEAR(errors.ape_median_m, 13.0, 1e-9);
  EXPECT_NEAR(errors.ape_max_m, 13.0, 1e-9);
  EXPECT_NEAR(errors.drift_end_m, 0.0, 1e-9);
  EXPECT_NEAR(errors.length_m, 29.9, 1e-9);
}

TEST(TrajectoryErrors, AlignmentsTakeAwayWhatTheyMay) {
  const Trajectory truth = walk(300, 0.1);
  const Trajectory turned =
      transformed(truth, Pose(so3_exp({0, 0, 1.0}), Eigen::Vector3d(30, -4, 12)));
  for (const Alignment a : {Alignment::kFirst, Alignment::kYaw, Alignment::kSe3}) {
    const TrajectoryErrors errors = errors_of(turned, truth, a);
    EXPECT_LT(errors.ape_rmse_m, 1e-9);
    EXPECT_LT(errors.ape_rotation_rmse_deg, 1e-5);
  }
  const Trajectory tilted =
      transformed(truth, Pose(so3_exp({0.1, 0, 1}), Eigen::Vector3d(1, 2, 3)));
  EXPECT_LT(errors_of(tilted, truth, Alignment::kSe3).ape_rmse_m, 1e-9);
  EXPECT_GT(errors_of(tilted, truth, Alignment::kYaw).ape_rotation_rmse_deg, 5.0);
}

TEST(TrajectoryErrors, RotationIsInDegrees) {
  const Trajectory truth = walk(50, 0.1);
  Trajectory estimate = truth;
  for (StampedPose& pose : estimate)
    pose.world_from_body = pose.world_from_body * Pose(so3_exp({0, 2.0 * kDeg, 0}), {0, 0, 0});
  EXPECT_NEAR(errors_of(estimate, truth, Alignment::kNone).ape_rotation_rmse_deg, 2.0, 1e-9);
}

TEST(TrajectoryErrors, RelativeErrorAgreesWithMatricesOnANoisyWalk) {
  Random random(3);
  const Trajectory truth = walk(1200, 0.1);
  Trajectory estimate = truth;
  Pose error;
  for (StampedPose& pose : estimate) {
    Vector6d xi;
    for (int i = 0; i < 6; ++i)
      xi(i) = random.normal(0.0, 3e-3);
    error = error * Pose::exp(xi);
    pose.world_from_body = pose.world_from_body * error;
  }
  const TrajectoryErrors errors = errors_of(estimate, truth, Alignment::kNone);
  ASSERT_EQ(errors.rpe.size(), 2u);
  EXPECT_NEAR(errors.rpe[0].translation_rmse_m, matrix_rpe(estimate, truth, 10.0), 1e-9);
  EXPECT_NEAR(errors.rpe[1].translation_rmse_m, matrix_rpe(estimate, truth, 1.0), 1e-9);
  EXPECT_GT(errors.rpe[0].translation_rmse_m, 1e-3);
  EXPECT_NEAR(errors.rpe[0].translation_percent, errors.rpe[0].translation_rmse_m * 10.0, 1e-12);
}

// Heading that drifts by a known rate: the end error, the segments and the drift follow.
TEST(TrajectoryErrors, DriftAndSegmentsOfAScaleErrorAreItsSize) {
  Trajectory truth;
  Trajectory estimate;
  for (int i = 0; i <= 2000; ++i) {
    const TimeNs stamp = static_cast<TimeNs>(i) * 100'000'000;
    truth.push_back({stamp, Pose(so3_exp({0, 0, 0.7}), Eigen::Vector3d(0.1 * i, 0, 0))});
    estimate.push_back({stamp, Pose(so3_exp({0, 0, 0.7}), Eigen::Vector3d(0.101 * i, 0, 0))});
  }
  const TrajectoryErrors errors = errors_of(estimate, truth, Alignment::kNone);
  EXPECT_NEAR(errors.drift_end_m, 2.0, 1e-9);
  EXPECT_NEAR(errors.drift_end.x(), 2.0, 1e-9);
  EXPECT_NEAR(errors.drift_plane_m, 2.0, 1e-9);
  EXPECT_NEAR(errors.drift_percent, 1.0, 1e-9);
  ASSERT_EQ(errors.segments.size(), 9u) << "10 to 80 m in steps of 10, and 100 m";
  for (const SegmentError& segment : errors.segments) {
    EXPECT_NEAR(segment.translation_percent, 1.0, 0.02);
    EXPECT_NEAR(segment.translation_plane_percent, 1.0, 0.02);
    EXPECT_NEAR(segment.rotation_deg_per_m, 0.0, 1e-6);
  }
  EXPECT_EQ(errors.segments.back().length_m, 100.0);
}

// However the estimate lies, and whatever alignment is asked for.
TEST(TrajectoryErrors, ScaleOfThePathIsToldWhateverTheAlignment) {
  const Trajectory truth = walk(300, 0.1);
  Trajectory small = truth;
  for (StampedPose& pose : small)
    pose.world_from_body =
        Pose(pose.world_from_body.rotation(), 0.998 * pose.world_from_body.translation());
  small = transformed(small, Pose(so3_exp({0.1, 0.2, 2.0}), Eigen::Vector3d(30, -4, 12)));
  for (const Alignment alignment : {Alignment::kNone, Alignment::kSe3}) {
    EXPECT_NEAR(errors_of(small, truth, alignment).scale_percent.value(), -0.2, 1e-6);
    EXPECT_NEAR(errors_of(truth, truth, alignment).scale_percent.value(), 0.0, 1e-6);
  }
  Trajectory still = truth;
  for (StampedPose& pose : still)
    pose.world_from_body = Pose();
  EXPECT_FALSE(errors_of(still, truth, Alignment::kNone).scale_percent.has_value());
}

TEST(TrajectoryErrors, LongRunsHaveKittisLengths) {
  const TrajectoryErrors errors = errors_of(walk(1000, 1.0), walk(1000, 1.0), Alignment::kNone);
  ASSERT_EQ(errors.segments.size(), 8u);
  EXPECT_EQ(errors.segments.front().length_m, 100.0);
  EXPECT_EQ(errors.segments.back().length_m, 800.0);
}

TEST(TrajectoryErrors, PairsByNearestTimeNeverInterpolated) {
  Trajectory truth = walk(100, 0.1);
  Trajectory estimate;
  for (std::size_t i = 0; i < truth.size(); i += 2) {
    estimate.push_back(truth[i]);
    estimate.back().stamp += 4'000'000;
  }
  EXPECT_EQ(associate(estimate, truth, 0.005).size(), 50u);
  EXPECT_EQ(associate(truth, estimate, 0.005).size(), 50u);
  EXPECT_TRUE(associate(estimate, truth, 0.003).empty());
  EXPECT_FALSE(evaluate_trajectory(estimate, truth, {Alignment::kNone, 0.003, {}}).has_value());
  for (const auto& [i, j] : associate(estimate, truth, 0.005))
    EXPECT_EQ(j, 2 * i);
}

TEST(TrajectoryErrors, SaysWhatShareOfTheTruthIsCovered) {
  const Trajectory truth = walk(101, 0.1);
  const Trajectory estimate(truth.begin() + 10, truth.begin() + 51);
  const TrajectoryErrors errors = errors_of(estimate, truth, Alignment::kNone);
  EXPECT_EQ(errors.pairs, 41u);
  EXPECT_NEAR(errors.covered, 0.4, 1e-12);
  EXPECT_NEAR(errors.length_m, 4.0, 1e-9);
  EXPECT_TRUE(errors.segments.empty());
  EXPECT_TRUE(std::isnan(errors.rpe[0].translation_rmse_m)) << "no pair is 10 m long";
}

TEST(TrajectoryErrors, VelocityPerAxisAfterTheAlignmentsRotation) {
  std::vector<StampedVelocity> truth;
  std::vector<StampedVelocity> estimate;
  const Eigen::Quaterniond quarter = so3_exp({0, 0, M_PI / 2});
  for (int i = 0; i < 10; ++i) {
    truth.push_back({i * 100'000'000, {1.0, 0.0, 0.0}});
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    estimate.push_back(
        {i * 100'000'000, quarter.inverse() * Eigen::Vector3d(1.0 + sign, 2.0, 0.5)});
  }
  const auto rmse = velocity_rmse(estimate, truth, quarter, 0.01);
  ASSERT_TRUE(rmse.has_value());
  EXPECT_LT((*rmse - Eigen::Vector3d(1.0, 2.0, 0.5)).norm(), 1e-12);
  EXPECT_FALSE(velocity_rmse(estimate, {}, quarter, 0.01).has_value());
}

}  // namespace
}  // namespace understory
