// --profile paper is P4 section 3.1: each value as the thesis prints it.
#include <gtest/gtest.h>

#include <numbers>

#include "understory/odometry/motion/motion_model.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/util/time.h"

namespace understory {
namespace {

DenseMappingConfig paper() {
  return read_dense_mapping_config("paper", "", {}).config;
}

TEST(PaperProfile, LidarFactorIsEquation36WithItsParameters) {
  const LidarNoiseConfig config = paper().odometry.motion.lidar;
  LidarFactor factor;
  factor.information = 1e9 * Matrix6d::Identity();  // is not asked
  for (const double fitness : {0.0, 0.3, 0.5, 1.3}) {
    factor.fitness_m2 = fitness;
    double sigma = 0.01;                                                        // rad and m
    if (fitness > 0.3) sigma *= 1.0 + 2.0 * (fitness - 0.3) * (fitness - 0.3);  // tau, theta_smsc
    const Matrix6d expected = sigma * sigma * Matrix6d::Identity();
    EXPECT_TRUE(lidar_covariance(factor, config).isApprox(expected, 1e-12)) << fitness;
  }
}

TEST(PaperProfile, ScansAreThinnedByVoxelMeansAndKeyframesAreNot) {
  const DenseMappingConfig config = paper();
  EXPECT_EQ(config.odometry.voxel.voxel_size_m, 0.4);
  EXPECT_EQ(config.odometry.voxel.point, VoxelPoint::kMean);
  EXPECT_EQ(config.keyframe_map.keyframe.voxel_size_m, 0.0);
  EXPECT_EQ(config.keyframe_thin_m, 0.0);
}

TEST(PaperProfile, KeyframesByEquation37) {
  const KeyframeConfig config = paper().keyframe_map.keyframe;
  EXPECT_EQ(config.distance_m, 0.2);
  const Pose turned(so3_exp({0.0, std::numbers::pi / 9.0, 0.0}), Eigen::Vector3d::Zero());
  EXPECT_NEAR(keyframe_distance(Pose(), turned, config), 1.0, 1e-12);  // 20 degrees as 1 m
}

TEST(PaperProfile, LocalMapOfFifteenKeyframesInCubesOfTwoMetres) {
  const LocalMapConfig config = paper().keyframe_map.local_map;
  EXPECT_EQ(config.method, LocalMapConfig::Method::kRecent);
  EXPECT_EQ(config.recent_keyframes, 15);
  EXPECT_EQ(config.recent_spacing_m, 2.0);
}

TEST(PaperProfile, LoopsByEquation38AndItsThreeSteps) {
  const LoopCloserConfig config = paper().keyframe_map.loop_closure;
  EXPECT_TRUE(config.enabled);
  EXPECT_EQ(config.search.method, LoopSearchConfig::Method::kPaper);  // all three steps
  EXPECT_EQ(config.search.exclude_recent, 40);
  EXPECT_EQ(config.search.interval_s, 1.5);
  EXPECT_EQ(config.search.gate_m, 5.0);
  EXPECT_EQ(config.voxel_size_m, 0.4);  // a candidate's scan is thinned as any that is registered
  EXPECT_EQ(config.verification.max_fitness_m2, 0.3);
  EXPECT_EQ(config.min_correction_m, 0.0);
  EXPECT_EQ(config.min_correction_deg, 0.0);
  EXPECT_FALSE(config.graph.robust_loops);
  EXPECT_FALSE(config.graph.check_consistency);
}

TEST(PaperProfile, EdgesOfTheMapGraphHaveTheNoiseOfEquation36) {
  const KeyframeMap::Config config = paper().keyframe_map;
  const double degree = std::numbers::pi / 180.0;
  EXPECT_NEAR(config.edge_rotation_deg * degree, 0.01, 1e-15);
  EXPECT_EQ(config.edge_translation_m, 0.01);
  EXPECT_LE(config.edge_rotation_deg_per_sqrt_m, 1e-6);
  EXPECT_LE(config.edge_translation_m_per_sqrt_m, 1e-6);
  const LoopClosureConfig& loop = config.loop_closure.verification;
  EXPECT_NEAR(loop.sigma_rotation_deg * degree, 0.01, 1e-15);
  EXPECT_EQ(loop.sigma_translation_m, 0.01);
}

TEST(PaperProfile, WhatIsNotThePapersIsOff) {
  const DenseMappingConfig config = paper();
  EXPECT_EQ(config.odometry.isolated.within_m, 0.0);
  EXPECT_EQ(config.odometry.carried.reach_m, 0.0);
  EXPECT_EQ(config.odometry.motion.velocity_gate_m_s, 0.0);
  EXPECT_EQ(config.odometry.motion.angular_gate_deg_s, 0.0);
  EXPECT_EQ(config.keyframe_map.local_map.matcher.get<NdtMatcherConfig>().cells.near_side_line,
            0.0);
  EXPECT_EQ(config.keyframe_map.local_map.matcher.get<NdtMatcherConfig>().cells.near_side_volume,
            0.0);
  EXPECT_FALSE(config.keyframe_map.first_keyframes.enabled);
}

}  // namespace
}  // namespace understory
