#include "understory/odometry/motion/residual_scale.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>

namespace understory {
namespace {

// Errors of known size in each degree of freedom, of a model that states ten times as much.
ResidualScale after_matches(int count, const Vector6d& sigma, double stated) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  ResidualScale scale;
  for (int i = 0; i < count; ++i) {
    Vector6d residual;
    for (int k = 0; k < 6; ++k)
      residual[k] = sigma[k] * normal(random);
    scale.add(residual, (stated * sigma).cwiseAbs2());
  }
  return scale;
}

Vector6d sizes() {
  Vector6d sigma;
  sigma << 1e-4, 2e-4, 3e-4, 1e-3, 2e-3, 4e-3;
  return sigma;
}

TEST(ResidualScale, FindsTheSizeOfTheErrorsInEachDegreeOfFreedom) {
  const ResidualScale scale = after_matches(400, sizes(), 10.0);
  const Matrix6d stated = (10.0 * sizes()).cwiseAbs2().asDiagonal();
  const Vector6d found = scale.scaled(stated).diagonal().cwiseSqrt().cwiseQuotient(sizes());
  // All have the same margin over the residuals' own size.
  for (int k = 0; k < 6; ++k) {
    EXPECT_GT(found[k], 1.1);
    EXPECT_LT(found[k], 1.6);
  }
}

TEST(ResidualScale, KeepsCorrelations) {
  Matrix6d stated = Matrix6d::Identity();
  stated(0, 4) = stated(4, 0) = 0.5;
  const Matrix6d scaled = after_matches(100, sizes(), 3.0).scaled(stated);
  EXPECT_NEAR(scaled(0, 4) / std::sqrt(scaled(0, 0) * scaled(4, 4)), 0.5, 1e-12);
  EXPECT_LT(scaled(0, 0), 0.5);
}

TEST(ResidualScale, LeavesACovarianceAsItIsWhileFewMatchesAreKnown) {
  const Matrix6d stated = Matrix6d::Identity();
  EXPECT_EQ(after_matches(5, sizes(), 10.0).scaled(stated), stated);
}

// An IMU or lidar that gets worse is told within some ten seconds.
TEST(ResidualScale, ForgetsWhatWasLongAgo) {
  ResidualScale scale = after_matches(1000, sizes(), 10.0);
  const Matrix6d stated = Matrix6d::Identity();
  const double before = scale.scaled(stated)(0, 0);
  for (int i = 0; i < 200; ++i)
    scale.add(Vector6d::Constant(1.0), Vector6d::Ones());
  EXPECT_GT(scale.scaled(stated)(0, 0), 25.0 * before);
}

TEST(ResidualScale, IsTheSameAfterACheckpoint) {
  const ResidualScale scale = after_matches(50, sizes(), 10.0);
  BinaryWriter writer;
  scale.save(writer);
  ResidualScale loaded;
  BinaryReader reader(writer.bytes(), "test");
  loaded.load(reader);
  const Matrix6d stated = Matrix6d::Identity();
  EXPECT_EQ(loaded.scaled(stated), scale.scaled(stated));
  EXPECT_TRUE(reader.at_end());
}

}  // namespace
}  // namespace understory
