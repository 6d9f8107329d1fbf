#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "understory/map/clouds/map_tiles.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/map/keyframes/keyframe_points.h"
#include "understory/map/local_map.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

KeyframeCloud cloud_of(int id, std::size_t points) {
  KeyframeCloud cloud{id, 100 * id, {}, Pose(so3_exp({0.0, 0.1, 0.2}), {1.0, 2.0, 1.0 * id})};
  for (std::size_t i = 0; i < points; ++i) {
    cloud.points.push_back(
        {static_cast<float>(id), static_cast<float>(i), 0.5F, static_cast<std::uint16_t>(i), 7});
  }
  return cloud;
}

TEST(KeyframeClouds, ReadsBackInAnyOrder) {
  const test::TemporaryFolder folder;
  KeyframeClouds clouds(folder / "a.bin");
  for (int id = 0; id < 5; ++id)
    clouds.append(cloud_of(id, static_cast<std::size_t>(10 * id)));
  for (const std::size_t i : {4U, 0U, 2U}) {
    const KeyframeCloud cloud = clouds.read(i);
    EXPECT_EQ(cloud.id, static_cast<int>(i));
    EXPECT_EQ(cloud.stamp, static_cast<TimeNs>(100 * i));
    ASSERT_EQ(cloud.points.size(), 10 * i);
    EXPECT_EQ(cloud.keyframe_from_body.matrix(), cloud_of(cloud.id, 0).keyframe_from_body.matrix());
    if (i > 0) {
      EXPECT_EQ(cloud.points.back().y, static_cast<float>(10 * i - 1));
    }
  }
}

TEST(KeyframeClouds, ReopeningCutsOffWhatTheCheckpointDoesNotKnow) {
  const test::TemporaryFolder folder;
  RecordCount known;
  {
    KeyframeClouds clouds(folder / "b.bin");
    for (int id = 0; id < 5; ++id) {
      if (id == 3) known = clouds.count();
      clouds.append(cloud_of(id, 10));
    }
  }
  KeyframeClouds clouds(folder / "b.bin", known);
  EXPECT_EQ(clouds.size(), 3U);
  clouds.append(cloud_of(9, 4));
  EXPECT_EQ(clouds.read(3).id, 9);
  EXPECT_EQ(clouds.read(2).id, 2);
  EXPECT_EQ(std::filesystem::file_size(folder / "b.bin"), clouds.count().bytes);
}

TEST(KeyframeClouds, ATruncatedFileIsAnInputError) {
  const test::TemporaryFolder folder;
  RecordCount known;
  {
    KeyframeClouds clouds(folder / "c.bin");
    for (int id = 0; id < 2; ++id)
      clouds.append(cloud_of(id, 10));
    known = clouds.count();
  }
  std::filesystem::resize_file(folder / "c.bin", std::filesystem::file_size(folder / "c.bin") - 1);
  EXPECT_THROW(KeyframeClouds(folder / "c.bin", known), InputError);
}

TEST(KeyframeClouds, ADamagedCloudIsAnInputErrorWhenItIsRead) {
  const test::TemporaryFolder folder;
  KeyframeClouds clouds(folder / "d.bin");
  for (int id = 0; id < 2; ++id)
    clouds.append(cloud_of(id, 10));
  std::fstream file(folder / "d.bin", std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(-5, std::ios::end);
  file.put('x');
  file.close();
  EXPECT_EQ(clouds.read(0).id, 0);
  EXPECT_THROW(static_cast<void>(clouds.read(1)), InputError);
}

// P2 (37): metres and turns on one scale.
TEST(KeyframePoints, KeepTheirFeaturesAndLidarsOnTheDisk) {
  const test::TemporaryFolder folder;
  const Points three(3, Eigen::Vector3f(1.0F, 2.0F, 3.0F));
  const std::vector<FeaturePoints> clouds = {
      {three, {}, {}},
      {three, {}, {0, 1, 15}},
      {three, {PointFeature::kEdge, PointFeature::kNone, PointFeature::kGround}, {2, 0, 0}}};
  KeyframePoints points(folder.path() / "points", 10);
  for (const FeaturePoints& cloud : clouds)
    points.append(TimeNs{0}, cloud);
  points.forget();  // what is in memory
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    EXPECT_EQ(points.get(i)->points, clouds[i].points);
    EXPECT_EQ(points.get(i)->features, clouds[i].features);
    EXPECT_EQ(points.get(i)->lidars, clouds[i].lidars);
  }
}

TEST(KeyframeDistance, WeighsTurnsAgainstMetres) {
  KeyframeConfig config;
  config.rotation_as_metre_deg = 20.0;
  const Pose last(Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitX())),
                  {5.0, -3.0, 1.0});
  const auto turned = [&](double degrees) {
    const Eigen::Vector3d turn(0.0, 0.0, degrees * std::numbers::pi / 180.0);
    return last * Pose(so3_exp(turn), Eigen::Vector3d::Zero());
  };
  EXPECT_NEAR(keyframe_distance(last, last, config), 0.0, 1e-12);
  EXPECT_NEAR(keyframe_distance(last, turned(20.0), config), 1.0, 1e-9);
  EXPECT_NEAR(keyframe_distance(last, turned(-50.0), config), 2.5, 1e-9);
  const Pose moved(last.rotation(), last.translation() + Eigen::Vector3d(0.0, 0.6, 0.8));
  EXPECT_NEAR(keyframe_distance(last, moved, config), 1.0, 1e-9);
  const Pose screw =
      last * Pose::exp((Vector6d() << 0, 0, std::numbers::pi / 9.0, 0, 0, 1.0).finished());
  EXPECT_NEAR(keyframe_distance(last, screw, config), std::sqrt(2.0), 1e-9);
}

// P4 section 3.1.1, Local Map: of the last 15 keyframes the one nearest to the mean of those in
// each cube. While there are fewer than 15, of all of them.
TEST(LocalMapOfThePaper, TakesOneOfTheRecentKeyframesPerCube) {
  LocalMapConfig config;
  config.recent_keyframes = 15;
  config.recent_spacing_m = 2.0;
  std::vector<Eigen::Vector3d> way;
  for (int i = 0; i < 9; ++i)
    way.emplace_back(0.1 + 0.2 * i, 0.3, 0.3);  // 0.1 to 1.7: one cube, its mean at 0.9
  EXPECT_EQ(recent_keyframes(way, config), (std::vector<std::size_t>{4}));
  way.emplace_back(2.3, 0.3, 0.3);
  way.emplace_back(2.5, 0.3, 0.3);
  way.emplace_back(3.5, 0.3, 0.3);  // mean of the second cube 2.77
  EXPECT_EQ(recent_keyframes(way, config), (std::vector<std::size_t>{4, 10}));
  // Of 21 the first six are too old: in the first cube 1.3 to 1.7 are left, 1.5 their mean.
  for (int i = 0; i < 9; ++i)
    way.emplace_back(4.1 + 0.2 * i, 0.3, 0.3);
  EXPECT_EQ(recent_keyframes(way, config).front(), 7U);
  EXPECT_EQ(recent_keyframes(way, config).size(), 3U);
}

TEST(MapTiles, HandsBackEveryPointOnceInOrderOfTiles) {
  const test::TemporaryFolder folder;
  MapTiles tiles(folder / "tiles", {10.0, 0.0});
  Random random(3);
  double sum = 0.0;
  for (int i = 0; i < 10'000; ++i) {
    const MapPoint p{random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(0, 5), i, 1};
    sum += p.x + p.y;
    tiles.add(p);
  }
  std::size_t count = 0;
  double sum_back = 0.0;
  std::set<TimeNs> stamps;
  std::pair<int, int> last{-1000, -1000};
  tiles.for_each([&](MapTiles::TileIndex index, const std::vector<MapPoint>& points) {
    const std::pair<int, int> yx{index.second, index.first};
    EXPECT_LT(last, yx);
    last = yx;
    for (const MapPoint& p : points) {
      EXPECT_EQ(static_cast<int>(std::floor(p.x / 10.0)), index.first);
      sum_back += p.x + p.y;
      stamps.insert(p.stamp);
      ++count;
    }
  });
  EXPECT_EQ(count, 10'000U);
  EXPECT_EQ(stamps.size(), 10'000U);
  EXPECT_NEAR(sum_back, sum, 1e-2);
}

// One tile has more points than are handed over at once.
TEST(MapTiles, PlacesComeInTheOrderOfPoints) {
  const test::TemporaryFolder folder;
  MapTiles tiles(folder / "places", {100.0, 0.0});
  Random random(4);
  for (int i = 0; i < 100'000; ++i)
    tiles.add({random.uniform(0, 110), random.uniform(-1, 99), random.uniform(0, 5), i, 1});
  std::vector<Eigen::Vector3d> expected;
  tiles.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points)
      expected.emplace_back(p.x, p.y, p.z);
  });
  std::vector<Eigen::Vector3d> places;
  tiles.for_each_place([&](std::span<const Eigen::Vector3d> block) {
    EXPECT_FALSE(block.empty());
    places.insert(places.end(), block.begin(), block.end());
  });
  EXPECT_EQ(places, expected);
}

TEST(MapTiles, ThinsToTheFirstPointOfEachCube) {
  const test::TemporaryFolder folder;
  MapTiles tiles(folder / "thin", {10.0, 0.1});
  tiles.add({1.01, 1.01, 0.01, 1, 0});
  tiles.add({1.02, 1.03, 0.04, 2, 0});
  tiles.add({1.02, 1.03, 0.14, 3, 0});
  std::vector<TimeNs> kept;
  tiles.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points)
      kept.push_back(p.stamp);
  });
  EXPECT_EQ(kept, (std::vector<TimeNs>{1, 3}));
}

// All that MapTiles hands back of the same points.
struct HandedBack {
  std::vector<std::pair<MapTiles::TileIndex, std::uint64_t>> sizes;
  std::vector<std::pair<MapTiles::TileIndex, TimeNs>> points;
  std::vector<Eigen::Vector3d> places_in_one;
  std::size_t largest_block = 0;
  std::size_t files = 0;
};

HandedBack handed_back(const std::filesystem::path& folder, double most_bytes) {
  MapTiles::Config config{50.0, 0.05};
  config.most_bytes = most_bytes;
  MapTiles tiles(folder, config);
  Random random(5);
  for (int i = 0; i < 300'000; ++i)
    tiles.add({random.uniform(-3, 60), random.uniform(0, 4), random.uniform(0, 1), i, 1});
  HandedBack back;
  back.sizes = tiles.sizes();
  tiles.for_each_block([&](MapTiles::TileIndex index, std::span<const MapPoint> block) {
    for (const MapPoint& p : block)
      back.points.emplace_back(index, p.stamp);
    back.largest_block = std::max(back.largest_block, block.size());
  });
  tiles.for_each_place_in({0, 0}, [&](std::span<const Eigen::Vector3d> places) {
    back.places_in_one.insert(back.places_in_one.end(), places.begin(), places.end());
  });
  tiles.for_each_place_in({7, 7}, [&](std::span<const Eigen::Vector3d>) { ADD_FAILURE(); });
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    static_cast<void>(entry);
    ++back.files;
  }
  return back;
}

// The least memory thins in many strips, and holds all points on disk.
TEST(MapTiles, TheMemoryThatTheyMayTakeChangesNoPoint) {
  const test::TemporaryFolder folder;
  const HandedBack free = handed_back(folder / "free", 0.0);
  const HandedBack tight = handed_back(folder / "tight", 1e6);
  EXPECT_EQ(free.files, 0U);
  EXPECT_EQ(tight.files, 3U);
  EXPECT_EQ(free.sizes, tight.sizes);
  EXPECT_EQ(free.points, tight.points);
  EXPECT_EQ(free.places_in_one, tight.places_in_one);
  ASSERT_EQ(free.sizes.size(), 3U);
  EXPECT_EQ(free.sizes[1].second, free.places_in_one.size());
  EXPECT_LT(free.points.size(), 300'000U);
  EXPECT_GT(free.sizes[1].second, tight.largest_block);
}

std::vector<LocalMapInsertion> walk_of(std::size_t keyframes) {
  std::vector<LocalMapInsertion> walk;
  for (std::size_t i = 0; i < keyframes; ++i)
    walk.push_back({i, i % 8 == 0 ? 1U : 0U});
  return walk;
}

// A slab of points around each place; the walk goes 2 m a keyframe.
void walk_through(LocalMap& map, const std::vector<LocalMapInsertion>& insertions) {
  for (const LocalMapInsertion& insertion : insertions) {
    FeaturePoints cloud;
    for (int x = -30; x <= 30; ++x) {
      for (int y = -30; y <= 30; ++y) {
        for (int k = 0; k < 6; ++k)
          cloud.points.emplace_back(0.5F * x + 0.05F * k, 0.5F * y + 0.03F * k, 0.02F * k);
      }
    }
    const Pose pose(Eigen::Quaterniond::Identity(),
                    Eigen::Vector3d(2.0 * static_cast<double>(insertion.keyframe), 0, 0));
    map.insert({&cloud, pose}, insertion.forget != 0);
  }
}

TEST(LocalMapWithinMemory, ItsRadiusShrinksUntilItFitsAndTheSameInsertionsMakeItAgain) {
  LocalMapConfig config;
  LocalMap whole(config);
  walk_through(whole, walk_of(57));
  EXPECT_EQ(whole.radius_m(), config.radius_m);
  config.most_bytes = 0.6 * whole.bytes();
  LocalMap fitted(config);
  walk_through(fitted, walk_of(57));  // the last insertion forgets
  EXPECT_LE(fitted.bytes(), config.most_bytes);
  EXPECT_LT(fitted.radius_m(), config.radius_m);
  EXPECT_GE(fitted.radius_m(), 20.0);
  EXPECT_LT(fitted.snapshot()->size(), whole.snapshot()->size());
  // As a resumed run does.
  const double radius_m = fitted.radius_m();
  fitted.clear();
  EXPECT_EQ(fitted.first_radius_m(), radius_m);
  walk_through(fitted, walk_of(33));
  LocalMap again(config);
  again.set_radius(fitted.first_radius_m());
  walk_through(again, walk_of(33));
  EXPECT_EQ(again.radius_m(), fitted.radius_m());
  EXPECT_EQ(again.snapshot()->size(), fitted.snapshot()->size());
  // An open place: the radius comes back.
  fitted.clear();
  for (int round = 0; round < 30; ++round)
    walk_through(fitted, {{0, 1}});
  EXPECT_EQ(fitted.radius_m(), config.radius_m);
}

TEST(MapTiles, RefusesPlacesThatAreNotNumbers) {
  const test::TemporaryFolder folder;
  MapTiles tiles(folder / "nan", {10.0, 0.1});
  tiles.add({std::nan(""), 0, 0, 1, 0});
  tiles.add({0, INFINITY, 0, 1, 0});
  EXPECT_EQ(tiles.points_added(), 0U);
}

}  // namespace
}  // namespace understory
