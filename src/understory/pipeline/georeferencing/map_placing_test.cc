#include "understory/pipeline/georeferencing/map_placing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/output/run_tables.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

using Eigen::Vector3d;

const GeodeticPlace kEvo{61.2, 24.7, 150.0};
const Pose kEnuFromWorld(so3_exp(Vector3d(0.0, 0.0, 1.1)), Vector3d(0.0, 0.0, 2.0));

// A walk with bends in the world frame, and fixes of it with half a metre of noise.
struct Walk {
  Trajectory path;
  std::vector<GnssFix> fixes;
  explicit Walk(double length_m) {
    const EastNorthUp frame(kEvo);
    for (int k = 0; k < 600; ++k) {
      const double s = length_m * k / 600.0;
      const Vector3d at(s, 15.0 * std::sin(0.05 * s), 0.02 * s);
      path.push_back({k * kNsPerSecond, Pose(Eigen::Quaterniond::Identity(), at)});
      const Vector3d noise(0.5 * std::sin(12.9898 * k), 0.5 * std::sin(78.233 * k), 0.0);
      const GeodeticPlace place = frame.to_place(kEnuFromWorld * at + noise);
      GnssFix fix;
      fix.stamp = k * kNsPerSecond;
      fix.latitude_deg = place.latitude_deg;
      fix.longitude_deg = place.longitude_deg;
      fix.height_m = place.height_m;
      fix.quality = k % 100 == 7 ? 0 : 1;
      fixes.push_back(fix);
    }
  }
};

std::vector<std::string> column(const std::filesystem::path& file, const char* name) {
  std::vector<std::string> cells;
  CsvReader table(file, {name});
  while (table.next())
    cells.emplace_back(table.text(name));
  return cells;
}

TEST(MapPlacing, AWalkWithBendsLandsOnTheGlobe) {
  const test::TemporaryFolder folder;
  const Walk walk(300.0);
  Log log;
  const PlacedMap map = place_map({folder.path(), walk.path, walk.fixes}, {}, log);
  ASSERT_TRUE(map.place.on_globe) << map.place.reason;
  EXPECT_EQ(map.place.coordinate_system, "EPSG:3067");
  EXPECT_TRUE(log.warnings().empty());
  const LayerFrame truth(kEnuFromWorld, kEvo, "EPSG:3067");
  for (const Vector3d& point : {Vector3d(0, 0, 0), Vector3d(300, 0, 6)})
    EXPECT_LT((map.frames.layers.from_world(point) - truth.from_world(point)).norm(), 0.5);
  const std::vector<std::string> reasons = column(folder / "gnss.csv", "reason");
  ASSERT_EQ(reasons.size(), 600U);
  EXPECT_EQ(reasons[7], "no fix");
  EXPECT_EQ(reasons[8], "");
  EXPECT_EQ(column(folder / "gnss.csv", "used")[8], "1");
  // In the frame of the run, not on the globe.
  EXPECT_NEAR(std::stod(column(folder / "gnss.csv", "x")[599]), 299.5, 1.5);
}

// A regression: the place of a run by stems was as uncertain in its tilt as one by nothing.
TEST(MapPlacing, TheStatedTiltIsThatOfWhatHoldsItUp) {
  Walk walk(300.0);
  for (std::size_t k = 0; k < walk.fixes.size(); ++k)  // heights that tell no tilt
    walk.fixes[k].height_m += 10.0 * std::sin(0.02 * static_cast<double>(k));
  const auto tilt_deg = [&](LevelledBy what) {
    const test::TemporaryFolder folder;
    Log log;
    const PlacedMap map = place_map({folder.path(), walk.path, walk.fixes, {}, {}, what}, {}, log);
    return std::get<double>(map.figures.at("sd_turn_east_deg"));
  };
  // The walk is straight: the bias of the accelerometer makes a tilt.
  const double by_gravity = tilt_deg(LevelledBy::kGravity);
  EXPECT_GT(by_gravity, 0.051);
  EXPECT_LT(by_gravity, 0.26);
  const double by_stems = tilt_deg(LevelledBy::kStems);
  EXPECT_GT(by_stems, 0.26);
  EXPECT_LT(by_stems, 1.01);
  EXPECT_GT(tilt_deg(LevelledBy::kNothing), by_stems);
}

TEST(MapPlacing, AWalkOnTheSpotStaysLocalAndSaysWhy) {
  const test::TemporaryFolder folder;
  const Walk walk(0.2);
  Log log;
  const PlacedMap map = place_map({folder.path(), walk.path, walk.fixes}, {}, log);
  EXPECT_FALSE(map.place.on_globe);
  EXPECT_FALSE(map.place.reason.empty());
  EXPECT_TRUE(map.frames.layers.is_world());
  ASSERT_EQ(log.warnings().size(), 1U);
  EXPECT_EQ(log.warnings()[0].key, "gnss.not_placed");
  EXPECT_EQ(column(folder / "gnss.csv", "used")[8], "0");
}

TEST(MapPlacing, WithoutFixesOrWhereItIsOffNothingIsWarnedOf) {
  const test::TemporaryFolder folder;
  const Walk walk(300.0);
  Log log;
  const PlacedMap none = place_map({folder.path(), walk.path, {}}, {}, log);
  EXPECT_FALSE(none.place.on_globe);
  EXPECT_FALSE(std::filesystem::exists(folder / "gnss.csv"));
  GeoreferenceConfig off;
  off.enabled = false;
  EXPECT_FALSE(place_map({folder.path(), walk.path, walk.fixes}, off, log).place.on_globe);
  EXPECT_TRUE(log.warnings().empty());
  EXPECT_EQ(column(folder / "gnss.csv", "reason")[8], "georeference.enabled is off");
}

// Whoever reads the run brings its layers back to the world frame.
TEST(RunPlace, ComesBackFromRunJson) {
  const test::TemporaryFolder folder;
  EXPECT_TRUE(read_layer_frame(folder.path()).is_world());
  RunPlace place;
  place.on_globe = true;
  place.method = "gnss-path";
  place.enu_from_world = kEnuFromWorld;
  place.origin = kEvo;
  Log log;
  const ResultFrames frames = frames_at(place, {}, log);
  RunSummary summary;
  summary.command = "map";
  summary.crs_wkt = frames.layers.wkt();
  summary.place = place;
  write_run_json(folder / "run.json", summary);
  const auto read = read_run_place(folder.path());
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->method, "gnss-path");
  EXPECT_EQ(read->coordinate_system, "EPSG:3067");
  const LayerFrame again = read_layer_frame(folder.path());
  const Vector3d point(40.0, -30.0, 5.0);
  EXPECT_LT((again.from_world(point) - frames.layers.from_world(point)).norm(), 1e-6);
  EXPECT_LT((again.to_world(frames.layers.from_world(point)) - point).norm(), 1e-4);
}

}  // namespace
}  // namespace understory
