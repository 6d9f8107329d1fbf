#include "understory/recording/clouds/cloud_folder.h"

#include <gtest/gtest.h>

#include <fstream>

#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/clouds/cloud_times.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

void write_kitti(const std::string& path, float x, int points = 10) {
  test::Bytes bytes;
  for (int i = 0; i < points; ++i) {
    for (const float value : {x, static_cast<float>(i), 1.0F, 0.5F})
      test::put(bytes, value);
  }
  test::write_bytes(path, bytes);
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

struct ReadFolder {
  std::vector<TimeNs> stamps;
  std::vector<float> x;  // of each scan's first point
  std::string conventions;
};

ReadFolder read_folder(const std::string& path, const OpenOptions& options, Log& log) {
  const auto recording = open_cloud_folder(path, options, log);
  ReadFolder result;
  for (const Event& event : test::read_all(*recording)) {
    const auto* scan = std::get_if<ScanPtr>(&event);
    if (scan == nullptr) continue;
    result.stamps.push_back((*scan)->stamp);
    result.x.push_back((*scan)->points.at(0).x);
  }
  result.conventions = recording->topics().at(0).conventions;
  return result;
}

TEST(CloudTimes, FindsTimesInNamesButNotCounters) {
  EXPECT_EQ(time_in_name("cloud_1583840261_039995392"), 1583840261039995392);
  EXPECT_EQ(time_in_name("cloud_1583840261_39995392"), 1583840261039995392);
  EXPECT_EQ(time_in_name("1583840261.0399"), 1583840261039900000);
  EXPECT_EQ(time_in_name("1583840261039995392"), 1583840261039995392);
  EXPECT_EQ(time_in_name("scan-1583840261039995"), 1583840261039995000);
  EXPECT_EQ(time_in_name("1583840261039"), 1583840261039000000);
  EXPECT_EQ(time_in_name("12.5"), 12'500'000'000);
  EXPECT_FALSE(time_in_name("000000"));
  EXPECT_FALSE(time_in_name("scan_17"));
  EXPECT_FALSE(time_in_name("frame_000012_000034"));
  EXPECT_FALSE(time_in_name("cloud"));
}

TEST(CloudTimes, OrdersNumbersByValue) {
  EXPECT_TRUE(natural_less("scan_2.pcd", "scan_10.pcd"));
  EXPECT_FALSE(natural_less("scan_10.pcd", "scan_2.pcd"));
  EXPECT_TRUE(natural_less("000009.bin", "000010.bin"));
  EXPECT_FALSE(natural_less("a1", "a1"));
}

TEST(CloudFolder, TakesTimesInTheStatedOrder) {
  const test::TemporaryFolder folder;
  for (const char* name : {"000002.bin", "000010.bin", "000001.bin"})
    write_kitti(folder / name, static_cast<float>(std::atoi(name)));
  Log log;
  ReadFolder result = read_folder(folder / "", {}, log);
  EXPECT_EQ(result.x, (std::vector<float>{1.0F, 2.0F, 10.0F}));
  EXPECT_EQ(result.stamps, (std::vector<TimeNs>{0, 100'000'000, 200'000'000}));
  EXPECT_EQ(test::count_of(log, "recording.assumed_rate"), 1U);
  EXPECT_NE(result.conventions.find("10 Hz"), std::string::npos);

  write_text(folder / "times.txt", "0.000000e+00\n1.037359e-01\n2.074e-01\n");
  result = read_folder(folder / "", {}, log);
  EXPECT_EQ(result.stamps, (std::vector<TimeNs>{0, 103'735'900, 207'400'000}));
  write_text(folder / "times.txt", "0\n103735900\n207400000\n");
  result = read_folder(folder / "", {}, log);
  EXPECT_EQ(result.stamps, (std::vector<TimeNs>{0, 103'735'900, 207'400'000}));
  write_text(folder / "times.txt", "1700000000.5\n1700000000.6\n1700000000.7\n");
  result = read_folder(folder / "", {}, log);
  EXPECT_EQ(result.stamps[1], 1'700'000'000'600'000'000);
  EXPECT_EQ(test::count_of(log, "recording.assumed_rate"), 1U);

  OpenOptions options;
  options.rate_hz = 20.0;
  result = read_folder(folder / "", options, log);
  EXPECT_EQ(result.stamps, (std::vector<TimeNs>{0, 50'000'000, 100'000'000}));
  EXPECT_NE(result.conventions.find("--rate-hz"), std::string::npos);

  write_text(folder / "times.txt", "1\ntwo\n3\n");
  EXPECT_THROW((void)read_folder(folder / "", {}, log), InputError);
  write_text(folder / "times.txt", "1.0\n2.0\n");
  EXPECT_EQ(read_folder(folder / "", {}, log).stamps.size(), 2U);
  EXPECT_EQ(test::count_of(log, "recording.times"), 1U);
}

TEST(CloudFolder, MergesImuAndGnssByTime) {
  const test::TemporaryFolder folder;
  write_kitti(folder / "1700000000.100000000.bin", 1.0F);
  write_kitti(folder / "1700000000.200000000.bin", 2.0F);
  write_text(folder / "imu.csv",
             "timestamp,gx,gy,gz,ax,ay,az\n1700000000.05,0.1,0.2,0.3,0,0,9.81\n"
             "1700000000.15,0,0,nonsense,0,0,9.81\n1700000000150000000,1,0,0,0,0,9.81\n"
             "1700000000.25,2,0,0,0,0,9.81\n");
  write_text(folder / "gnss.csv",
             "timestamp,latitude_deg,longitude_deg,height_m,hdop,sd_east_m,sd_north_m,sd_up_m,"
             "heading_deg,heading_sd_deg\n"
             "1700000000.12,47.5,8.5,500.25,1.5,1,2,3,271.5,0.25\n");
  Log log;
  const auto recording = open_cloud_folder(folder / "", {}, log);
  const auto events = test::read_all(*recording);
  std::vector<std::size_t> kinds;
  TimeNs last = 0;
  for (const Event& event : events) {
    kinds.push_back(event.index());
    EXPECT_GE(event_time(event), last);
    last = event_time(event);
  }
  EXPECT_EQ(kinds, (std::vector<std::size_t>{1, 0, 2, 1, 0, 1}));
  const auto& fix = std::get<GnssFix>(events[2]);
  EXPECT_EQ(fix.height_m, 500.25);
  EXPECT_EQ(fix.covariance(1, 1), 4.0);
  EXPECT_EQ(fix.heading_deg, 271.5);
  EXPECT_EQ(fix.heading_sd_deg, 0.25);
  EXPECT_EQ(std::get<ImuSample>(events[3]).angular_rate.x(), 1.0);
  EXPECT_EQ(recording->rig().body_frame, "imu");
  EXPECT_EQ(test::count_of(log, "recording.damaged_line"), 1U);
  EXPECT_EQ(test::count_of(log, "recording.no_imu_extrinsics"), 1U);
}

TEST(CloudFolder, ReadsAnNmeaLogBesideTheClouds) {
  const test::TemporaryFolder folder;
  write_kitti(folder / "1453364282.100000000.bin", 1.0F);
  write_kitti(folder / "1453364284.100000000.bin", 1.0F);
  write_text(folder / "phone.nmea",
             test::nmea_line("GPRMC,081803.00,A,3649.7478,N,00224.4542,W,0.5,,210116,0.0,E,A"));
  Log log;
  const auto events = test::read_all(*open_cloud_folder(folder / "", {}, log));
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(std::get<GnssFix>(events[1]).stamp, 1'453'364'283 * kNsPerSecond);
}

TEST(CloudFolder, GoesOnBehindACloudThatCannotBeRead) {
  const test::TemporaryFolder folder;
  write_kitti(folder / "000000.bin", 1.0F);
  write_text(folder / "000001.bin", "");
  write_kitti(folder / "000002.bin", 3.0F);
  write_text(folder / "map.pcd", "no scan");
  Log log;
  const ReadFolder result = read_folder(folder / "", {}, log);
  EXPECT_EQ(result.x, (std::vector<float>{1.0F, 3.0F}));
  EXPECT_EQ(result.stamps, (std::vector<TimeNs>{0, 200'000'000}));
  EXPECT_EQ(test::count_of(log, "recording.other_clouds"), 1U);
}

// A regression: clouds of NaN were passed over, and the run knew nothing of them.
TEST(CloudFolder, ACloudWithoutPointsIsAScanWithoutPoints) {
  const test::TemporaryFolder folder;
  const std::string header =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\n"
      "HEIGHT 1\nPOINTS 2\nDATA ascii\n";
  write_text(folder / "000000.pcd", header + "1 2 3\n4 5 6\n");
  write_text(folder / "000001.pcd", header + "nan 2 3\nnan nan nan\n");
  write_text(folder / "000002.pcd", header + "3 2 1\n6 5 4\n");
  Log log;
  const auto events = test::read_all(*open_cloud_folder(folder / "", {}, log));
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(std::get<ScanPtr>(events[1])->stamp, 100'000'000);
  EXPECT_TRUE(std::get<ScanPtr>(events[1])->points.empty());
  EXPECT_EQ(test::count_of(log, "recording.empty_cloud"), 1U);
}

TEST(CloudFolder, RefusesWhatHasNoUsableCloud) {
  const test::TemporaryFolder folder;
  Log log;
  EXPECT_FALSE(is_cloud_folder(folder / ""));
  EXPECT_THROW((void)open_cloud_folder(folder / "", {}, log), InputError);
  write_text(folder / "a.pcd", "not a cloud");
  EXPECT_TRUE(is_cloud_folder(folder / ""));
  EXPECT_THROW((void)open_cloud_folder(folder / "", {}, log), InputError);
}

TEST(CloudFolder, OneCloudIsARecordingOfOneScan) {
  const test::TemporaryFolder folder;
  write_kitti(folder / "lonely.bin", 4.0F);
  Log log;
  ASSERT_TRUE(is_cloud_file(folder / "lonely.bin"));
  const ReadFolder result = read_folder(folder / "lonely.bin", {}, log);
  EXPECT_EQ(result.x, std::vector<float>{4.0F});
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(CloudFolder, PointTimesAreRecognisedAsInMessages) {
  const test::TemporaryFolder folder;
  for (int cloud = 0; cloud < 3; ++cloud) {
    std::string text =
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z time ring\nSIZE 4 4 4 4 2\nTYPE F F F F U\n"
        "COUNT 1 1 1 1 1\nWIDTH 100\nHEIGHT 1\nPOINTS 100\nDATA ascii\n";
    for (int i = 0; i < 100; ++i)
      text += "1 2 3 " + std::to_string(0.001 * i) + " " + std::to_string(i % 16) + "\n";
    write_text(folder / ("170000000" + std::to_string(cloud) + ".000000000.pcd"), text);
  }
  Log log;
  const auto recording = open_cloud_folder(folder / "", {}, log);
  const auto events = test::read_all(*recording);
  ASSERT_EQ(events.size(), 3U);
  const Scan& scan = *std::get<ScanPtr>(events[1]);
  EXPECT_TRUE(scan.has_point_times);
  EXPECT_EQ(scan.ring_count, 16);
  EXPECT_NEAR(scan.points[50].t_ns, 50e6, 100.0);
  EXPECT_NE(recording->topics()[0].conventions.find("offset in s"), std::string::npos);
}

}  // namespace
}  // namespace understory
