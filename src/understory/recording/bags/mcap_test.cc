#include <gtest/gtest.h>

#include "understory/recording/bags/mcap_format.h"
#include "understory/recording/bags/mcap_reader.h"
#include "understory/recording/messages/arrival_times.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::all_warnings;
using test::count_of;
using test::Drive;
using test::expect_same;
using test::kStart;
using test::make_drive;
using test::make_scan;
using test::read_all;
using test::read_bytes;
using test::small_chunks;
using test::TemporaryFolder;
using test::write_bytes;
using test::write_drive;

class McapCompressions : public ::testing::TestWithParam<McapCompression> {};

INSTANTIATE_TEST_SUITE_P(All, McapCompressions,
                         ::testing::Values(McapCompression::kNone, McapCompression::kLz4,
                                           McapCompression::kZstd));

TEST_P(McapCompressions, GivesBackWhatWasWritten) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  const Drive drive = make_drive(3);
  write_drive(path, drive, small_chunks(GetParam()));

  Log log;
  const auto recording = open_recording(path, {}, log);
  const std::vector<Event> events = read_all(*recording);
  EXPECT_EQ(all_warnings(log), "");
  ASSERT_EQ(events.size(), drive.events.size());
  for (std::size_t i = 0; i < events.size(); ++i)
    expect_same(drive.events[i], events[i]);

  const Rig& rig = recording->rig();
  EXPECT_EQ(rig.body_frame, "base_link");
  EXPECT_EQ(rig.lidar_model, "VLP-16");
  EXPECT_EQ(rig.lidar_extrinsic_source, "/tf_static");
  EXPECT_LT(right_difference(rig.body_from_lidar, drive.rig.body_from_lidar).norm(), 1e-14);
  ASSERT_TRUE(rig.body_from_imu && rig.body_from_gnss);
  EXPECT_LT(right_difference(*rig.body_from_imu, *drive.rig.body_from_imu).norm(), 1e-14);
  EXPECT_LT(right_difference(*rig.body_from_gnss, *drive.rig.body_from_gnss).norm(), 1e-14);
}

// Regression: what began after the first seconds got no extrinsics and was never used.
TEST_P(McapCompressions, SensorsThatBeginLaterHaveTheirPlaceFromTheIndex) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  Drive drive = make_drive(8);
  const TimeNs begin = event_time(drive.events.front());
  std::erase_if(drive.events, [&](const Event& event) {
    return event.index() != 0 && event_time(event) < begin + 5 * kNsPerSecond;
  });
  write_drive(path, drive, small_chunks(GetParam()));
  Log log;
  const auto recording = open_recording(path, {}, log);
  ASSERT_TRUE(recording->rig().body_from_imu && recording->rig().body_from_gnss);
  EXPECT_LT(right_difference(*recording->rig().body_from_imu, *drive.rig.body_from_imu).norm(),
            1e-14);
  EXPECT_EQ(read_all(*recording).size(), drive.events.size());
  EXPECT_EQ(all_warnings(log), "");
}

// The same of the second antenna, whose place alone is lacking at the start.
TEST_P(McapCompressions, TheSecondAntennaHasItsLatePlaceFromTheIndex) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  Drive drive = make_drive(8);
  const TimeNs begin = event_time(drive.events.front());
  const Pose second(Eigen::Quaterniond::Identity(), {1.0, 0.25, 2.0});
  {
    McapWriter writer(path, small_chunks(GetParam()));
    writer.set_rig(drive.rig);
    for (Event& event : drive.events) {
      if (!drive.rig.body_from_second_gnss && event_time(event) > begin + 5 * kNsPerSecond) {
        drive.rig.body_from_second_gnss = second;
        writer.set_rig(drive.rig);
      }
      if (auto* fix = std::get_if<GnssFix>(&event)) fix->heading_deg = 77.0;
      writer.write(event);
    }
  }
  Log log;
  const auto recording = open_recording(path, {}, log);
  ASSERT_TRUE(recording->rig().body_from_second_gnss);
  EXPECT_LT(right_difference(*recording->rig().body_from_second_gnss, second).norm(), 1e-14);
  EXPECT_EQ(recording->rig().second_gnss_extrinsic_source, "/tf_static");
  EXPECT_EQ(all_warnings(log), "");
}

// Cuts the file at many places: nothing but a prefix of the events may come out, and all of the
// chunks that are whole.
TEST_P(McapCompressions, ReadsTruncatedFilesUpToTheCut) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  const Drive drive = make_drive(1);
  write_drive(path, drive, small_chunks(GetParam()));
  const std::vector<std::uint8_t> whole = read_bytes(path);
  std::size_t most = 0;
  for (std::size_t cut = 9; cut < whole.size(); cut += 1 + whole.size() / 97) {
    write_bytes(path, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)});
    Log log;
    const auto recording = open_recording(path, {}, log);
    const std::vector<Event> events = read_all(*recording);
    ASSERT_LE(events.size(), drive.events.size());
    for (std::size_t i = 0; i < events.size(); ++i) {
      // Without the extrinsics and the ring count, which may be behind the cut, all is the same.
      ASSERT_EQ(event_time(events[i]), event_time(drive.events[i])) << "cut at " << cut;
    }
    EXPECT_GE(count_of(log, "recording.truncated") + count_of(log, "recording.unfinished"), 1U)
        << "cut at " << cut;
    EXPECT_GE(events.size(), most) << "cut at " << cut;
    most = events.size();
  }
  EXPECT_EQ(most, drive.events.size());
}

// Whatever bit is flipped in a chunk's data: its checksum tells, only that chunk is lost, and no
// value that was not written comes out.
TEST_P(McapCompressions, FlippedBitsInDataLoseOneChunkOnly) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  const Drive drive = make_drive(2);
  write_drive(path, drive, small_chunks(GetParam()));
  const std::vector<std::uint8_t> whole = read_bytes(path);
  Random random(7);
  std::size_t fewest = drive.events.size();
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<std::uint8_t> bytes = whole;
    const std::size_t at = 8 + random.below(bytes.size() - 16);
    bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1U << random.below(8)));
    write_bytes(path, bytes);
    Log log;
    const auto recording = open_recording(path, {}, log);
    const std::vector<Event> events = read_all(*recording);
    fewest = std::min(fewest, events.size());
    std::size_t next = 0;
    for (const Event& event : events) {
      while (next < drive.events.size() && (event_time(drive.events[next]) != event_time(event) ||
                                            drive.events[next].index() != event.index()))
        ++next;
      ASSERT_LT(next, drive.events.size()) << "an event that was not written, byte " << at;
      if (!std::holds_alternative<ScanPtr>(event)) expect_same(drive.events[next], event);
    }
  }
  EXPECT_GT(fewest, drive.events.size() / 2);
}

TEST(Mcap, ReadsWithoutSummaryWhatIsInTheDataSection) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  const Drive drive = make_drive(2);
  write_drive(path, drive, small_chunks(McapCompression::kZstd));
  std::vector<std::uint8_t> bytes = read_bytes(path);
  // The footer's reference to the summary set to "there is none".
  const std::size_t footer = bytes.size() - 8 - 20;
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(footer),
            bytes.begin() + static_cast<std::ptrdiff_t>(footer) + 20, std::uint8_t{0});
  write_bytes(path, bytes);
  Log log;
  const auto recording = open_recording(path, {}, log);
  EXPECT_EQ(read_all(*recording).size(), drive.events.size());
  EXPECT_EQ(all_warnings(log), "");
  EXPECT_EQ(recording->rig().lidar_model, "VLP-16");
}

// The structure itself is destroyed in the middle of the file: reading goes on behind it.
TEST(Mcap, FindsTheNextChunkAfterDamage) {
  const TemporaryFolder folder;
  const std::string path = folder / "drive.mcap";
  const Drive drive = make_drive(3);
  write_drive(path, drive, small_chunks(McapCompression::kLz4));
  std::vector<std::uint8_t> bytes = read_bytes(path);
  const auto third = static_cast<std::ptrdiff_t>(bytes.size() / 3);
  std::fill(bytes.begin() + third, bytes.begin() + third + 3000, std::uint8_t{0xEE});
  for (const bool with_summary : {true, false}) {
    if (!with_summary) bytes.resize(bytes.size() - 20);
    write_bytes(path, bytes);
    Log log;
    const auto recording = open_recording(path, {}, log);
    const std::vector<Event> events = read_all(*recording);
    EXPECT_GT(events.size(), drive.events.size() * 3 / 4);
    EXPECT_EQ(event_time(events.back()), event_time(drive.events.back()));
    EXPECT_GE(count_of(log, "recording.damaged"), 1U);
    const std::string text = all_warnings(log);
    EXPECT_NE(text.find("drive.mcap: at byte "), std::string::npos) << text;
  }
}

// Two writers' chunks interleaved in time, as merging tools leave them.
TEST(Mcap, MergesChunksThatOverlapInTime) {
  const TemporaryFolder folder;
  const std::string path = folder / "merged.mcap";
  McapWriterOptions options;
  options.chunk_size_bytes = 8'000;
  McapWriter writer(path, options);
  // All IMU samples of a second first, then those that lie between them.
  for (int phase = 0; phase < 2; ++phase) {
    for (int i = 0; i < 200; ++i) {
      ImuSample sample;
      sample.stamp = kStart + i * 10'000'000LL + phase * 5'000'000LL;
      writer.write(sample);
    }
  }
  writer.finish();
  Log log;
  const auto recording = open_recording(path, {}, log);
  const std::vector<Event> events = read_all(*recording);
  ASSERT_EQ(events.size(), 400U);
  for (std::size_t i = 1; i < events.size(); ++i)
    ASSERT_GT(event_time(events[i]), event_time(events[i - 1]));
}

TEST(Mcap, SaysWhatIsWrongWithTheFile) {
  const TemporaryFolder folder;
  Log log;
  EXPECT_THROW((void)open_recording(folder / "none.mcap", {}, log), InputError);
  write_bytes(folder / "empty.mcap", {});
  EXPECT_THROW((void)open_recording(folder / "empty.mcap", {}, log), InputError);
  write_bytes(folder / "other.mcap", std::vector<std::uint8_t>(1000, 'x'));
  try {
    (void)open_recording(folder / "other.mcap", {}, log);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("expected"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("other.mcap"), std::string::npos);
  }
}

TEST(Mcap, AFullDiskIsAnOutputError) {
  ASSERT_TRUE(std::filesystem::exists("/dev/full"));
  EXPECT_THROW(write_drive("/dev/full", make_drive(1)), OutputError);
  EXPECT_THROW(McapWriter("/no/such/folder/x.mcap"), OutputError);
}

// Regression: a copy had the stamps as log times, and what was late or ahead came in another order.
TEST(Mcap, KeepsTheLogTimesThatAreGiven) {
  const TemporaryFolder folder;
  const std::string path = folder / "copy.mcap";
  const std::vector<TimeNs> arrivals = {kStart + 700, kStart + 900, kStart + 1'000'000'000};
  {
    McapWriter writer(path);
    for (const TimeNs arrival : arrivals) {
      ImuSample sample;
      sample.stamp = 2 * kStart - arrival;
      writer.write(sample, arrival);
    }
  }
  Log log;
  const auto recording = open_recording(path, {}, log);
  for (const TimeNs arrival : arrivals) {
    const auto event = recording->next();
    ASSERT_TRUE(event);
    EXPECT_EQ(event_time(*event), 2 * kStart - arrival);
    EXPECT_EQ(dynamic_cast<const ArrivalTimes&>(*recording).arrival(), arrival);
  }
}

// The positions of a second antenna come back as headings of the first one's.
TEST(Mcap, KeepsThePositionsOfASecondAntenna) {
  const TemporaryFolder folder;
  const std::string path = folder / "two_receivers.mcap";
  Drive drive = make_drive(6);
  drive.rig.body_from_second_gnss = Pose(Eigen::Quaterniond::Identity(), {1.5, 0.0, 2.0});
  {
    McapWriter writer(path);
    writer.set_rig(drive.rig);
    for (const Event& event : drive.events) {
      writer.write(event);
      if (const auto* fix = std::get_if<GnssFix>(&event)) {
        GnssFix second = *fix;
        second.longitude_deg += 1.5 / 75'900.0;  // east
        writer.write_second_position(second, fix->stamp);
      }
    }
  }
  Log log;
  const auto recording = open_recording(path, {}, log);
  std::size_t headings = 0;
  for (const Event& event : read_all(*recording)) {
    const auto* fix = std::get_if<GnssFix>(&event);
    if (fix == nullptr) continue;
    EXPECT_EQ(fix->hdop, 1.25);
    if (std::isnan(fix->heading_deg)) continue;
    EXPECT_NEAR(fix->heading_deg, 90.0, 1e-3);
    ++headings;
  }
  EXPECT_EQ(headings, 8U);  // four pairs before the first
  EXPECT_EQ(all_warnings(log), "");
}

TEST(Mcap, KeepsTheHeadingOfASecondAntenna) {
  const TemporaryFolder folder;
  const std::string path = folder / "two_antennas.mcap";
  Drive drive = make_drive(3);
  drive.rig.body_from_second_gnss = Pose(Eigen::Quaterniond::Identity(), {1.0, 0.25, 2.0});
  int number = 0;
  for (Event& event : drive.events) {
    auto* fix = std::get_if<GnssFix>(&event);
    if (fix == nullptr || ++number == 2) continue;  // one has none
    fix->heading_deg = 359.5 - number;
    if (number != 3) fix->heading_sd_deg = 0.25;
  }
  {
    McapWriter writer(path);
    writer.set_rig(drive.rig);
    for (const Event& event : drive.events)
      writer.write(event);
  }
  Log log;
  const auto recording = open_recording(path, {}, log);
  std::vector<GnssFix> fixes;
  for (const Event& event : read_all(*recording)) {
    if (const auto* fix = std::get_if<GnssFix>(&event)) fixes.push_back(*fix);
  }
  ASSERT_EQ(fixes.size(), 6U);
  EXPECT_EQ(fixes[0].heading_deg, 358.5);
  EXPECT_EQ(fixes[0].heading_sd_deg, 0.25);
  EXPECT_EQ(fixes[0].hdop, 1.25);
  EXPECT_TRUE(std::isnan(fixes[1].heading_deg));
  EXPECT_EQ(fixes[2].heading_deg, 356.5);
  EXPECT_TRUE(std::isnan(fixes[2].heading_sd_deg));
  ASSERT_TRUE(recording->rig().body_from_second_gnss);
  EXPECT_LT(
      (recording->rig().body_from_second_gnss->translation() - Eigen::Vector3d(1, 0.25, 2)).norm(),
      1e-12);
  EXPECT_EQ(recording->rig().second_gnss_extrinsic_source, "/tf_static");
  EXPECT_TRUE(log.warnings().empty()) << all_warnings(log);
}

TEST(Mcap, KeepsSecondReturnsAndMissingTimes) {
  const TemporaryFolder folder;
  const std::string path = folder / "dual.mcap";
  Scan dual = make_scan(kStart, 100, 1);
  dual.points[7].return_index = 1;
  dual.points.back().ring = 15;
  Scan untimed = make_scan(kStart, 100, 1);
  untimed.has_point_times = false;
  for (ScanPoint& point : untimed.points)
    point.t_ns = 0;
  for (const Scan& scan : {dual, untimed}) {
    {
      McapWriter writer(path);
      writer.write(std::make_shared<const Scan>(scan));
    }
    Log log;
    const auto recording = open_recording(path, {}, log);
    const std::vector<Event> events = read_all(*recording);
    ASSERT_EQ(events.size(), 1U);
    expect_same(scan, *std::get<ScanPtr>(events[0]));
    EXPECT_EQ(count_of(log, "recording.no_point_times"), scan.has_point_times ? 0U : 1U);
  }
}

}  // namespace
}  // namespace understory
