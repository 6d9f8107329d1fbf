#include "understory/map/carrier_region.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

const Eigen::Vector3d kLidar(0.5, 0.0, 2.0);

// A body that goes along x over level ground, past a row of trunks and a wall. It has a post of its
// own behind the lidar. Scans take 0.1 s and are deskewed.
class CarrierTest : public ::testing::Test {
 protected:
  static TimeNs time_of(int scan) { return 100'000'000LL * scan; }
  // Metres between two scans.
  double step_m_ = 0.8;
  double post_top_m_ = 2.9;

  [[nodiscard]] Pose pose_at(double scan) const {
    return Pose(so3_exp({0.0, 0.0, 0.02 * scan}), {step_m_ * scan, 0.0, 0.0});
  }
  // A point of the world, seen by a scan.
  void see(KeyframeCloud& cloud, int scan, const Eigen::Vector3d& in_world) {
    const Pose& pose = path_[static_cast<std::size_t>(scan)].world_from_body;
    add(cloud, pose.inverse() * in_world, 0);
  }
  // A point of the carrier, measured `share` of a scan after its stamp, and deskewed.
  void see_own(KeyframeCloud& cloud, int scan, const Eigen::Vector3d& in_body, double share) {
    const Pose moved = pose_at(scan).inverse() * pose_at(scan + share);
    add(cloud, moved * in_body, static_cast<std::uint16_t>(1e4 * share));
  }
  static void add(KeyframeCloud& cloud, const Eigen::Vector3d& place, std::uint16_t t_10us) {
    const Eigen::Vector3f p = place.cast<float>();
    cloud.points.push_back({p.x(), p.y(), p.z(), 0, t_10us});
  }
  // The world and the post.
  void see_all(KeyframeCloud& cloud, int scan) {
    for (double x = -12.0; x < 32.0; x += 0.1) {
      for (double y = -6.0; y < 6.0; y += 0.1)
        see(cloud, scan, {x, y, 0.0});
      for (double z = 0.0; z < 3.0; z += 0.1)
        see(cloud, scan, {x, 2.0, z});
    }
    for (int trunk = 0; trunk < 8; ++trunk) {
      for (double z = 0.0; z < 4.0; z += 0.05)
        see(cloud, scan, {4.0 * trunk, -1.5, z});
    }
    for (double z = 1.0; z < post_top_m_; z += 0.02)
      see_own(cloud, scan, {-0.4, 0.7, z}, 0.9);
  }
  CarrierRegion find(int scans) {
    for (int scan = 0; scan <= scans; ++scan)
      path_.push_back({time_of(scan), pose_at(scan)});
    KeyframeClouds clouds(folder_ / "clouds.bin");
    std::vector<Keyframe> keyframes;
    for (int scan = 0; scan < scans; ++scan) {
      keyframes.emplace_back().world_from_body = pose_at(scan);
      KeyframeCloud cloud{scan, time_of(scan), {}, {}};
      see_all(cloud, scan);
      clouds.append(cloud);
    }
    return find_carrier(clouds, keyframes, path_, kLidar, config_, {});
  }

  const test::TemporaryFolder folder_;
  CarrierSearchConfig config_;
  std::vector<StampedPose> path_;
};

TEST_F(CarrierTest, APostThatGoesAlongIsFoundAndTheWorldIsNot) {
  const CarrierRegion region = find(20);
  ASSERT_FALSE(region.empty());
  for (double z = 1.05; z < 2.85; z += 0.05)
    EXPECT_TRUE(region.holds({-0.4, 0.7, z})) << z;
  // Ground and wall stay at one place beside the lidar, too.
  for (double x = -2.0; x < 2.0; x += 0.1) {
    EXPECT_FALSE(region.holds({0.5 + x, 0.3, 0.0})) << x;
    EXPECT_FALSE(region.holds({0.5 + x, 2.0, 1.5})) << x;
  }
  EXPECT_FALSE(region.holds({0.0, -1.5, 2.0}));
  EXPECT_FALSE(region.holds({50.0, 0.0, 0.0}));
}

TEST_F(CarrierTest, NothingIsFoundWhereTheBodyHardlyMoved) {
  step_m_ = 0.15;
  EXPECT_TRUE(find(20).empty());
}

TEST_F(CarrierTest, ASinglePointThatStaysIsNothing) {
  post_top_m_ = 1.01;
  EXPECT_TRUE(find(20).empty());
}

TEST_F(CarrierTest, NothingIsFoundWithoutReach) {
  config_.reach_m = 0.0;
  EXPECT_TRUE(find(20).empty());
}

// The motion within a scan smears a deskewed post over 0.7 m.
TEST(PlacesAsMeasured, UndoTheDeskew) {
  const std::vector<StampedPose> path = {
      {0, Pose(so3_exp({0.0, 0.0, 0.0}), {0.0, 0.0, 0.0})},
      {100'000'000, Pose(so3_exp({0.0, 0.0, 0.2}), {0.8, 0.0, 0.0})}};
  const Eigen::Vector3d post(-0.4, 0.7, 1.5);
  KeyframeCloud cloud;
  for (const double u : {0.01, 0.51, 0.99, 1.49}) {
    const Pose then = interpolate(path[0].world_from_body, path[1].world_from_body, u);
    const Eigen::Vector3f p = (then * post).cast<float>();
    cloud.points.push_back({p.x(), p.y(), p.z(), 0, static_cast<std::uint16_t>(1e4 * u)});
  }
  const PlacesAsMeasured places(cloud, path);
  for (const KeyframePoint& point : cloud.points)
    EXPECT_LT((places(point) - post).norm(), 0.02);
}

}  // namespace
}  // namespace understory
