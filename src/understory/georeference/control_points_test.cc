#include "understory/georeference/control_points.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

Pose survey_from_run() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(-1.3, Vector3d::UnitZ())), {500.0, 900.0, 42.0}};
}

std::vector<ControlPoint> surveyed(int count, double noise_m, std::uint64_t seed) {
  Random random(seed);
  std::vector<ControlPoint> points;
  for (int k = 0; k < count; ++k) {
    ControlPoint point;
    point.name = "P" + std::to_string(k + 1);
    point.place_in_world = {random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0),
                            random.uniform(0.0, 4.0)};
    point.place_in_target = survey_from_run() * point.place_in_world +
                            Vector3d(random.normal(0.0, noise_m), random.normal(0.0, noise_m),
                                     random.normal(0.0, noise_m));
    points.push_back(point);
  }
  return points;
}

double error_of_fit_m(const ControlFit& fit) {
  return (fit.target_from_world * Vector3d(10.0, 20.0, 2.0) -
          survey_from_run() * Vector3d(10.0, 20.0, 2.0))
      .norm();
}

TEST(ControlPoints, LayARunOnASurvey) {
  const ControlFit fit = fit_control_points(surveyed(6, 0.03, 1), {});
  ASSERT_TRUE(fit.found) << fit.reason;
  EXPECT_LT(error_of_fit_m(fit), 0.06);
  EXPECT_EQ(fit.redundant, 14);
  for (const char used : fit.used)
    EXPECT_TRUE(used);
  // Two points are enough for a level run, and nothing is checked then but their distance.
  EXPECT_LT(error_of_fit_m(fit_control_points(surveyed(2, 0.0, 3), {})), 1e-3);
}

TEST(ControlPoints, OneBlunderAmongFourIsFound) {
  for (std::uint64_t seed = 1; seed < 15; ++seed) {
    std::vector<ControlPoint> points = surveyed(4, 0.02, seed);
    const std::size_t wrong = seed % 4;
    points[wrong].place_in_target += Vector3d(1.5, -1.0, 0.0);
    const ControlFit fit = fit_control_points(points, {});
    ASSERT_TRUE(fit.found);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_EQ(fit.used[k] != 0, k != wrong) << seed << " " << k;
    EXPECT_GT(fit.residuals[wrong].norm(), 1.5);
  }
}

// Three points tell that one is wrong, and not which.
TEST(ControlPoints, ThreeThatDisagreeAreNotTrusted) {
  std::vector<ControlPoint> points = surveyed(3, 0.02, 4);
  EXPECT_FALSE(fit_control_points(points, {}).disagree);
  points[1].place_in_target.x() += 4.0;
  EXPECT_TRUE(fit_control_points(points, {}).disagree);
}

TEST(ControlPoints, TheStatedCovarianceHolds) {
  Vector6d squares = Vector6d::Zero();
  constexpr int kDraws = 150;
  for (int draw = 0; draw < kDraws; ++draw) {
    const ControlFit fit = fit_control_points(
        surveyed(6, 0.1, static_cast<std::uint64_t>(100 + draw)), {5.0, 0.1, 2.0});
    const Vector6d error = right_difference(survey_from_run(), fit.target_from_world);
    squares += error.cwiseAbs2().cwiseQuotient(fit.covariance.diagonal()) / kDraws;
  }
  for (int axis = 2; axis < 6; ++axis)
    EXPECT_NEAR(squares(axis), 1.0, 0.4) << axis;
}

TEST(ControlPoints, HeightsMayBeMissingButNotAll) {
  std::vector<ControlPoint> points = surveyed(5, 0.02, 6);
  for (std::size_t k = 1; k < points.size(); ++k)
    points[k].place_in_target.z() = std::nan("");
  EXPECT_LT(error_of_fit_m(fit_control_points(points, {})), 0.3);
  points[0].place_in_target.z() = std::nan("");
  EXPECT_FALSE(fit_control_points(points, {}).found);
  EXPECT_FALSE(fit_control_points({points[0]}, {}).found);
  EXPECT_FALSE(fit_control_points({surveyed(1, 0.0, 1)[0], surveyed(1, 0.0, 1)[0]}, {}).found);
}

}  // namespace
}  // namespace understory
