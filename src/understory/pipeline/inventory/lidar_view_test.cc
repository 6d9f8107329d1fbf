#include "understory/pipeline/inventory/lidar_view.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/output/run_tables.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// A lidar 2 m up that sees from -15 to 15 degrees in the front half, mounted turned to the left.
LidarView view_of_a_machine() {
  LidarView view;
  view.body_from_lidar =
      Pose(so3_exp(Eigen::Vector3d(0.0, 0.0, 0.5 * M_PI)), Eigen::Vector3d(0.0, 0.0, 2.0));
  std::vector<Eigen::Vector3d> points;
  for (double azimuth = -88.0; azimuth <= 88.0; azimuth += 1.0) {
    for (double elevation = -15.0; elevation <= 15.0; elevation += 2.0) {
      const double a = azimuth * M_PI / 180.0;
      const double e = elevation * M_PI / 180.0;
      const Eigen::Vector3d p =
          view.body_from_lidar * (8.0 * Eigen::Vector3d(std::cos(e) * std::cos(a),
                                                        std::cos(e) * std::sin(a), std::sin(e)));
      points.push_back(p);
    }
  }
  view.add(points);
  return view;
}

TEST(LidarView, KnowsHowHighAndWhereTheLidarLooks) {
  const LidarView view = view_of_a_machine();
  const auto front = [](double degrees) {
    return Eigen::Vector3d(30.0, 0.0, 30.0 * std::tan(degrees * M_PI / 180.0));
  };
  EXPECT_TRUE(view.covers(front(14.9)));
  EXPECT_TRUE(view.covers(front(-40.0)));  // below is no matter of tops
  EXPECT_FALSE(view.covers(front(15.5)));
  EXPECT_FALSE(view.covers({-30.0, 0.0, 1.0}));
}

// Most points are left out by their slope: the highest of each direction are found all the same.
TEST(LidarView, IsThatOfTheHighestPointsAmongMany) {
  LidarView view;
  std::array<double, LidarView::kSectors> highest{};
  highest.fill(-90.0);
  std::vector<Eigen::Vector3d> points;
  Random random(3);
  for (int i = 0; i < 20'000; ++i) {
    const double azimuth = random.uniform(-180.0, 180.0);
    const double most = 20.0 + 0.1 * azimuth;  // the view is higher to one side
    const double elevation = random.uniform(-20.0, most);
    const double a = azimuth * M_PI / 180.0;
    const double range = random.uniform(2.0, 40.0);
    const Eigen::Vector3d exact(range * std::cos(a), range * std::sin(a),
                                range * std::tan(elevation * M_PI / 180.0));
    points.push_back(exact);
    const auto sector = static_cast<std::size_t>((azimuth + 180.0) / 10.0);
    highest[sector] =
        std::max(highest[sector], std::atan2(exact.z(), exact.head<2>().norm()) * 180.0 / M_PI);
  }
  view.add(points);
  for (std::size_t i = 0; i < highest.size(); ++i)
    EXPECT_NEAR(view.highest_deg[i], highest[i], 1e-9) << "sector " << i;
}

// Defect: scans were taken as moved to their stamps. A body that tilts by two degrees during each
// one made a lidar of 15 degrees look up by 17. Trees whose tops nobody saw were called seen.
TEST(LidarView, IsThatOfTheLidarWhereTheBodyTiltsDuringAScan) {
  const test::TemporaryFolder folder;
  const auto body_at = [](double seconds) {
    return Pose(so3_exp(Eigen::Vector3d(0.0, -20.0 * M_PI / 180.0 * seconds, 0.0)),
                Eigen::Vector3d::Zero());
  };
  std::vector<StampedPose> path;
  for (int i = 0; i <= 10; ++i)
    path.push_back({TimeNs{10'000'000} * i, body_at(0.01 * i)});
  KeyframeCloud cloud;
  const double up = std::tan(15.0 * M_PI / 180.0);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3f point =
        (body_at(0.001 * i) * Eigen::Vector3d(20.0, 0.02 * i - 1.0, 20.0 * up)).cast<float>();
    cloud.points.push_back(
        {point.x(), point.y(), point.z(), 0, static_cast<std::uint16_t>(100 * i)});
  }
  KeyframeClouds clouds(folder.path() / "clouds");
  clouds.append(cloud);
  const std::size_t ahead = LidarView::kSectors / 2;
  EXPECT_NEAR(learn_view(clouds, Pose(), path).highest_deg[ahead], 15.0, 0.1);
  EXPECT_GT(learn_view(clouds, Pose(), {}).highest_deg[ahead], 16.8);
}

TEST(LidarView, ATopIsSeenFromFarEnoughAndNotFromTooFar) {
  const LidarView view = view_of_a_machine();
  const Eigen::Vector3d low(20.0, 30.0, 6.0);
  const Eigen::Vector3d top(20.0, 30.0, 12.0);
  // The lidar looks to the left, along y.
  const Lookouts near = seen_from(view, {Pose(Eigen::Quaterniond::Identity(), {20.0, 10.0, 0.0})});
  EXPECT_EQ(near(low).size(), 1U);
  EXPECT_TRUE(near(low).front().isApprox(Eigen::Vector3d(20.0, 10.0, 2.0), 1e-9));
  EXPECT_TRUE(near(top).empty());
  const Lookouts also_farther =
      seen_from(view, {Pose(Eigen::Quaterniond::Identity(), {20.0, 10.0, 0.0}),
                       Pose(Eigen::Quaterniond::Identity(), {20.0, -15.0, 0.0})});
  ASSERT_EQ(also_farther(top).size(), 1U);
  EXPECT_TRUE(also_farther(top).front().isApprox(Eigen::Vector3d(20.0, -15.0, 2.0), 1e-9));
  EXPECT_EQ(also_farther(low).size(), 2U);
  const Lookouts too_far =
      seen_from(view, {Pose(Eigen::Quaterniond::Identity(), {20.0, -35.0, 0.0})});
  EXPECT_TRUE(too_far(top).empty());
  EXPECT_TRUE(seen_from(view, {})(low).empty());
}

TEST(LidarView, IsTheSameFromARunFolder) {
  const test::TemporaryFolder folder;
  const std::filesystem::path& run = folder.path();
  const LidarView view = view_of_a_machine();
  RunSummary summary;
  summary.lidar_view = figures_of(view);
  write_run_json(run / "run.json", summary);
  EXPECT_FALSE(seen_in_run(run));  // without keyframes
  EXPECT_TRUE(places_in_run(run).empty());
  const Pose pose(Eigen::Quaterniond::Identity(), {20.0, 10.0, 0.0});
  TumWriter keyframes(run / "keyframes.tum");
  keyframes.add({0, pose});
  keyframes.commit();
  const Lookouts here = seen_from(view, {pose});
  const Lookouts there = seen_in_run(run);
  ASSERT_EQ(places_in_run(run).size(), 1U);
  EXPECT_TRUE(places_in_run(run)[0].isApprox(places_of({pose})[0], 1e-9));
  ASSERT_TRUE(there);
  int seen = 0;
  for (double x = -10.0; x < 50.0; x += 5.0) {
    for (double y = -10.0; y < 50.0; y += 5.0) {
      EXPECT_EQ(here({x, y, 5.0}), there({x, y, 5.0})) << x << " " << y;
      seen += here({x, y, 5.0}).empty() ? 0 : 1;
    }
  }
  EXPECT_GT(seen, 20);
  EXPECT_LT(seen, 124);
}

TEST(LidarView, BeamsAreThoseOfTheRecordingUnlessTheUserNamesOthers) {
  const test::TemporaryFolder folder;
  Rig rig;
  rig.lidar_model = "OS-1-64";
  RunSummary summary;
  summary.lidar_model = single_lidar_model(rig);
  write_run_json(folder.path() / "run.json", summary);
  BeamConfig config;
  EXPECT_EQ(beams_in(config, rig).sensor, LidarSensor::kOs1);
  EXPECT_EQ(beams_in_run(config, folder.path()).sensor, LidarSensor::kOs1);
  config.sensor = LidarSensor::kVlp16;
  EXPECT_EQ(beams_in(config, rig).sensor, LidarSensor::kVlp16);
  EXPECT_EQ(beams_in_run(config, folder.path()).sensor, LidarSensor::kVlp16);
  config.sensor = LidarSensor::kUnknown;
  EXPECT_EQ(beams_in_run(config, folder.path()).sensor, LidarSensor::kUnknown);
  // Two lidars in one scan, and a run that tells none.
  rig.further_lidars.emplace_back();
  config.sensor = LidarSensor::kRecording;
  EXPECT_EQ(beams_in(config, rig).sensor, LidarSensor::kUnknown);
  summary.lidar_model = single_lidar_model(rig);
  write_run_json(folder.path() / "run.json", summary);
  EXPECT_EQ(beams_in_run(config, folder.path()).sensor, LidarSensor::kUnknown);
}

}  // namespace
}  // namespace understory
