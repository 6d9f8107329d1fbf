#include "understory/geometry/rotation_between.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace understory {
namespace {

Eigen::Vector3d any_vector(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}

TEST(RotationBetween, TurnsOneDirectionIntoTheOtherByTheSmallestAngle) {
  std::mt19937 random(5);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d from = any_vector(random);
    const Eigen::Vector3d to = 40.0 * any_vector(random);
    const Eigen::Quaterniond rotation = rotation_between(from, to);
    EXPECT_NEAR(rotation.norm(), 1.0, 1e-12);
    EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(), 1e-12);
    const double angle = std::atan2(from.cross(to).norm(), from.dot(to));
    EXPECT_NEAR(2.0 * std::atan2(rotation.vec().norm(), rotation.w()), angle, 1e-7);
  }
}

TEST(RotationBetween, TurnsIntoTheOppositeAndIntoWhatIsNearIt) {
  std::mt19937 random(6);
  for (const double off : {0.0, 1e-9, 1e-7, 1e-6, 1e-3}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d from = any_vector(random).normalized();
      const Eigen::Vector3d to = -from + off * from.unitOrthogonal();
      const Eigen::Quaterniond rotation = rotation_between(from, to);
      EXPECT_NEAR(rotation.norm(), 1.0, 1e-8);
      EXPECT_LT((rotation * from - to.normalized()).norm(), 1e-8) << off;
      EXPECT_NEAR(2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w())),
                  std::numbers::pi - off, 1.5e-6);
    }
  }
}

TEST(RotationBetween, TurnsEachAxisIntoItsOpposite) {
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d from = Eigen::Vector3d::Unit(axis);
    EXPECT_LT((rotation_between(from, -from) * from + from).norm(), 1e-12);
  }
}

TEST(RotationBetween, IsNoRotationForEqualDirections) {
  const Eigen::Vector3d up(0.1, -0.2, 0.9);
  EXPECT_LT(rotation_between(up, 3.0 * up).vec().norm(), 1e-12);
}

}  // namespace
}  // namespace understory
