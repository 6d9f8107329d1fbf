#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/odometry/motion/motion_model.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// P4 (36) with its parameters in the paper.
TEST(LidarCovariance, GrowsWithTheFitnessAsThePaperSays) {
  LidarNoiseConfig config;
  config.source = LidarNoise::kFitness;
  config.sigma_translation_m = 0.01;
  config.sigma_rotation_deg = 0.01 / kDegree;
  config.fitness_threshold_m2 = 0.3;
  config.fitness_scale = 2.0;
  LidarFactor factor;
  factor.fitness_m2 = 0.3;
  EXPECT_NEAR(std::sqrt(lidar_covariance(factor, config)(4, 4)), 0.01, 1e-12);
  EXPECT_NEAR(std::sqrt(lidar_covariance(factor, config)(0, 0)), 0.01, 1e-12);
  factor.fitness_m2 = 1.3;
  EXPECT_NEAR(std::sqrt(lidar_covariance(factor, config)(4, 4)), (1.0 + 2.0) * 0.01, 1e-12);
}

TEST(LidarCovariance, WeakDirectionsStayWeak) {
  LidarFactor factor;
  factor.information.diagonal() << 1e8, 1e8, 1e8, 1e7, 1e7, 0.0;
  const Matrix6d covariance = lidar_covariance(factor, {});
  EXPECT_GT(covariance(5, 5), 1e5);
  EXPECT_LT(covariance(4, 4), 3e-4);
}

}  // namespace
}  // namespace understory
