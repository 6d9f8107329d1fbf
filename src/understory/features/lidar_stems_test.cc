#include "understory/features/lidar_stems.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace understory {
namespace {

// A lidar with 16 level rings within a round wall at 12 m, with two stems of 0.3 m at `places`
// (frame of the lidar).
Scan scan_with_stems(const std::vector<Eigen::Vector2d>& places) {
  Scan scan;
  scan.ring_count = 16;
  for (int column = 0; column < 1800; ++column) {
    const double azimuth = 2.0 * EIGEN_PI * column / 1800.0;
    const Eigen::Vector2d ahead(std::cos(azimuth), std::sin(azimuth));
    double range = 12.0;
    for (const Eigen::Vector2d& place : places) {
      const double along = place.dot(ahead);
      const double across = place.x() * ahead.y() - place.y() * ahead.x();
      if (along > 0.0 && std::abs(across) < 0.15)
        range = along - std::sqrt(0.15 * 0.15 - across * across);
    }
    for (int ring = 0; ring < 16; ++ring) {
      ScanPoint point;
      point.x = static_cast<float>(range * ahead.x());
      point.y = static_cast<float>(range * ahead.y());
      point.z = static_cast<float>(range * std::tan((2.0 * ring - 15.0) * EIGEN_PI / 180.0));
      point.ring = static_cast<std::uint16_t>(ring);
      point.t_ns = static_cast<std::uint32_t>(column * 50'000);
      scan.points.push_back(point);
    }
  }
  return scan;
}

// Two lidars three metres apart that look opposite ways, and what they see of the same two stems.
struct ScannedMachine {
  Rig rig;
  Scan merged;
};

ScannedMachine machine(double tilt_rad = 0.0) {
  ScannedMachine made;
  const Eigen::Quaterniond back(Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitY()));
  const Pose first_from_second(back, Eigen::Vector3d(-3.0, 0.0, 0.4));
  made.rig.further_lidars.push_back({first_from_second, kRingsALidar});
  const std::vector<Eigen::Vector2d> stems = {{4.0, 2.0}, {-6.0, -3.0}};
  made.merged = scan_with_stems(stems);
  std::vector<Eigen::Vector2d> from_second;
  for (const Eigen::Vector2d& stem : stems)
    from_second.emplace_back(
        (first_from_second.inverse() * Eigen::Vector3d(stem.x(), stem.y(), 0.0)).head<2>());
  for (ScanPoint point : scan_with_stems(from_second).points) {
    const Eigen::Vector3d at = first_from_second * Eigen::Vector3d(point.x, point.y, point.z);
    point.x = static_cast<float>(at.x());
    point.y = static_cast<float>(at.y());
    point.z = static_cast<float>(at.z());
    point.ring = static_cast<std::uint16_t>(point.ring + kRingsALidar);
    made.merged.points.push_back(point);
  }
  return made;
}

TEST(LidarStems, AreFoundLidarByLidarAndCountOnce) {
  const ScannedMachine made = machine();
  const std::vector<LidarStems> lidars =
      find_stems_of_lidars(made.merged, made.rig, StemSegmentConfig());
  ASSERT_EQ(lidars.size(), 2U);
  std::vector<Stem> stems;
  std::vector<std::size_t> from;
  for (const LidarStems& lidar : lidars) {
    EXPECT_EQ(lidar.found.stems.size(), 2U);
    from.push_back(stems.size());
    for (const StemSegment& segment : lidar.found.stems)
      stems.push_back(stem_of(segment, lidar.body_from_lidar, lidar.found.up));
  }
  drop_double_stems(from, stems);
  ASSERT_EQ(stems.size(), 2U);
  for (const Stem& stem : stems) {
    const double first = (stem.point.head<2>() - Eigen::Vector2f(4.0F, 2.0F)).norm();
    const double second = (stem.point.head<2>() - Eigen::Vector2f(-6.0F, -3.0F)).norm();
    EXPECT_LT(std::min(first, second), 0.1);
  }
}

TEST(LidarStems, RingsOfTheSecondLidarAreLevelInItsOwnFrame) {
  ScannedMachine made = machine(0.7);
  EXPECT_TRUE(all_have_level_rings(made.merged, made.rig));
  std::erase_if(made.merged.points,
                [](const ScanPoint& point) { return point.ring < kRingsALidar; });
  EXPECT_TRUE(all_have_level_rings(made.merged, made.rig));
  EXPECT_FALSE(all_have_level_rings(made.merged, Rig()));  // taken for the first lidar
}

TEST(LidarStems, UpIsThatOfTheLidarThatSeesMostInTheFrameOfTheFirst) {
  const Eigen::Vector3d given(0.0, 0.6, 0.8);
  std::vector<LidarStems> lidars(2);
  EXPECT_EQ(up_by_stems(lidars, given), given);
  lidars[0].found.stems.resize(1);
  lidars[0].found.up = Eigen::Vector3d::UnitZ();
  lidars[0].body_from_lidar =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ())),
           Eigen::Vector3d::Zero());
  EXPECT_EQ(up_by_stems(lidars, given), Eigen::Vector3d::UnitZ());
  // The second one lies on its side: its x axis is up in the body, and in the first one.
  lidars[1].found.stems.resize(2);
  lidars[1].found.up = Eigen::Vector3d::UnitX();
  lidars[1].body_from_lidar =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(-0.5 * EIGEN_PI, Eigen::Vector3d::UnitY())),
           Eigen::Vector3d::Zero());
  EXPECT_TRUE(up_by_stems(lidars, given).isApprox(Eigen::Vector3d::UnitZ(), 1e-12));
}

TEST(LidarStems, OfOneLidarStayAsTheyAre) {
  std::vector<Stem> stems(2);
  drop_double_stems({0}, stems);
  EXPECT_EQ(stems.size(), 2U);
}

}  // namespace
}  // namespace understory
