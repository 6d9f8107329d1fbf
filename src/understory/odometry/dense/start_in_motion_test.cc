#include "understory/odometry/dense/start_in_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/util/time.h"

namespace understory {
namespace {

// A turn of 0.1 s from `from_s` on, or a part of it at its end.
Scan scan_from(double from_s, double share = 1.0, bool has_times = true) {
  Scan scan;
  scan.stamp = from_seconds(from_s);
  scan.has_point_times = has_times;
  for (int i = 0; i < 360; ++i) {
    const double at = i / 360.0;
    if (at >= share) break;
    ScanPoint point;
    const double azimuth = 2.0 * std::numbers::pi * at;
    point.x = static_cast<float>(5.0 * std::cos(azimuth));
    point.y = static_cast<float>(5.0 * std::sin(azimuth));
    if (has_times) point.t_ns = static_cast<std::uint32_t>(1e8 * at);
    scan.points.push_back(point);
  }
  return scan;
}

TEST(StartInMotion, AFirstScanThatIsShorterIsAPartOfATurn) {
  EXPECT_TRUE(is_part_of_turn(scan_from(0.06, 0.4), scan_from(0.1)));
  EXPECT_FALSE(is_part_of_turn(scan_from(0.0), scan_from(0.1)));
  // Short, but no part: the next one comes a whole turn later.
  EXPECT_FALSE(is_part_of_turn(scan_from(0.0, 0.4), scan_from(0.1)));
  // Without times of points what it sees around it decides.
  EXPECT_TRUE(is_part_of_turn(scan_from(0.0, 0.5, false), scan_from(0.1, 1.0, false)));
  EXPECT_FALSE(is_part_of_turn(scan_from(0.0, 0.9, false), scan_from(0.1, 1.0, false)));
}

// The motion that led from one scan to the next is what is assumed, in the frame of the first.
TEST(StartInMotion, TheSecondScanTellsTheSpeedAtTheFirst) {
  const Vector6d screw = (Vector6d() << 0.0, 0.1, 0.5, 1.5, -0.4, 0.05).finished();
  const Pose first(so3_exp({0.3, 0.2, 1.0}), {4.0, 5.0, 6.0});
  const Pose second = first * Pose::exp(0.1 * screw);
  const auto better = better_start(scan_from(7.0), scan_from(7.1), first, second, {}, false);
  ASSERT_TRUE(better);
  EXPECT_LT((better->velocity_m_s - screw.tail<3>()).norm(), 1e-9);
  EXPECT_LT((better->angular_rate_rad_s - screw.head<3>()).norm(), 1e-9);
  // Once it is assumed there is nothing to do again.
  EXPECT_FALSE(better_start(scan_from(7.0), scan_from(7.1), first, second, *better, false));
}

TEST(StartInMotion, TurningThatAnImuTellsStays) {
  const Vector6d screw = (Vector6d() << 0.0, 0.0, 0.5, 1.5, 0.0, 0.0).finished();
  AssumedMotion assumed;
  assumed.angular_rate_rad_s = {0.0, 0.0, 0.3};
  const auto better =
      better_start(scan_from(7.0), scan_from(7.1), {}, Pose::exp(0.1 * screw), assumed, true);
  ASSERT_TRUE(better);
  EXPECT_EQ(better->angular_rate_rad_s, assumed.angular_rate_rad_s);
}

TEST(StartInMotion, ScansFarApartAndSmallSmearsTellNothing) {
  const auto moved_by = [](double metres) { return Pose(so3_exp({0, 0, 0}), {metres, 0.0, 0.0}); };
  EXPECT_FALSE(better_start(scan_from(7.0), scan_from(7.6), {}, moved_by(1.0), {}, false));
  EXPECT_FALSE(better_start(scan_from(7.0), scan_from(7.0), {}, moved_by(1.0), {}, false));
  // During a scan of 0.1 s: 4 mm and 6 mm.
  EXPECT_FALSE(better_start(scan_from(7.0), scan_from(7.1), {}, moved_by(0.004), {}, false));
  EXPECT_TRUE(better_start(scan_from(7.0), scan_from(7.1), {}, moved_by(0.006), {}, false));
}

}  // namespace
}  // namespace understory
