#include "understory/graph/self_correction/spread_corrections.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

// Walks along x while the body swings to and fro.
std::vector<StampedPose> swinging_path() {
  std::vector<StampedPose> path;
  for (int i = 0; i < 60; ++i) {
    const double yaw = std::sin(0.4 * i);
    path.push_back({i * kNsPerSecond, Pose(so3_exp({0.01 * std::cos(0.3 * i), 0.0, yaw}),
                                           {0.3 * i, 0.1 * yaw, 0.0})});
  }
  return path;
}

// A correction that grows along the way is found again between the corrected scans, however the
// body swings.
TEST(ScanPath, CorrectionsRunEvenlyAlongThePathUnderASwingingBody) {
  const std::vector<StampedPose> path = swinging_path();
  const auto corrected_at = [&](std::size_t i) {
    const double share = static_cast<double>(i) / 60.0;
    Vector6d bend;
    bend << 0.0, 0.0, 0.05 * share, 0.4 * share, -0.2 * share, 0.1 * share;
    return StampedPose{path[i].stamp, Pose::exp(bend) * path[i].world_from_body};
  };
  const std::vector<StampedPose> corrected = {corrected_at(3), corrected_at(30), corrected_at(50)};
  const std::vector<StampedPose> spread = spread_corrections(path, corrected);
  ASSERT_EQ(spread.size(), path.size());
  for (std::size_t i = 3; i <= 50; ++i) {
    const Pose off = corrected_at(i).world_from_body.inverse() * spread[i].world_from_body;
    EXPECT_LT(off.translation().norm(), 0.02) << i;
    EXPECT_LT(off.angle(), 0.002) << i;
  }
  // Rigidly before and after: steps stay what they were.
  for (const std::size_t i : {std::size_t{0}, std::size_t{55}}) {
    const Pose step = path[i].world_from_body.inverse() * path[i + 1].world_from_body;
    const Pose moved = spread[i].world_from_body.inverse() * spread[i + 1].world_from_body;
    EXPECT_LT((step.inverse() * moved).log().norm(), 1e-9);
  }
}

TEST(ScanPath, IsThePathItselfWithoutCorrections) {
  const std::vector<StampedPose> path = swinging_path();
  const std::vector<StampedPose> spread = spread_corrections(path, {});
  ASSERT_EQ(spread.size(), path.size());
  EXPECT_EQ(spread[7].world_from_body.translation(), path[7].world_from_body.translation());
}

}  // namespace
}  // namespace understory
