// GTSAM as it is linked here: the parts that the estimator relies on, run through Eigen types that
// cross the library's border. A library compiled for another instruction set fails here, because
// Eigen's alignment then differs on the two sides.

#include <gtest/gtest.h>
#include <gtsam/geometry/Pose3.h>
#include <gtsam/inference/Ordering.h>
#include <gtsam/inference/Symbol.h>
#include <gtsam/navigation/CombinedImuFactor.h>
#include <gtsam/nonlinear/ISAM2.h>
#include <gtsam/nonlinear/LevenbergMarquardtOptimizer.h>
#include <gtsam/nonlinear/Marginals.h>
#include <gtsam/nonlinear/PriorFactor.h>
#include <gtsam/slam/BetweenFactor.h>

#include <memory>
#include <vector>

namespace {

using gtsam::symbol_shorthand::X;

const int kPoses = 20;

gtsam::Pose3 step() {
  return {gtsam::Rot3::Expmap(gtsam::Vector3(0.02, -0.01, 0.31)), gtsam::Point3(1.0, 0.1, 0.05)};
}

gtsam::SharedNoiseModel noise() {
  return gtsam::noiseModel::Isotropic::Sigma(6, 0.1);
}

// A chain of equal steps, whose exact solution is the power of the step.
gtsam::NonlinearFactorGraph chain() {
  gtsam::NonlinearFactorGraph graph;
  graph.addPrior(X(0), gtsam::Pose3(), noise());
  for (int i = 1; i < kPoses; ++i) {
    graph.emplace_shared<gtsam::BetweenFactor<gtsam::Pose3>>(X(i - 1), X(i), step(), noise());
  }
  return graph;
}

gtsam::Pose3 expected_pose(int index) {
  gtsam::Pose3 pose;
  for (int i = 0; i < index; ++i)
    pose = pose * step();
  return pose;
}

gtsam::Values disturbed_guess() {
  gtsam::Values guess;
  for (int i = 0; i < kPoses; ++i) {
    const double size = 0.02 * (i % 5);
    guess.insert(X(i), expected_pose(i).retract(gtsam::Vector6::Constant(size)));
  }
  return guess;
}

TEST(Gtsam, SolvesAPoseGraphWithEitherOrdering) {
  for (const auto type : {gtsam::Ordering::COLAMD, gtsam::Ordering::METIS}) {
    gtsam::LevenbergMarquardtParams params;
    params.orderingType = type;
    params.relativeErrorTol = 1e-12;
    const gtsam::NonlinearFactorGraph graph = chain();
    const gtsam::Values solution =
        gtsam::LevenbergMarquardtOptimizer(graph, disturbed_guess(), params).optimize();
    for (int i = 0; i < kPoses; ++i) {
      EXPECT_TRUE(solution.at<gtsam::Pose3>(X(i)).equals(expected_pose(i), 1e-6)) << "pose " << i;
    }
    const gtsam::Matrix covariance = gtsam::Marginals(graph, solution).marginalCovariance(X(0));
    EXPECT_NEAR(covariance(0, 0), 0.01, 1e-9);
  }
}

TEST(Gtsam, IncrementalSolverAgreesWithTheBatch) {
  gtsam::ISAM2 isam(gtsam::ISAM2Params(gtsam::ISAM2GaussNewtonParams(0.0), 1e-7, 1));
  const gtsam::Values guess = disturbed_guess();
  const gtsam::NonlinearFactorGraph graph = chain();
  for (int i = 0; i < kPoses; ++i) {
    gtsam::NonlinearFactorGraph factors;
    factors.push_back(graph.at(i));
    gtsam::Values values;
    values.insert(X(i), guess.at<gtsam::Pose3>(X(i)));
    isam.update(factors, values);
  }
  for (int i = 0; i < 3; ++i)
    isam.update();
  const gtsam::Pose3 expected = expected_pose(kPoses - 1);
  EXPECT_TRUE(isam.calculateEstimate<gtsam::Pose3>(X(kPoses - 1)).equals(expected, 1e-5));
}

TEST(Gtsam, PreintegratesAConstantAcceleration) {
  const auto params = gtsam::PreintegrationCombinedParams::MakeSharedU(9.81);
  params->accelerometerCovariance = gtsam::I_3x3 * 1e-4;
  params->gyroscopeCovariance = gtsam::I_3x3 * 1e-6;
  gtsam::PreintegratedCombinedMeasurements measured(params);
  const gtsam::Vector3 acceleration(0.5, -0.2, 0.1);
  for (int i = 0; i < 200; ++i) {
    measured.integrateMeasurement(acceleration + gtsam::Vector3(0, 0, 9.81), gtsam::Z_3x1, 0.005);
  }
  const gtsam::NavState end = measured.predict(gtsam::NavState(), gtsam::imuBias::ConstantBias());
  EXPECT_LT((end.velocity() - acceleration).norm(), 1e-9);
  EXPECT_LT((end.position() - 0.5 * acceleration).norm(), 1e-9);
  EXPECT_GT(measured.preintMeasCov().diagonal().minCoeff(), 0.0);
}

}  // namespace
