#include "understory/georeference/satellites/satellite_smoothing.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "understory/georeference/satellites/test_mast.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;
using test::kPlace;

const Vector3d kShortArm(0.1, 0.0, 0.4);
const Pose kBodyFromImu(so3_exp({0.2, -0.1, 0.7}), Vector3d(0.05, 0.1, -0.2));

// East, north, up of the body on a walk of two minutes, at any time.
Pose true_pose(double t) {
  const Vector3d place(20.0 * std::sin(0.1 * t), 15.0 * std::sin(0.07 * t),
                       0.5 * std::sin(0.2 * t));
  return Pose(so3_exp({0.1 * std::sin(0.9 * t), 0.1 * std::cos(0.7 * t), 0.0}) *
                  so3_exp({0.0, 0.0, 0.1 * t}),
              place);
}

// What an IMU on it measures, by differences of the exact motion.
std::vector<ImuSample> measured(double until_s, const Vector3d& accel_bias) {
  std::vector<ImuSample> samples;
  constexpr double kStep = 1e-3;
  for (double t = 0.0; t <= until_s; t += 0.005) {
    const Pose now = true_pose(t) * kBodyFromImu;
    const Pose before = true_pose(t - kStep) * kBodyFromImu;
    const Pose after = true_pose(t + kStep) * kBodyFromImu;
    ImuSample sample;
    sample.stamp = from_seconds(t);
    sample.angular_rate = so3_log(before.rotation().conjugate() * after.rotation()) / (2.0 * kStep);
    const Vector3d acceleration =
        (after.translation() - 2.0 * now.translation() + before.translation()) / (kStep * kStep);
    // Normal gravity at 61.2 degrees by Somigliana's closed form.
    const double s = std::pow(std::sin(61.2 * M_PI / 180.0), 2.0);
    const double gravity =
        9.7803253359 * (1.0 + 0.00193185265 * s) / std::sqrt(1.0 - 0.00669437999 * s);
    sample.specific_force =
        now.rotation().conjugate() * (acceleration + Vector3d(0.0, 0.0, gravity)) + accel_bias;
    samples.push_back(sample);
  }
  return samples;
}

// A path in a world that is turned and tilted against east, north, up.
Pose enu_from_tilted_world() {
  return Pose(so3_exp({0.02, -0.03, 1.9}), Vector3d(3.0, -2.0, 5.0));
}

std::vector<StampedPose> path() {
  std::vector<StampedPose> poses;
  for (int k = 0; k < 1150; ++k)
    poses.push_back({from_seconds(0.1 * k + 1.0),
                     enu_from_tilted_world().inverse() * true_pose(0.1 * k + 1.0)});
  return poses;
}

std::vector<GnssFix> fixes_with_noise(double sd_m) {
  Random random(3);
  const EastNorthUp frame(kPlace);
  std::vector<GnssFix> fixes;
  for (int k = 2; k < 115; ++k) {
    const Vector3d noise(random.normal(0.0, sd_m), random.normal(0.0, sd_m),
                         random.normal(0.0, 3.0 * sd_m));
    const GeodeticPlace place = frame.to_place(true_pose(k) * kShortArm + noise);
    GnssFix fix;
    fix.stamp = from_seconds(k);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fix.covariance = Vector3d(sd_m * sd_m, sd_m * sd_m, 9.0 * sd_m * sd_m).asDiagonal();
    fixes.push_back(fix);
  }
  return fixes;
}

SatelliteSmoothingConfig usual_smoothing() {
  SatelliteSmoothingConfig config;
  config.pairing.antenna_in_body = kShortArm;
  config.body_from_imu = kBodyFromImu;
  config.correlation_s = 0.5;
  config.overconfidence = 1.0;
  return config;
}

// Positions and samples without errors give the true poses, from a start that is 10 degrees off.
TEST(SatelliteSmoothing, GivesTheTruePosesFromAWrongStart) {
  const auto fixes = fixes_with_noise(0.01);
  const Vector3d origin = EastNorthUp(kPlace).from_place(
      {fixes[0].latitude_deg, fixes[0].longitude_deg, fixes[0].height_m});
  const Pose wrong = Pose(so3_exp({0.05, 0.05, 0.17}), -origin) * enu_from_tilted_world();
  const auto smoothed = smooth_satellites(
      path(), fixes, measured(120.0, Vector3d(0.03, -0.02, 0.05)), wrong, usual_smoothing());
  ASSERT_GT(smoothed.size(), 100U);
  for (std::size_t k = 5; k + 5 < smoothed.size(); ++k) {
    const Pose truth = true_pose(to_seconds(smoothed[k].stamp));
    const Pose placed(smoothed[k].enu_from_body.rotation(),
                      smoothed[k].enu_from_body.translation() + origin);
    EXPECT_LT((placed.translation() - truth.translation()).norm(), 0.1)
        << k;  // heights err by 3 cm
    // Up is that of gravity; only accelerations of 0.2 m/s^2 tell the heading.
    const Vector3d up = truth.rotation().conjugate() * Vector3d::UnitZ();
    EXPECT_LT((placed.rotation() * up - Vector3d::UnitZ()).norm(), 0.01) << k;
    EXPECT_LT((placed.inverse() * truth).angle(), 0.08) << k;
    EXPECT_LT(smoothed[k].covariance(0, 0), 1e-3);
  }
}

// Fixes that err by metres are smoothed, and up is that of gravity. The fit in six degrees of
// freedom takes the tilt of the run from it.
TEST(SatelliteSmoothing, TheTiltOfARunComesFromGravity) {
  const auto fixes = fixes_with_noise(2.0);
  const auto samples = measured(120.0, Vector3d(0.02, 0.02, 0.0));
  SatelliteFitConfig config;
  config.pairing.antenna_in_body = kShortArm;
  const SatelliteFit split = fit_to_satellites(path(), fixes, SatelliteMethod::kSplit, config);
  ASSERT_TRUE(split.found);
  const auto smoothed =
      smooth_satellites(path(), fixes, samples, split.enu_from_world, usual_smoothing());
  const SatelliteFit six =
      fit_to_satellites(path(), fixes, SatelliteMethod::kFit6, config, smoothed);
  ASSERT_TRUE(six.found) << six.reason;
  const auto tilt_error = [](const SatelliteFit& fit) {
    const Vector3d up = fit.enu_from_world.rotation() * Vector3d::UnitZ();
    return std::acos(std::min(1.0, up.dot(enu_from_tilted_world().rotation() * Vector3d::UnitZ())));
  };
  EXPECT_LT(tilt_error(six), 0.005);
  EXPECT_GT(tilt_error(split), 0.02);  // which believes that the run is level
}

TEST(SatelliteSmoothing, NothingWithoutSamples) {
  EXPECT_TRUE(smooth_satellites(path(), fixes_with_noise(1.0), {}, enu_from_tilted_world(),
                                usual_smoothing())
                  .empty());
  EXPECT_TRUE(smooth_satellites(path(), {}, measured(5.0, Vector3d::Zero()),
                                enu_from_tilted_world(), usual_smoothing())
                  .empty());
}

}  // namespace
}  // namespace understory
