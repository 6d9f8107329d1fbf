#include "understory/odometry/stems/gathered_scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "understory/features/scan_rings.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr TimeNs kStart = 1'700'000'000 * kNsPerSecond;
constexpr TimeNs kScan = kNsPerSecond / 10;
constexpr double kWallM = 10.0;  // radius of an upright wall
// Of the wall, seen from the first place of the body: a wall about the body would hide turns.
const Eigen::Vector2d kCentre(4.0, -1.0);

Vector6d steady_motion() {
  Vector6d motion;
  motion << 0.0, 0.0, 0.6, 1.2, 0.1, 0.0;  // rad/s, m/s
  return motion;
}

// Lines that swing from -7 to 52 degrees, seen from a body that moves evenly from kStart on.
ScanPtr swinging_scan(int number, const Rig& rig) {
  auto scan = std::make_shared<Scan>();
  scan->stamp = kStart + number * kScan;
  for (int i = 0; i < 20'000; ++i) {
    const double t = number * 0.1 + 5e-6 * i;
    const Pose first_from_lidar = Pose::exp(t * steady_motion()) * rig.body_from_lidar;
    const double azimuth = kTau * 10.0 * t;
    const double elevation = (22.5 + 29.5 * std::sin(kTau * 176.18 * t)) * kDegree;
    const Eigen::Vector3d ray =
        first_from_lidar.rotation() * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                                      std::cos(elevation) * std::sin(azimuth),
                                                      std::sin(elevation));
    const Eigen::Vector3d origin = first_from_lidar.translation();
    const double a = ray.head<2>().squaredNorm();
    const Eigen::Vector2d from_centre = origin.head<2>() - kCentre;
    const double b = ray.head<2>().dot(from_centre);
    const double c = from_centre.squaredNorm() - kWallM * kWallM;
    const double range = (-b + std::sqrt(b * b - a * c)) / a;
    const Eigen::Vector3d point = first_from_lidar.inverse() * (origin + range * ray);
    ScanPoint found;
    found.x = static_cast<float>(point.x());
    found.y = static_cast<float>(point.y());
    found.z = static_cast<float>(point.z());
    found.t_ns = static_cast<std::uint32_t>(5'000 * i);
    found.ring = static_cast<std::uint16_t>(i % 4);
    scan->points.push_back(found);
  }
  return scan;
}

Rig shifted_rig() {
  Rig rig;
  rig.body_from_lidar = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.2, -0.1, 0.3));
  rig.body_from_imu = Pose(so3_exp({0.0, 0.0, 0.5}), Eigen::Vector3d::Zero());
  return rig;
}

std::vector<ScanPtr> five_scans(const Rig& rig) {
  std::vector<ScanPtr> scans;
  for (int i = 0; i < 5; ++i)
    scans.push_back(swinging_scan(i, rig));
  return scans;
}

// Largest distance of a return from the wall, m.
double off_the_wall(const Scan& gathered, const Rig& rig) {
  const Pose first_from_lidar =
      Pose::exp(to_seconds(gathered.stamp - kStart) * steady_motion()) * rig.body_from_lidar;
  double most = 0.0;
  for (const ScanPoint& point : gathered.points) {
    const Eigen::Vector3d place = first_from_lidar * Eigen::Vector3d(point.x, point.y, point.z);
    most = std::max(most, std::abs((place.head<2>() - kCentre).norm() - kWallM));
  }
  return most;
}

TEST(GatheredScan, HasLevelRingsAndNoMotion) {
  const Rig rig = shifted_rig();
  const std::vector<ScanPtr> scans = five_scans(rig);
  EXPECT_FALSE(has_level_rings(*scans.front()));
  GatheredMotion motion;
  motion.per_s = steady_motion();
  const ScanPtr gathered = gather_scans(scans, scans.back()->stamp, rig, motion);
  EXPECT_EQ(gathered->stamp, scans.back()->stamp);
  EXPECT_FALSE(gathered->has_point_times);
  EXPECT_TRUE(has_level_rings(*gathered));
  EXPECT_GT(gathered->points.size(), 7'000U);  // a third of 15 rings of 1440 columns
  // A cell is 0.25 degrees wide: its return lies in its middle, 2 cm aside at most.
  EXPECT_LT(off_the_wall(*gathered, rig), 0.02);
  std::set<std::pair<int, int>> cells;
  for (const ScanPoint& point : gathered->points) {
    const double azimuth = std::atan2(point.y, point.x) / kDegree;
    EXPECT_TRUE(cells.emplace(point.ring, static_cast<int>(std::floor(azimuth * 4.0))).second);
  }
  // Taken to stand still, the same points lie up to 0.6 m off.
  EXPECT_GT(off_the_wall(*gather_scans(scans, scans.back()->stamp, rig, {}), rig), 0.3);
}

TEST(GatheredScan, TakesTurnsFromTheGyroscope) {
  const Rig rig = shifted_rig();
  const std::vector<ScanPtr> scans = five_scans(rig);
  const Eigen::Vector3d bias(0.01, -0.02, 0.03);
  ImuBuffer samples({}, nullptr);
  const Eigen::Vector3d rate =
      rig.body_from_imu->rotation().conjugate() * (steady_motion().head<3>() + bias);
  for (int i = -2; i < 110; ++i)
    samples.add({.stamp = kStart + i * 5'000'000LL,
                 .angular_rate = rate,
                 .specific_force = {0.0, 0.0, 9.81},
                 .orientation = {}});
  GatheredMotion motion;
  motion.per_s = steady_motion();
  motion.per_s.head<3>().setZero();
  EXPECT_GT(off_the_wall(*gather_scans(scans, scans.back()->stamp, rig, motion), rig), 0.4);
  motion.samples = &samples;
  motion.gyro_bias = bias;
  // The body goes along an arc; without turns even motion goes along its chord, 9 cm from it at
  // most.
  EXPECT_LT(off_the_wall(*gather_scans(scans, scans.back()->stamp, rig, motion), rig), 0.12);
  // Samples that do not cover the scans are not used.
  motion.per_s = steady_motion();
  samples.forget_before(kStart + 100'000'000LL);
  EXPECT_LT(off_the_wall(*gather_scans(scans, scans.back()->stamp, rig, motion), rig), 0.02);
}

TEST(GatheredScan, LeavesOutTheMachine) {
  const Rig rig = shifted_rig();
  const std::vector<ScanPtr> scans = five_scans(rig);
  GatheredMotion motion;
  motion.per_s = steady_motion();
  std::vector<MachineBox> boxes(1);
  boxes[0].frame_from_box = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(10.0, 0.0, 0.0));
  boxes[0].size_m = Eigen::Vector3d(6.0, 2.0, 30.0);
  const ScanPtr whole = gather_scans(scans, kStart, rig, motion);
  const ScanPtr rest = gather_scans(scans, kStart, rig, motion, &boxes);
  EXPECT_LT(rest->points.size(), whole->points.size());
}

}  // namespace
}  // namespace understory
