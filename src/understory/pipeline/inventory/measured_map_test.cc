#include "understory/pipeline/inventory/measured_map.h"

#include <gtest/gtest.h>

#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "understory/output/clouds/las_writer.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

constexpr TimeNs kBegin = 1'700'000'000LL * kNsPerSecond;

Trajectory path() {
  Trajectory path;
  for (int second = 0; second <= 10; ++second)
    path.push_back({kBegin + second * kNsPerSecond,
                    Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1.0 * second, 0.0, 1.0))});
  return path;
}

std::vector<double> ranges_of(const MeasuredCloud& measured) {
  std::vector<double> ranges;
  measured.points([&](std::span<const TimedPoint> points) {
    for (const TimedPoint& point : points)
      ranges.push_back(measured.path.range_m(point));
  });
  return ranges;
}

TEST(MeasuredMap, PointsOfAFinishedMapKnowFromHowFarTheyWereMeasured) {
  const test::TemporaryFolder folder;
  MapTiles::Config config;
  config.thin_m = 0.0;
  MapTiles tiles(folder / "tiles", config);
  tiles.add({2.5, 4.0, 1.0, kBegin + 2'500'000'000LL, 1});
  tiles.add({9.0, 0.0, 1.0, kBegin + 3 * kNsPerSecond, 1});
  const std::vector<double> ranges = ranges_of(measured_map(tiles, path()));
  ASSERT_EQ(ranges.size(), 2U);
  EXPECT_NEAR(ranges[0], 4.0, 1e-5);
  EXPECT_NEAR(ranges[1], 6.0, 1e-5);
}

TEST(MeasuredMap, AMapThatWasReadAgainKnowsTheSame) {
  const test::TemporaryFolder folder;
  StandCloud map;
  map.cloud.points = {{2.5F, 4.0F, 1.0F}, {9.0F, 0.0F, 1.0F}};
  map.cloud.gps_time = {las_time(kBegin + 2'500'000'000LL), las_time(kBegin + 3 * kNsPerSecond)};
  EXPECT_FALSE(measured_in_run(folder.path(), map).points) << "there is no path";
  std::ofstream file(folder / "trajectory.tum");
  for (const StampedPose& pose : path())
    file << pose.stamp / kNsPerSecond << ' ' << pose.world_from_body.translation().x()
         << " 0 1 0 0 0 1\n";
  file.close();
  const std::vector<double> ranges = ranges_of(measured_in_run(folder.path(), map));
  ASSERT_EQ(ranges.size(), 2U);
  EXPECT_NEAR(ranges[0], 4.0, 1e-5);
  EXPECT_NEAR(ranges[1], 6.0, 1e-5);
  map.cloud.gps_time.clear();
  EXPECT_FALSE(measured_in_run(folder.path(), map).points) << "its points have no times";
}

}  // namespace
}  // namespace understory
