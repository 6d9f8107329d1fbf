#include "understory/registration/range_offset/range_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/registration/test_stand.h"
#include "understory/util/random.h"

namespace understory {
namespace {

const Eigen::Vector3d kLidarInBody(0.1, 0.0, 0.2);

// Rings and columns enough for patches, and few enough for a quick test.
const testing::Pattern kDense{48, 360, -45.0, 45.0, 40.0, 0.02};

// Points of a flat square of ground of that edge, metres; one every 10 cm, with noise along z.
Points square(double edge_m, double noise_m) {
  Random random(7);
  Points points;
  for (double x = 0.05; x < edge_m; x += 0.1) {
    for (double y = 0.05; y < edge_m; y += 0.1)
      points.emplace_back(static_cast<float>(x), static_cast<float>(y),
                          static_cast<float>(0.5 + random.normal(0.0, noise_m)));
  }
  return points;
}

SurfaceView view_of(const Points& points) {
  const ViewCloud cloud{&points, Pose()};
  return {{&cloud, 1}, Eigen::Vector3d(2.0, 2.0, 3.0), SurfaceViewConfig()};
}

TEST(SurfaceView, APatchOfGroundLooksAtTheLidar) {
  const Points points = square(4.0, 0.01);
  const SurfaceView view = view_of(points);
  ASSERT_EQ(view.patches().size(), 16U);
  const FlatPatch* patch = view.nearest({0.4, 2.6, 0.5});
  ASSERT_NE(patch, nullptr);
  EXPECT_NEAR((patch->mean - Eigen::Vector3d(0.5, 2.5, 0.5)).norm(), 0.0, 0.01);
  EXPECT_GT(patch->normal.z(), 0.999);
  const Eigen::Vector3d down = (patch->mean - Eigen::Vector3d(2.0, 2.0, 3.0)).normalized();
  EXPECT_NEAR((patch->ray - down).norm(), 0.0, 0.03);
  EXPECT_EQ(view.nearest({10.0, 10.0, 0.5}), nullptr);
}

TEST(SurfaceView, WhatIsThickOrNarrowIsNoPatch) {
  EXPECT_TRUE(view_of(square(4.0, 0.15)).patches().empty());
  Points ring;
  for (float x = 0.0F; x < 4.0F; x += 0.01F)
    ring.emplace_back(x, 0.5F, 0.5F);
  EXPECT_TRUE(view_of(ring).patches().empty());
  EXPECT_TRUE(view_of({}).patches().empty());
}

// A stand of rolling ground, stems and crowns, as lidars see it whose ranges are all too long.
class RangeOffsetInAStand : public ::testing::TestWithParam<double> {
 protected:
  // What is seen from a few places around that one, where the carrier is level.
  static SurfaceView view(const testing::Stand& stand, const Pose& world_from_body,
                          const testing::Pattern& pattern, double offset_m) {
    std::vector<Points> clouds;
    std::vector<Pose> poses;
    const Pose body_from_lidar(Eigen::Quaterniond::Identity(), kLidarInBody);
    for (int i = -2; i <= 2; ++i) {
      const Pose pose = world_from_body * Pose(Eigen::Quaterniond::Identity(), {0.5 * i, 0.0, 0.0});
      poses.push_back(world_from_body.inverse() * pose);
      clouds.push_back(testing::scan_stand(stand, pose * body_from_lidar, pattern,
                                           static_cast<std::uint64_t>(i + 10)));
      for (Eigen::Vector3f& point : clouds.back()) {
        point *= 1.0F + static_cast<float>(offset_m) / point.norm();
        point += kLidarInBody.cast<float>();
      }
    }
    std::vector<ViewCloud> placed;
    for (std::size_t i = 0; i < clouds.size(); ++i)
      placed.push_back({&clouds[i], poses[i]});
    return {placed, kLidarInBody, SurfaceViewConfig()};
  }

  static testing::Stand stand() {
    testing::Stand stand = testing::make_stand(testing::StandOptions(), 5);
    stand.bump_m = 0.3;
    stand.roughness_m = 0.02;
    return stand;
  }
  static Pose place(double x, double turn) {
    return {so3_exp({0.0, 0.0, turn}), Eigen::Vector3d(x, 0.0, 1.8)};
  }
};

TEST_P(RangeOffsetInAStand, IsFoundTogetherWithThePose) {
  const testing::Stand here = stand();
  const Pose a = place(-3.0, 0.0);
  const Pose b = place(3.0, 0.3);
  const SurfaceView target = view(here, a, kDense, GetParam());
  const SurfaceView source = view(here, b, kDense, GetParam());
  Vector6d error;
  error << 0.01, -0.01, 0.01, 0.05, 0.05, -0.05;
  const Pose target_from_source = a.inverse() * b;
  const RangeOffset found = solve_range_offset(
      target, source, kLidarInBody, target_from_source * Pose::exp(error), RangeOffsetConfig());
  ASSERT_TRUE(found.solved);
  EXPECT_NEAR(found.offset_m, GetParam(), 0.05);
  EXPECT_LT(found.sd_m, 0.05);
  EXPECT_GT(found.sd_m, 0.001);
  const Vector6d difference = right_difference(found.target_from_source, target_from_source);
  EXPECT_LT(difference.head<2>().norm(), 0.01) << "tilt";
  EXPECT_LT(std::abs(difference[5]), 0.03) << "height";
}

INSTANTIATE_TEST_SUITE_P(Offsets, RangeOffsetInAStand, ::testing::Values(0.0, 0.05, 1.0, -0.3));

// From one and the same place nothing tells whether ranges are right.
TEST_F(RangeOffsetInAStand, WithoutParallaxIsUnknown) {
  const testing::Stand here = stand();
  const Pose a = place(0.0, 0.0);
  const SurfaceView target = view(here, a, kDense, 1.0);
  const RangeOffset found =
      solve_range_offset(target, target, kLidarInBody, Pose(), RangeOffsetConfig());
  ASSERT_TRUE(found.solved);
  EXPECT_GT(found.sd_m, 1.0);
}

TEST_F(RangeOffsetInAStand, OfViewsThatShareNothingIsNotSolved) {
  const testing::Stand here = stand();
  const SurfaceView target = view(here, place(0.0, 0.0), kDense, 0.0);
  const Pose far(Eigen::Quaterniond::Identity(), Eigen::Vector3d(500.0, 0.0, 0.0));
  EXPECT_FALSE(solve_range_offset(target, target, kLidarInBody, far, RangeOffsetConfig()).solved);
}

}  // namespace
}  // namespace understory
