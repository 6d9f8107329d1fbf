#include "understory/map/clouds/scan_clouds.h"

#include <gtest/gtest.h>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

// Points along x, a metre apart.
BodyCloud row_of(std::size_t points) {
  BodyCloud cloud;
  cloud.stamp = 5;
  cloud.resize(points);
  for (std::size_t i = 0; i < points; ++i) {
    cloud.points[i] = {static_cast<float>(i), 0.0F, 0.0F};
    cloud.range[i] = static_cast<float>(i);
    cloud.intensity[i] = 100'000.0F;
    cloud.t_ns[i] = static_cast<std::uint32_t>(10'000 * i);
  }
  return cloud;
}

Pose pose_along_x(double x) {
  return Pose(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0});
}

class ScanCloudsTest : public ::testing::Test {
 protected:
  ScanCloudsTest() {
    config_.range_min_m = 1.5;
    config_.range_max_m = 5.0;
    keyframes_.resize(1);
  }
  ScanCloudsConfig config_;
  const test::TemporaryFolder folder_;
  StageTimes times_;
  std::vector<Keyframe> keyframes_;
};

TEST_F(ScanCloudsTest, KeepsScansThatLieFarEnoughFromTheLastOneKept) {
  ScanClouds clouds(config_, folder_ / "clouds", times_);
  clouds.offer(row_of(8), pose_along_x(0.0), 0, pose_along_x(0.0), keyframes_);
  clouds.offer(row_of(8), pose_along_x(0.9), 0, pose_along_x(0.9), keyframes_);
  clouds.offer(row_of(8), pose_along_x(1.1), 0, pose_along_x(1.1), keyframes_);
  ASSERT_EQ(clouds.clouds().size(), 2U);
  EXPECT_EQ(clouds.clouds().read(1).keyframe_from_body.translation().x(), 1.1);
  // The keyframe was moved, and the last cloud with it.
  keyframes_[0].world_from_body = pose_along_x(3.0);
  clouds.offer(row_of(8), pose_along_x(4.5), 0, pose_along_x(1.5), keyframes_);
  EXPECT_EQ(clouds.clouds().size(), 2U);
}

TEST_F(ScanCloudsTest, AScanThatIsKeptElsewhereCountsAsTheLastOne) {
  ScanClouds clouds(config_, folder_ / "clouds", times_);
  clouds.pass_over(0, pose_along_x(0.0));
  EXPECT_FALSE(clouds.offer(row_of(8), pose_along_x(0.9), 0, pose_along_x(0.9), keyframes_));
  EXPECT_TRUE(clouds.offer(row_of(8), pose_along_x(1.1), 0, pose_along_x(1.1), keyframes_));
  EXPECT_EQ(clouds.clouds().size(), 1U);
}

TEST_F(ScanCloudsTest, KeepsPointsInRangeWithTheirTimes) {
  ScanClouds clouds(config_, folder_ / "clouds", times_);
  clouds.offer(row_of(8), pose_along_x(0.0), 0, pose_along_x(0.0), keyframes_);
  const KeyframeCloud kept = clouds.clouds().read(0);
  ASSERT_EQ(kept.points.size(), 4U);  // at 2, 3, 4 and 5 m
  EXPECT_EQ(kept.stamp, 5);
  EXPECT_EQ(kept.points.front().x, 2.0F);
  EXPECT_EQ(kept.points.back().t_10us, 5);
  EXPECT_EQ(kept.points.back().intensity, 65'535);
}

TEST_F(ScanCloudsTest, ThinsACloud) {
  config_.thin_m = 2.0;
  ScanClouds clouds(config_, folder_ / "clouds", times_);
  clouds.offer(row_of(8), pose_along_x(0.0), 0, pose_along_x(0.0), keyframes_);
  EXPECT_EQ(clouds.clouds().read(0).points.size(), 2U);  // at 2 and 4 m
}

TEST_F(ScanCloudsTest, GoesOnWhereItWas) {
  RecordCount known;
  std::optional<ScanClouds::Last> last;
  {
    ScanClouds clouds(config_, folder_ / "clouds", times_);
    clouds.offer(row_of(8), pose_along_x(2.0), 0, pose_along_x(2.0), keyframes_);
    clouds.sync();
    known = clouds.clouds().count();
    last = clouds.last();
  }
  ScanClouds clouds(config_, folder_ / "clouds", known, last, times_);
  clouds.offer(row_of(8), pose_along_x(2.5), 0, pose_along_x(2.5), keyframes_);
  EXPECT_EQ(clouds.clouds().size(), 1U);
  clouds.offer(row_of(8), pose_along_x(3.5), 0, pose_along_x(3.5), keyframes_);
  EXPECT_EQ(clouds.clouds().size(), 2U);
}

}  // namespace
}  // namespace understory
