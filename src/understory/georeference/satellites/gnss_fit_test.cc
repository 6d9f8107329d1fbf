#include "understory/georeference/satellites/gnss_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"
#include "understory/util/time.h"

namespace understory {
namespace {

using Eigen::Vector3d;

const GeodeticPlace kDrivePlace{62.5, 30.2, 140.0};
const Vector3d kAntenna(0.3, -0.2, 1.5);  // in the body frame

// The world of a run in the frame east, north, up at kDrivePlace.
Pose enu_from_drive() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(2.2, Vector3d::UnitZ())), {0.0, 0.0, 0.0}};
}

// A pose a second, a metre apart: along x, with a bend where asked.
std::vector<StampedPose> drive(bool bends) {
  std::vector<StampedPose> poses;
  for (int k = 0; k < 120; ++k) {
    const double y = bends ? 15.0 * std::sin(k / 20.0) : 0.0;
    poses.push_back(
        {from_seconds(100.0 + k), Pose(Eigen::Quaterniond::Identity(), {1.0 * k, y, 2.0})});
  }
  return poses;
}

// What a receiver on it says, a centimetre off; `late_s`: by its clock.
std::vector<GnssFix> fixes_on_drive(const std::vector<StampedPose>& poses, double late_s = 0.0) {
  const EastNorthUp frame(kDrivePlace);
  Random random(6);
  std::vector<GnssFix> fixes;
  for (const StampedPose& pose : poses) {
    const Vector3d noise(0.01 * random.normal(), 0.01 * random.normal(), 0.01 * random.normal());
    const GeodeticPlace place =
        frame.to_place(enu_from_drive() * (pose.world_from_body * kAntenna) + noise);
    GnssFix fix;
    fix.stamp = pose.stamp + from_seconds(late_s);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fixes.push_back(fix);
  }
  return fixes;
}

// East, north, up of a point of the path by the fit, in the frame of kDrivePlace.
Vector3d enu_of_point(const GnssFit& fit, const Vector3d& point_in_world) {
  return EastNorthUp(kDrivePlace)
      .from_place(EastNorthUp(*fit.origin).to_place(fit.enu_from_world * point_in_world));
}

TEST(GnssFit, LaysAPathOnItsFixes) {
  const auto poses = drive(true);
  const GnssFit fit = fit_to_gnss(poses, kAntenna, fixes_on_drive(poses), {});
  ASSERT_TRUE(fit.path.found) << fit.path.reason;
  EXPECT_NEAR(yaw_of(fit.enu_from_world), 2.2, 1e-3);
  for (const Vector3d& point : {Vector3d(0.0, 0.0, 2.0), Vector3d(119.0, 4.0, 2.0)})
    EXPECT_LT((enu_of_point(fit, point) - enu_from_drive() * point).norm(), 0.05);
  ASSERT_EQ(fit.fixes.size(), poses.size());
  EXPECT_EQ(fit.fixes_in_time, poses.size());
  for (const FittedFix& fitted : fit.fixes) {
    EXPECT_TRUE(fitted.used);
    EXPECT_LT(fitted.residual.norm(), 0.1);
  }
}

// A receiver that is two seconds behind lies off along the way, and hardly across it.
TEST(GnssFit, ALateClockIsAnErrorAlongTheWay) {
  const auto poses = drive(true);
  const GnssFit fit = fit_to_gnss(poses, kAntenna, fixes_on_drive(poses, 2.0), {});
  ASSERT_TRUE(fit.path.found);
  EXPECT_NEAR(fit.along_rms_m, 2.3, 0.5);  // two seconds at 1 to 1.25 m/s
  EXPECT_LT(fit.across_rms_m, 0.5);
}

// A straight path fits the other way round as well: the clocks tell, or nothing does.
TEST(GnssFit, TheClocksTellWhichWayAStraightPathWent) {
  const auto poses = drive(false);
  const GnssFit fit = fit_to_gnss(poses, kAntenna, fixes_on_drive(poses), {});
  ASSERT_TRUE(fit.path.found);
  EXPECT_FALSE(fit.ambiguous);
  EXPECT_NEAR(yaw_of(fit.enu_from_world), 2.2, 0.01);
  const GnssFit timeless = fit_to_gnss(poses, kAntenna, fixes_on_drive(poses, 1e6), {});
  ASSERT_TRUE(timeless.path.found);
  EXPECT_TRUE(timeless.ambiguous);
  EXPECT_EQ(timeless.fixes_in_time, 0U);
}

TEST(GnssFit, NoFixesAndNoHeights) {
  const auto poses = drive(true);
  EXPECT_FALSE(fit_to_gnss(poses, kAntenna, {}, {}).path.found);
  std::vector<GnssFix> flat = fixes_on_drive(poses);
  for (GnssFix& fix : flat)
    fix.height_m = std::nan("");
  const GnssFit fit = fit_to_gnss(poses, kAntenna, flat, {});
  ASSERT_TRUE(fit.path.found);
  EXPECT_TRUE(std::isnan(fit.fixes.front().position_in_enu.z()));
  EXPECT_EQ(fit.enu_from_world.translation().z(), 0.0);
}

}  // namespace
}  // namespace understory
