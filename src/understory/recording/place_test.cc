#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/compression.h"
#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/recording/clouds/cloud_folder.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/message_merger.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

// A recording that is opened again goes on where another reading of it stood.
namespace understory {
namespace {

using test::add_record;
using test::Bytes;
using test::data_folder;
using test::Drive;
using test::kHourStart;
using test::make_drive;
using test::make_ethernet;
using test::make_ip;
using test::make_udp;
using test::nmea_line;
using test::pcap_header;
using test::put;
using test::read_all;
using test::read_bytes;
using test::small_chunks;
using test::TemporaryFolder;
using test::velodyne_udp;
using test::write_bytes;
using test::write_drive;

using Open = std::function<std::unique_ptr<Recording>(Log&)>;

Open opening(const std::string& path) {
  return [path](Log& log) { return open_recording(path, {}, log); };
}

std::string saved_bytes(const Event& event) {
  BinaryWriter writer;
  put_event(writer, event);
  return writer.bytes();
}

std::string saved_bytes(const Rig& rig) {
  BinaryWriter writer;
  put_rig(writer, rig);
  return writer.bytes();
}

void expect_same_end(const Recording& a, const Recording& b) {
  EXPECT_EQ(a.format(), b.format());
  EXPECT_EQ(saved_bytes(a.rig()), saved_bytes(b.rig()));
  const std::vector<TopicReport> first = a.topics();
  const std::vector<TopicReport> second = b.topics();
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    const TopicReport& x = first[i];
    const TopicReport& y = second[i];
    EXPECT_EQ(std::tie(x.name, x.type, x.frame, x.role, x.conventions),
              std::tie(y.name, y.type, y.frame, y.role, y.conventions));
    EXPECT_EQ(std::tie(x.messages, x.first_stamp, x.last_stamp, x.longest_gap, x.backward_steps),
              std::tie(y.messages, y.first_stamp, y.last_stamp, y.longest_gap, y.backward_steps));
    EXPECT_EQ(
        std::tie(x.duplicates, x.unreadable, x.not_numbers, x.left_out, x.points, x.empty_points),
        std::tie(y.duplicates, y.unreadable, y.not_numbers, y.left_out, y.points, y.empty_points));
  }
}

// Stops after `count` events, and goes on in a second reading.
void expect_goes_on(const Open& open, const std::vector<Event>& events, const Recording& whole,
                    std::size_t count) {
  SCOPED_TRACE("after " + std::to_string(count) + " events");
  Log log;
  const auto first = open(log);
  for (std::size_t i = 0; i < count; ++i)
    ASSERT_TRUE(first->next());
  BinaryWriter writer;
  ASSERT_TRUE(first->save(writer));
  const auto second = open(log);
  BinaryReader reader(writer.bytes(), "place");
  second->load(reader);
  EXPECT_TRUE(reader.at_end());
  for (std::size_t i = count; i < events.size(); ++i) {
    const auto event = second->next();
    ASSERT_TRUE(event);
    ASSERT_EQ(saved_bytes(events[i]), saved_bytes(*event)) << "event " << i;
  }
  EXPECT_FALSE(second->next());
  expect_same_end(whole, *second);
}

void expect_goes_on(const Open& open) {
  Log log;
  const auto whole = open(log);
  const std::vector<Event> events = read_all(*whole);
  ASSERT_GT(events.size(), 3U);
  for (std::size_t count = 0; count < events.size(); count += 1 + events.size() / 9)
    expect_goes_on(open, events, *whole, count);
  expect_goes_on(open, events, *whole, events.size());
}

class Places : public ::testing::Test {
 protected:
  const TemporaryFolder folder_;
};

TEST_F(Places, OfMcap) {
  const std::string path = folder_ / "drive.mcap";
  write_drive(path, make_drive(4), small_chunks());
  expect_goes_on(opening(path));
}

// Its end is missing, and the index with it.
TEST_F(Places, OfMcapThatWasNotClosed) {
  const std::string path = folder_ / "drive.mcap";
  write_drive(path, make_drive(4), small_chunks());
  std::vector<std::uint8_t> bytes = read_bytes(path);
  bytes.resize(bytes.size() * 3 / 4);
  write_bytes(path, bytes);
  expect_goes_on(opening(path));
}

// The second half stands before the first: read in the order of the index.
TEST_F(Places, OfMcapOutOfOrder) {
  const std::string path = folder_ / "drive.mcap";
  Drive drive = make_drive(4);
  std::rotate(drive.events.begin(),
              drive.events.begin() + static_cast<std::ptrdiff_t>(drive.events.size() / 2),
              drive.events.end());
  write_drive(path, drive, small_chunks());
  expect_goes_on(opening(path));
}

// What was learnt on the way: an IMU and its place that come after the first scans.
TEST_F(Places, OfMcapWithLateSensors) {
  const std::string path = folder_ / "drive.mcap";
  Drive drive = make_drive(8);
  const TimeNs begin = event_time(drive.events.front());
  {
    McapWriter writer(path, small_chunks());
    bool placed = false;
    for (const Event& event : drive.events) {
      const bool late = event_time(event) >= begin + 5 * kNsPerSecond;
      if (event.index() != 0 && !late) continue;
      if (late && !placed) writer.set_rig(drive.rig);
      placed = placed || late;
      writer.write(event);
    }
  }
  std::vector<std::uint8_t> bytes = read_bytes(path);
  bytes.resize(bytes.size() - 400);  // without the index, which would tell at once
  write_bytes(path, bytes);
  expect_goes_on(opening(path));
}

TEST_F(Places, OfBags) {
  const std::filesystem::path samples =
      std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "fuzz/corpus";
  for (const char* name : {"rosbag/small_none.bag", "rosbag/small_bz2.bag", "rosbag/small_lz4.bag",
                           "db3/small.db3", "mcap/small_plain.mcap"}) {
    SCOPED_TRACE(name);
    expect_goes_on(opening(samples / name));
  }
  std::filesystem::copy_file(samples / "db3/small.db3", folder_ / "a_0.db3");
  write_bytes(folder_ / "a_1.mcap.zstd",
              compress(read_bytes(samples / "mcap/small_plain.mcap"), "zstd", 3));
  std::filesystem::copy_file(samples / "db3/small.db3", folder_ / "a_2.db3");
  expect_goes_on(opening(folder_.path()));
}

// A bag whose pages are damaged is read row by row from there on.
TEST_F(Places, OfDamagedBags) {
  const std::filesystem::path samples =
      std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "fuzz/corpus";
  for (const char* name : {"rosbag/small_lz4.bag", "db3/small.db3"}) {
    SCOPED_TRACE(name);
    std::vector<std::uint8_t> bytes = read_bytes(samples / name);
    bytes.resize(bytes.size() * 4 / 5);
    write_bytes(folder_ / "cut", bytes);
    Log log;
    if (read_all(*open_recording(folder_ / "cut", {}, log)).size() > 3)
      expect_goes_on(opening(folder_ / "cut"));
  }
}

// Damage anywhere: what is passed over before the place does not count again behind it.
TEST_F(Places, OfFilesWithFlippedBits) {
  const std::filesystem::path samples =
      std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "fuzz/corpus";
  Random random(11);
  int tried = 0;
  for (const char* name : {"rosbag/small_none.bag", "rosbag/small_lz4.bag", "db3/small.db3",
                           "mcap/small_plain.mcap", "mcap/small_zstd.mcap"}) {
    const std::vector<std::uint8_t> whole = read_bytes(samples / name);
    for (int trial = 0; trial < 80; ++trial) {
      SCOPED_TRACE(std::string(name) + ", trial " + std::to_string(trial));
      std::vector<std::uint8_t> bytes = whole;
      for (int flips = 0; flips < 4; ++flips) {
        const std::size_t at = 16 + random.below(bytes.size() - 16);
        bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1U << random.below(8)));
      }
      write_bytes(folder_ / "flipped", bytes);
      const Open open = opening(folder_ / "flipped");
      Log log;
      try {
        const auto recording = open(log);
        const std::vector<Event> events = read_all(*recording);
        expect_goes_on(open, events, *recording, events.size() / 2);
        ++tried;
      } catch (const InputError&) {
      }
    }
  }
  EXPECT_GT(tried, 200);
}

// Five turns, every packet in two parts, with a stray part in between that is never completed.
TEST_F(Places, OfCaptures) {
  Bytes file = pcap_header();
  for (int i = 0; i < 375; ++i) {
    const TimeNs stamp = kHourStart + i * 1'327'000LL;
    const Bytes udp = velodyne_udp(i);
    const Bytes head(udp.begin(), udp.begin() + 800);
    const Bytes tail(udp.begin() + 800, udp.end());
    const auto id = static_cast<std::uint16_t>(i);
    add_record(file, stamp, make_ethernet(make_ip(head, 0, true, id)));
    if (i % 50 == 3) add_record(file, stamp, make_ethernet(make_ip(tail, 800, false, 9999)));
    if (i % 40 == 1) add_record(file, stamp, make_ethernet(make_ip(make_udp(999, Bytes(48, 7)))));
    add_record(file, stamp, make_ethernet(make_ip(tail, 800, false, id)));
  }
  expect_goes_on([&](Log& log) { return open_pcap(bytes_in_memory(file, "test.pcap"), {}, log); });
}

TEST_F(Places, OfRealCaptures) {
  const std::filesystem::path data = data_folder() / "drivers";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no example data";
  for (const char* name :
       {"OS-1-128_v2.3.0_1024x10_lb_n3.pcap", "sample_velodyne_vlp16_gps.pcap"}) {
    SCOPED_TRACE(name);
    expect_goes_on(opening(data / name));
  }
}

void write_folder(const TemporaryFolder& folder) {
  std::string times;
  std::string imu = "timestamp,gx,gy,gz,ax,ay,az\n";
  for (int i = 0; i < 30; ++i) {
    Bytes bytes;
    for (int k = 0; k < 10; ++k)
      for (const float value : {1.0F + static_cast<float>(i), static_cast<float>(k), 1.0F, 0.5F})
        put(bytes, value);
    write_bytes(folder / (std::to_string(100 + i) + ".bin"), bytes);
    times += std::to_string(0.1 * i) + "\n";
    for (int k = 0; k < 4; ++k)
      imu += std::to_string(0.1 * i + 0.025 * k) + ",0,0,0.1,0,0," + std::to_string(9 + i) + "\n";
    if (i == 12) imu += "not a row\n";
  }
  std::ofstream(folder / "times.txt") << times;
  std::ofstream(folder / "imu.csv") << imu;
}

TEST_F(Places, OfFoldersOfClouds) {
  write_folder(folder_);
  std::string fixes = "timestamp,latitude_deg,longitude_deg,height_m\n";
  for (int i = 0; i < 6; ++i)
    fixes += std::to_string(0.5 * i) + ",47." + std::to_string(i) + ",8.5,400\n";
  std::ofstream(folder_ / "gnss.csv") << fixes;
  expect_goes_on(opening(folder_.path()));
}

TEST_F(Places, OfFoldersWithALogOfTheReceiver) {
  write_folder(folder_);
  std::ofstream log(folder_ / "receiver.nmea", std::ios::binary);
  for (int i = 0; i < 3; ++i) {
    const std::string time = "00000" + std::to_string(i) + ".00";
    log << nmea_line("GPRMC," + time + ",A,4717.11,N,00833.91,E,0.0,77.5,010170,,,A")
        << nmea_line("GPGGA," + time + ",4717.11,N,00833.91,E,4,12,0.9,499.6,M,48.0,M,,");
  }
  log.close();
  expect_goes_on(opening(folder_.path()));
}

TEST_F(Places, AnotherRecordingIsRefused) {
  write_drive(folder_ / "long.mcap", make_drive(4), small_chunks());
  write_drive(folder_ / "short.mcap", make_drive(1), small_chunks());
  Log log;
  const auto first = open_recording(folder_ / "long.mcap", {}, log);
  for (int i = 0; i < 400; ++i)
    ASSERT_TRUE(first->next());
  BinaryWriter writer;
  ASSERT_TRUE(first->save(writer));
  const auto second = open_recording(folder_ / "short.mcap", {}, log);
  BinaryReader reader(writer.bytes(), "place");
  EXPECT_THROW(second->load(reader), InputError);
}

// Found by fuzzing: a channel was described only behind a chunk, so that it was known when the
// chunk was read again. Messages came that had been passed over.
TEST(MessageMerger, ABlockThatHoldsMoreThanBeforeIsNotGoneOnWith) {
  const auto block = [](std::size_t messages) {
    MessageBlock made;
    made.place = 7;
    made.entries.resize(messages);
    return made;
  };
  MessageMerger first;
  first.add(block(2));
  RawMessage message;
  ASSERT_TRUE(first.next(message));
  const auto progress = first.progress();
  ASSERT_EQ(progress.size(), 1U);
  for (const std::size_t messages : {2U, 3U}) {
    MessageMerger second;
    second.add(block(messages));
    EXPECT_EQ(second.pass(progress[0]), messages == 2U);
  }
}

}  // namespace
}  // namespace understory
