#include "understory/pipeline/georeferencing/online_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "understory/util/files/csv.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

const EastNorthUp kFrame({62.9, 27.4, 140.0});

// A second of a walk to the east: ten scans, and a fix at the first.
void walk(OnlinePath& path, int second) {
  for (int k = 0; k < 10; ++k) {
    const double time_s = second + 0.1 * k;
    const TimeNs stamp = 1000 * kNsPerSecond + from_seconds(time_s);
    if (k == 0) {
      const GeodeticPlace place = kFrame.to_place({time_s, 0.01 * std::sin(time_s), 2.0});
      GnssFix fix;
      fix.stamp = stamp;
      fix.latitude_deg = place.latitude_deg;
      fix.longitude_deg = place.longitude_deg;
      fix.height_m = place.height_m;
      fix.covariance = 1e-4 * Eigen::Matrix3d::Identity();
      fix.quality = 1;
      path.take(fix, Rig());
    }
    PositionedScan scan;
    scan.end = stamp + kNsPerSecond / 10;
    scan.pose = {stamp, Pose(Eigen::Quaterniond::Identity(), {time_s, 0.0, 0.0})};
    path.take(scan);
  }
}

TEST(OnlinePath, ARowAScanAndFigures) {
  const test::TemporaryFolder folder;
  OnlinePath path(folder.path());
  path.set_levelled_by(LevelledBy::kGravity);
  for (int second = 0; second < 40; ++second)
    walk(path, second);
  EXPECT_EQ(path.remark().rfind("on the globe within 0.", 0), 0U) << path.remark();
  const auto figures = path.write(folder.path(), {});
  EXPECT_EQ(std::get<std::string>(figures.at("global_coordinate_system")), "EPSG:3067");
  EXPECT_GT(std::get<double>(figures.at("global_known_percent")), 90.0);
  EXPECT_LT(std::get<double>(figures.at("global_heading_sd_end_deg")), 2.0);
  LineReader table(folder / "global.csv.gz");
  std::string line;
  std::string last;
  int rows = -1;  // without the header
  for (; table.next(line); ++rows)
    last = line;
  EXPECT_EQ(rows, 390);  // from the first fix after the first scan on
  std::vector<std::string> cells;
  std::istringstream stream(last);
  for (std::string cell; std::getline(stream, cell, ',');)
    cells.push_back(cell);
  ASSERT_EQ(cells.size(), 15U);
  EXPECT_NEAR(std::stod(cells[6]), 90.0, 1.0);  // the body's x axis looks to the east
}

TEST(OnlinePath, WithoutFixesThereIsNoFile) {
  const test::TemporaryFolder folder;
  OnlinePath path(folder.path());
  PositionedScan scan;
  scan.end = 5;
  path.take(scan);
  EXPECT_TRUE(path.write(folder.path(), {}).empty());
  EXPECT_TRUE(path.files().empty());
  EXPECT_FALSE(std::filesystem::exists(folder / "global.csv.gz"));
}

// A killed run goes on with the bytes of an undisturbed one.
TEST(OnlinePath, GoesOnToTheBit) {
  const test::TemporaryFolder folder;
  const std::filesystem::path whole_folder = folder / "whole";
  const std::filesystem::path killed_folder = folder / "killed";
  for (const auto& one : {whole_folder, killed_folder})
    std::filesystem::create_directory(one);
  OnlinePath whole(whole_folder);
  for (int second = 0; second < 30; ++second)
    walk(whole, second);
  BinaryWriter saved;
  {
    OnlinePath killed(killed_folder);
    for (int second = 0; second < 12; ++second)
      walk(killed, second);
    killed.sync();
    killed.save(saved);
    walk(killed, 12);  // is lost
  }
  OnlinePath again(killed_folder);
  BinaryReader reader(saved.bytes(), "state");
  again.load(reader, Rig());
  for (int second = 12; second < 30; ++second)
    walk(again, second);
  (void)whole.write(whole_folder, {});
  (void)again.write(killed_folder, {});
  EXPECT_EQ(read_text_file(whole_folder / "global.csv.gz"),
            read_text_file(killed_folder / "global.csv.gz"));
}

}  // namespace
}  // namespace understory
