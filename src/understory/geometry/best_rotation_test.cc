#include "understory/geometry/best_rotation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

namespace understory {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d products_of(const std::vector<Vector3d>& target, const std::vector<Vector3d>& source) {
  Matrix3d products = Matrix3d::Zero();
  for (std::size_t k = 0; k < source.size(); ++k)
    products += target[k] * source[k].transpose();
  return products;
}

std::vector<Vector3d> turned(const Matrix3d& rotation, const std::vector<Vector3d>& points) {
  std::vector<Vector3d> result;
  for (const Vector3d& point : points)
    result.emplace_back(rotation * point);
  return result;
}

TEST(BestRotation, FindsTheTurnBetweenTwoSetsOfPoints) {
  const Matrix3d truth =
      Eigen::AngleAxisd(2.5, Vector3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  const std::vector<Vector3d> source = {{3, 0, 0}, {-3, 0, 0}, {0, 2, 0}, {0, -2, 0}, {0, 0, 1}};
  const BestRotation best = best_rotation(products_of(turned(truth, source), source));
  EXPECT_LT((best.rotation - truth).norm(), 1e-12);
  EXPECT_NEAR(best.extents(0), 18.0, 1e-12);
  EXPECT_NEAR(best.extents(1), 8.0, 1e-12);
  EXPECT_NEAR(best.extents(2), 1.0, 1e-12);
}

TEST(BestRotation, NeverMirrors) {
  // Points of a plane fit a mirror image as well; and here the mirror fits better than any turn.
  const Matrix3d mirror = Vector3d(1.0, 1.0, -1.0).asDiagonal();
  const std::vector<Vector3d> source = {{3, 0, 0}, {-3, 0, 0}, {0, 2, 0}, {0, -2, 0}, {0, 0, 1}};
  const BestRotation best = best_rotation(products_of(turned(mirror, source), source));
  EXPECT_NEAR(best.rotation.determinant(), 1.0, 1e-12);
  EXPECT_LT((best.rotation - Matrix3d::Identity()).norm(), 1e-12) << "the least that is lost";
}

TEST(BestRotation, OfPointsOnALineTellsThatOneAxisIsOpen) {
  const std::vector<Vector3d> source = {{3, 0, 0}, {-3, 0, 0}};
  const BestRotation best = best_rotation(products_of(source, source));
  EXPECT_GT(best.extents(0), 1.0);
  EXPECT_LT(best.extents(1), 1e-12);
  EXPECT_NEAR(best.rotation.determinant(), 1.0, 1e-12);
}

}  // namespace
}  // namespace understory
