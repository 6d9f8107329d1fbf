#include "understory/registration/solve.h"

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <utility>

namespace understory::internal {
namespace {

// Half the squared distance to a pose in a metric with strong and weak directions, how often it was
// asked, and where.
struct Bowl {
  Pose bottom;
  int asked = 0;

  PoseCost operator()(const Pose& pose) {
    ++asked;
    PoseCost at;
    const Vector6d metric = (Vector6d() << 400.0, 300.0, 200.0, 1.0, 4.0, 9.0).finished();
    add_term(PosePrior{bottom, metric.asDiagonal()}, pose, at);
    return at;
  }
};

Pose some_pose(int i) {
  std::mt19937 random(static_cast<unsigned>(i));
  std::uniform_real_distribution<double> about(-0.3, 0.3);
  Vector6d tangent;
  for (double& x : tangent)
    x = about(random);
  return Pose::exp(tangent);
}

double pose_difference(const Pose& a, const Pose& b) {
  return right_difference(a, b).norm();
}

TEST(Minimise, FindsTheBottom) {
  for (int i = 0; i < 50; ++i) {
    Bowl bowl{some_pose(i)};
    const Minimum found = minimise(std::ref(bowl), some_pose(1000 + i), StepLimits());
    EXPECT_TRUE(found.converged);
    EXPECT_LT(pose_difference(found.pose, bowl.bottom), 1e-4);
    EXPECT_EQ(bowl.asked, found.iterations + 1);
  }
}

TEST(Minimise, TrustsALastStepWithoutAskingWhereItLed) {
  for (int i = 0; i < 50; ++i) {
    const Pose guess = some_pose(1000 + i);
    Bowl bowl{some_pose(i)};
    StepLimits limits;
    const Minimum looked = minimise(std::ref(bowl), guess, limits);
    const int looking = std::exchange(bowl.asked, 0);
    limits.trust_last_step = true;
    const Minimum trusted = minimise(std::ref(bowl), guess, limits);
    EXPECT_EQ(bowl.asked, looking - 1);
    EXPECT_LT(pose_difference(trusted.pose, looked.pose), 1e-15);
    EXPECT_TRUE(trusted.converged);
  }
}

TEST(Minimise, ATrustedStepIsStillAStepBelowTheLimits) {
  Bowl bowl{some_pose(1)};
  StepLimits limits;
  limits.trust_last_step = true;
  limits.max_iterations = 1;
  const Minimum cut_short = minimise(std::ref(bowl), some_pose(2), limits);
  EXPECT_FALSE(cut_short.converged);
  EXPECT_EQ(bowl.asked, 2);
}

}  // namespace
}  // namespace understory::internal
