#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "understory/recording/bags/compression.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/messages/message_recording.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::all_warnings;
using test::count_of;
using test::read_all;
using test::read_bytes;
using test::TemporaryFolder;
using test::write_bytes;

// Small bags that the Python package rosbags wrote: 3 clouds of 20 points, 15 IMU samples, a fix
// and /tf_static.
std::string sample(const std::string& name) {
  return std::string(UNDERSTORY_SOURCE_DIR) + "/fuzz/corpus/" + name;
}

// TMPDIR for as long as it lives.
class TemporaryFolderSetting {
 public:
  explicit TemporaryFolderSetting(const std::filesystem::path& path) {
    const char* before = std::getenv("TMPDIR");
    if (before != nullptr) before_ = before;
    std::filesystem::create_directories(path);
    ::setenv("TMPDIR", path.c_str(), 1);
  }
  ~TemporaryFolderSetting() {
    before_.empty() ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", before_.c_str(), 1);
  }
  TemporaryFolderSetting(const TemporaryFolderSetting&) = delete;
  TemporaryFolderSetting& operator=(const TemporaryFolderSetting&) = delete;

 private:
  std::string before_;
};

class Bags : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(All, Bags,
                         ::testing::Values("rosbag/small_none.bag", "rosbag/small_bz2.bag",
                                           "rosbag/small_lz4.bag", "db3/small.db3",
                                           "mcap/small_plain.mcap"));

TEST_P(Bags, AreReadAsTheyWereWritten) {
  Log log;
  const auto recording = open_recording(sample(GetParam()), {}, log);
  const std::vector<Event> events = read_all(*recording);
  EXPECT_EQ(all_warnings(log), "");
  ASSERT_EQ(events.size(), 19U);
  int scans = 0;
  for (const Event& event : events) {
    if (const auto* sample = std::get_if<ImuSample>(&event)) {
      EXPECT_EQ(sample->angular_rate, Eigen::Vector3d(0.1, 0.2, 0.3));
      EXPECT_EQ(sample->specific_force, Eigen::Vector3d(0.0, 0.0, 9.8));
      EXPECT_FALSE(sample->orientation);
    } else if (const auto* fix = std::get_if<GnssFix>(&event)) {
      EXPECT_EQ(fix->latitude_deg, 47.0);
      EXPECT_EQ(fix->height_m, 500.0);
      EXPECT_EQ(fix->quality, 1);
      EXPECT_FALSE(fix->covariance.allFinite());
    } else {
      const Scan& scan = *std::get<ScanPtr>(event);
      ASSERT_EQ(scan.points.size(), 20U);
      EXPECT_NEAR(to_seconds(scan.stamp), 1000.0 + 0.1 * scans++, 1e-6);
      EXPECT_EQ(scan.ring_count, 16);
      for (int i = 0; i < 20; ++i) {
        EXPECT_EQ(scan.points[i].x, 1.0F + static_cast<float>(i));
        EXPECT_EQ(scan.points[i].ring, i % 16);
        EXPECT_NEAR(scan.points[i].t_ns, 1e8 * i / 19, 10.0);
      }
    }
  }
  EXPECT_EQ(scans, 3);
  const Rig& rig = recording->rig();
  EXPECT_EQ(rig.body_frame, "base_link");
  EXPECT_EQ(rig.body_from_lidar.translation(), Eigen::Vector3d(0.0, 0.0, 1.0));
  ASSERT_TRUE(rig.body_from_imu);
}

// Wherever the file is cut, what comes out is a beginning of what is in it, or an InputError.
TEST_P(Bags, TruncatedOnesGiveABeginning) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> whole = read_bytes(sample(GetParam()));
  const std::string path = folder / "cut";
  std::size_t readable = 0;
  for (std::size_t cut = 1; cut < whole.size(); cut += 1 + whole.size() / 61) {
    write_bytes(path, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)});
    Log log;
    try {
      const auto recording = open_recording(path, {}, log);
      const std::vector<Event> events = read_all(*recording);
      EXPECT_LE(events.size(), 19U);
      EXPECT_FALSE(log.warnings().empty()) << "cut at " << cut;
      readable += events.empty() ? 0 : 1;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos);
    }
  }
  // SQLite keeps its tables' roots at the front and the rows behind them.
  EXPECT_GT(readable, 5U);
}

TEST_P(Bags, FlippedBitsAreSurvived) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> whole = read_bytes(sample(GetParam()));
  const std::string path = folder / "flipped";
  Random random(11);
  std::size_t total = 0;
  for (int trial = 0; trial < 150; ++trial) {
    std::vector<std::uint8_t> bytes = whole;
    const std::size_t at = 16 + random.below(bytes.size() - 16);
    bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1U << random.below(8)));
    write_bytes(path, bytes);
    Log log;
    try {
      const auto recording = open_recording(path, {}, log);
      total += read_all(*recording).size();
    } catch (const InputError&) {
    }
  }
  EXPECT_GT(total, 150U * 19U / 2U);  // most of what is in most of them
}

TEST(Ros2Bag, ReadsAFolderInParts) {
  const TemporaryFolder folder;
  std::filesystem::copy_file(sample("db3/small.db3"), folder / "a_0.db3");
  std::filesystem::copy_file(sample("db3/small.db3"), folder / "a_1.db3");
  write_bytes(folder / "a_2.db3", std::vector<std::uint8_t>(500, 'x'));
  Log log;
  const auto recording =
      open_recording(std::filesystem::path(folder / "a_0.db3").parent_path(), {}, log);
  EXPECT_EQ(read_all(*recording).size(), 38U);
  EXPECT_EQ(count_of(log, "recording.damaged"), 1U) << all_warnings(log);
  EXPECT_FALSE(recording->next());
}

void write_packed(const std::string& path, const std::string& unpacked) {
  write_bytes(path, compress(read_bytes(unpacked), "zstd", 3));
}

// Bug: each part was unpacked to look ahead, and again to be read.
TEST(Ros2Bag, UnpacksEachPartOnce) {
  const TemporaryFolder folder;
  write_packed(folder / "a_0.db3.zstd", sample("db3/small.db3"));
  write_packed(folder / "a_1.mcap.zstd", sample("mcap/small_plain.mcap"));
  const auto unpacked = std::make_shared<UnpackedParts>();
  const std::string path = folder.path().string();
  Log log;
  const auto recording = open_messages(
      path, [&](Log& sink) { return read_ros2_bag(path, unpacked, sink); }, {}, log);
  EXPECT_EQ(read_all(*recording).size(), 38U);
  EXPECT_EQ(all_warnings(log), "");
  EXPECT_EQ(unpacked->unpacked(), 2);
  // And one such file by itself.
  const auto one = open_recording(folder / "a_1.mcap.zstd", {}, log);
  EXPECT_EQ(read_all(*one).size(), 19U);
  EXPECT_EQ(all_warnings(log), "");
}

// Copies have no names: nothing is left in the folder for temporary files, whatever happens.
TEST(Ros2Bag, UnpacksWhereItIsToldAndLeavesNothing) {
  const TemporaryFolder folder;
  const TemporaryFolderSetting setting(folder / "scratch");
  const auto left = [&] {
    const std::filesystem::directory_iterator entries(folder / "scratch");
    return std::distance(begin(entries), end(entries));
  };
  const std::string packed = folder / "a.db3.zstd";
  write_packed(packed, sample("db3/small.db3"));
  Log log;
  {
    const auto recording = open_recording(packed, {}, log);
    EXPECT_TRUE(recording->next());
    EXPECT_EQ(left(), 0);
  }
  std::vector<std::uint8_t> cut = read_bytes(packed);
  cut.resize(cut.size() / 2);
  write_bytes(packed, cut);
  try {
    (void)read_all(*open_recording(packed, {}, log));
    EXPECT_GT(count_of(log, "recording.damaged"), 0U);
  } catch (const InputError&) {
  }
  EXPECT_EQ(left(), 0);
  std::filesystem::remove(folder / "scratch");
  EXPECT_THROW((void)open_recording(packed, {}, log), OutputError);
}

// The chunk of the sample twice, the first time with its record's head destroyed.
TEST(Rosbag, GoesOnBehindADamagedChunk) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> whole = read_bytes(sample("rosbag/small_lz4.bag"));
  const std::string text(whole.begin(), whole.end());
  std::uint64_t index = 0;
  std::memcpy(&index, whole.data() + text.find("index_pos=") + 10, 8);
  constexpr std::ptrdiff_t kChunk = 13 + 4096;  // behind magic and bag header
  const auto end = whole.begin() + static_cast<std::ptrdiff_t>(index);
  for (const std::size_t damaged : {std::size_t{kChunk}, text.find("op=\x05", kChunk) + 3}) {
    std::vector<std::uint8_t> bytes(whole.begin(), end);
    bytes.insert(bytes.end(), whole.begin() + kChunk, end);
    bytes[damaged] = 0xFF;
    write_bytes(folder / "x.bag", bytes);
    Log log;
    const auto recording = open_recording(folder / "x.bag", {}, log);
    EXPECT_EQ(read_all(*recording).size(), 19U);
    EXPECT_EQ(count_of(log, "recording.damaged"), 1U) << all_warnings(log);
    EXPECT_NE(all_warnings(log).find("x.bag: at byte 4109"), std::string::npos);
  }
}

}  // namespace
}  // namespace understory
