#include "understory/forest/stems/standing_direction.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

// Sixty stems of 15 m on flat ground of 40 x 40 m, then all of it turned.
std::vector<Vector3d> turned_stand(const Eigen::Quaterniond& turn) {
  Random random(1);
  std::vector<Vector3d> points;
  for (int i = 0; i < 6400; ++i)
    points.emplace_back(random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.0);
  for (int stem = 0; stem < 60; ++stem) {
    const double x = random.uniform(-18.0, 18.0);
    const double y = random.uniform(-18.0, 18.0);
    for (int i = 0; i < 150; ++i) {
      const double around = random.uniform(0.0, 2.0 * M_PI);
      points.emplace_back(x + 0.15 * std::cos(around), y + 0.15 * std::sin(around), 0.1 * i);
    }
  }
  for (Vector3d& point : points)
    point = turn * point;
  return points;
}

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * 180.0 / M_PI;
}

TEST(StandingDirection, UprightStemsStandAlongZ) {
  const auto found = standing_direction(turned_stand(Eigen::Quaterniond::Identity()), {0.0, 0.0});
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(angle_deg(found->axis, Vector3d::UnitZ()), 3.0);
  EXPECT_GT(found->gain_of_z, 2.0);
}

// A scanner that was tilted by 30 degrees: the ground is a plane of that slope.
TEST(StandingDirection, ATiltedStandTellsWhereUpIs) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(30.0 * M_PI / 180.0, Vector3d::UnitX()));
  const Vector3d up = turn * Vector3d::UnitZ();
  const auto found = standing_direction(turned_stand(turn), -up.head<2>() / up.z());
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(angle_deg(found->axis, up), 3.0);
  EXPECT_GT(found->gain, 1.5 * found->gain_of_z);
}

TEST(StandingDirection, TooFewPointsTellNothing) {
  std::vector<Vector3d> points = turned_stand(Eigen::Quaterniond::Identity());
  points.resize(6500);  // the ground and a part of one stem
  EXPECT_FALSE(standing_direction(points, {0.0, 0.0}).has_value());
  EXPECT_FALSE(standing_direction({}, {0.0, 0.0}).has_value());
}

}  // namespace
}  // namespace understory
