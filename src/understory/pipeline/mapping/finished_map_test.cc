#include "understory/pipeline/mapping/finished_map.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

// A cloud of a scan between keyframes goes where its keyframe went.
TEST(FinishedMap, CloudsMoveWithTheirKeyframes) {
  const test::TemporaryFolder folder;
  KeyframeClouds clouds(folder / "clouds.bin");
  const Pose keyframe_from_body(so3_exp({0.0, 0.0, 0.5}), {0.2, 0.1, 0.0});
  clouds.append({0, 1'000'000'000, {{1.0F, 0.0F, 0.0F, 5, 0}}, {}});
  clouds.append({0, 1'100'000'000, {{1.0F, 0.0F, 0.0F, 6, 100}}, keyframe_from_body});
  clouds.append({1, 1'200'000'000, {{0.0F, 2.0F, 0.0F, 7, 0}}, {}});
  std::vector<Keyframe> keyframes(2);
  keyframes[0].world_from_body = Pose(so3_exp({0.1, 0.0, 1.0}), {10.0, 0.0, 1.0});
  keyframes[1].world_from_body = Pose(so3_exp({0.0, 0.0, 2.0}), {20.0, 5.0, 1.0});
  MapTiles::Config config;
  config.thin_m = 0.0;
  LeftOutCarrier none;
  const auto tiles = make_finished_map({clouds}, keyframes, config, folder / "tiles", none,
                                       [](const ProgressReport&) {});
  std::map<std::uint16_t, std::pair<Eigen::Vector3d, TimeNs>> found;
  tiles->for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points)
      found[p.intensity] = {{p.x, p.y, p.z}, p.stamp};
  });
  ASSERT_EQ(found.size(), 3U);
  const Pose& first = keyframes[0].world_from_body;
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX();
  EXPECT_EQ(found[5].first, on_map_grid(first * ahead));
  EXPECT_EQ(found[6].first, on_map_grid(first * (keyframe_from_body * ahead)));
  EXPECT_EQ(found[7].first,
            on_map_grid(keyframes[1].world_from_body * Eigen::Vector3d(0.0, 2.0, 0.0)));
  EXPECT_EQ(found[6].second, 1'101'000'000);
}

// What stays beside the lidar goes nowhere, and is counted.
TEST(FinishedMap, TheCarrierIsLeftOut) {
  const test::TemporaryFolder folder;
  KeyframeClouds clouds(folder / "clouds.bin");
  clouds.append({0, 0, {{1.0F, 0.1F, 0.1F, 5, 0}, {2.5F, 0.1F, 0.1F, 6, 0}}, {}});
  const std::vector<Keyframe> keyframes(1);
  const std::vector<StampedPose> path = {{0, {}}};
  // Two voxels along each axis to each side of the lidar, all filled.
  LeftOutCarrier carrier{CarrierRegion({1.0, 0.0, 0.0}, 0.4, std::vector<std::uint8_t>(64, 1)),
                         path};
  const auto tiles = make_finished_map({clouds}, keyframes, {}, folder / "tiles", carrier, {});
  std::vector<std::uint16_t> kept;
  tiles->for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points)
      kept.push_back(p.intensity);
  });
  EXPECT_EQ(kept, std::vector<std::uint16_t>{6});
  EXPECT_EQ(carrier.points, 1U);
  EXPECT_EQ(carrier.of, 2U);
}

// A far cloud adds what no other one shows from near.
TEST(FinishedMap, FarPointsEnterWhereNothingIsSeenFromNear) {
  const test::TemporaryFolder folder;
  KeyframeClouds whole(folder / "clouds.bin");
  KeyframeClouds far(folder / "far_clouds.bin");
  KeyframeCloud near_stem{0, 0, {}, {}};
  for (int i = 0; i < 40; ++i)
    near_stem.points.push_back({5.1F, 0.1F, 0.05F * static_cast<float>(i), 5, 0});
  whole.append(near_stem);
  far.append({0,
              0,
              {{25.1F, 0.1F, 1.0F, 6, 0}, {15.1F, 0.1F, 1.0F, 7, 0}},
              Pose(Eigen::Quaterniond::Identity(), {-10.0, 0.0, 0.0})});
  const std::vector<Keyframe> keyframes(1);
  LeftOutCarrier none;
  const auto tiles = make_finished_map({whole, &far, 12.0}, keyframes, {}, folder / "tiles", none,
                                       [](const ProgressReport&) {});
  std::map<std::uint16_t, int> found;
  tiles->for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points)
      ++found[p.intensity];
  });
  EXPECT_EQ(found[5], 40);
  EXPECT_EQ(found[6], 1);
  EXPECT_EQ(found[7], 0);
}

}  // namespace
}  // namespace understory
