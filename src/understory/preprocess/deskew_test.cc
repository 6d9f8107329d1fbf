#include "understory/preprocess/deskew.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr TimeNs kStart = 1'700'000'000'000'000'000;

// A body that turns and moves at constant rates in its own frame: exactly what (34) interpolates.
Pose body_at(double seconds) {
  Vector6d twist;
  twist << 0.4, -0.3, 1.5, 2.0, -0.5, 0.2;
  const Pose start(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())),
      Eigen::Vector3d(10, 20, 3));
  return start * Pose::exp(seconds * twist);
}

std::vector<StampedPose> poses(double from_s, double to_s, double step_s) {
  std::vector<StampedPose> track;
  for (double s = from_s; s < to_s + 0.5 * step_s; s += step_s)
    track.push_back({kStart + static_cast<TimeNs>(std::llround(s * 1e9)), body_at(s)});
  return track;
}

struct Measured {
  Rig rig;
  Scan scan;
  std::vector<Eigen::Vector3d> in_world;
};

// Points fixed in the world, each measured at its own time through a tilted, shifted lidar.
Measured measure(std::size_t n) {
  Measured m;
  m.rig.body_from_lidar =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(0, 1, 0.2).normalized())),
           Eigen::Vector3d(0.3, -0.1, 0.5));
  m.scan.stamp = kStart;
  Random random(3);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d world(random.uniform(-30, 50), random.uniform(-20, 60),
                                random.uniform(0, 10));
    const auto t = static_cast<std::uint32_t>(random.below(100'000'000));
    const Eigen::Vector3d p = (body_at(t * 1e-9) * m.rig.body_from_lidar).inverse() * world;
    ScanPoint point;
    point.x = static_cast<float>(p.x());
    point.y = static_cast<float>(p.y());
    point.z = static_cast<float>(p.z());
    point.t_ns = t;
    point.ring = static_cast<std::uint16_t>(i % 128);
    point.intensity = static_cast<float>(i);
    m.scan.points.push_back(point);
    m.in_world.push_back(world);
  }
  return m;
}

double worst_error(const Measured& m, const DeskewResult& result) {
  double worst = 0.0;
  for (std::size_t i = 0; i < m.in_world.size(); ++i) {
    const Eigen::Vector3d expected = body_at(0.0).inverse() * m.in_world[i];
    worst = std::max(worst, (result.cloud.points[i].cast<double>() - expected).norm());
  }
  return worst;
}

// (35) as the errata order it: world points come out at one place whenever they were measured.
TEST(Deskew, PutsPointsWhereTheyAreInTheBodyAtTheStampOfTheScan) {
  const Measured m = measure(5000);
  const DeskewResult result = deskew(m.scan, m.rig, poses(-0.01, 0.11, 0.01));
  ASSERT_TRUE(result.deskewed);
  EXPECT_EQ(result.extrapolated, 0U);
  ASSERT_EQ(result.cloud.size(), m.scan.points.size());
  EXPECT_LT(worst_error(m, result), 2.5e-3);  // half a time step at 1.6 rad/s and 70 m
  EXPECT_EQ(result.cloud.stamp, kStart);
  EXPECT_EQ(result.cloud.ring[200], 200 % 128);
  EXPECT_EQ(result.cloud.intensity[77], 77.0F);
  const ScanPoint& p = m.scan.points[5];
  EXPECT_NEAR(result.cloud.range[5], std::hypot(p.x, p.y, p.z), 1e-4);
}

TEST(Deskew, FinerTimeStepsAreExact) {
  const Measured m = measure(500);
  DeskewConfig config;
  config.time_step_ns = 1000;
  EXPECT_LT(worst_error(m, deskew(m.scan, m.rig, poses(0.0, 0.1, 0.005), {}, config)), 2e-4);
}

TEST(Deskew, WithoutMotionCorrectionTheErrorIsLarge) {
  const Measured m = measure(500);
  const DeskewResult result = deskew(m.scan, m.rig, {});
  EXPECT_FALSE(result.deskewed);
  EXPECT_GT(worst_error(m, result), 1.0);
}

TEST(Deskew, CountsPointsBeyondThePosesAndContinuesTheMotionShortly) {
  const Measured m = measure(2000);
  const DeskewResult result = deskew(m.scan, m.rig, poses(0.0, 0.09, 0.01));
  EXPECT_GT(result.extrapolated, 100U);
  EXPECT_LT(worst_error(m, result), 2.5e-3);
}

TEST(Deskew, LeavesOutWhatIsNotKept) {
  const Measured m = measure(100);
  std::vector<std::uint8_t> keep(100, 0);
  keep[7] = keep[93] = 1;
  const DeskewResult result = deskew(m.scan, m.rig, poses(0.0, 0.1, 0.01), keep);
  ASSERT_EQ(result.cloud.size(), 2U);
  EXPECT_EQ(result.cloud.intensity[1], 93.0F);
}

TEST(Deskew, WithoutPointTimesOnlyMovesIntoTheBody) {
  Measured m = measure(10);
  m.scan.has_point_times = false;
  const DeskewResult result = deskew(m.scan, m.rig, poses(0.0, 0.1, 0.01));
  EXPECT_FALSE(result.deskewed);
  const ScanPoint& p = m.scan.points[3];
  const Eigen::Vector3d expected = m.rig.body_from_lidar * Eigen::Vector3d(p.x, p.y, p.z);
  EXPECT_LT((result.cloud.points[3].cast<double>() - expected).norm(), 1e-4);
}

TEST(Deskew, SameBitsForAnyNumberOfThreads) {
  const Measured m = measure(30'000);
  const auto track = poses(0.0, 0.1, 0.01);
  DeskewResult one;
  DeskewResult three;
  with_threads(1, [&] { one = deskew(m.scan, m.rig, track); });
  with_threads(3, [&] { three = deskew(m.scan, m.rig, track); });
  EXPECT_EQ(one.cloud.points, three.cloud.points);
}

}  // namespace
}  // namespace understory
