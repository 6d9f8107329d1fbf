#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/messages/livox_sensor.h"
#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/message_recording.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/recording/messages/stored_messages_test_support.h"
#include "understory/recording/recording_test_support.h"

namespace understory {
namespace {

using test::all_warnings;
using test::bytes_of;
using test::channel;
using test::count_of;
using test::expect_same;
using test::kStart;
using test::make_scan;
using test::read_all;
using test::Stored;
using test::StoredSource;
using test::TemporaryFolder;

constexpr const char* kFirst = "livox_ros_driver/CustomMsg";
constexpr const char* kSecond = "livox_ros_driver2/msg/CustomMsg";
constexpr TimeNs kFrame = 100'000'000;

// Bytes of a message, put together by hand from the fields of CustomMsg.msg and CustomPoint.msg.
struct HandMade {
  Serialization serialization = Serialization::kRos1;
  std::string frame = "livox_frame";
  TimeNs stamp = kStart;
  std::uint8_t lidar_id = 0;
  int points = 100;
  std::uint32_t step_ns = 900'000;
  int lines = 4;
  std::uint8_t tag = 0;
  int backward = -1;  // this point comes before the one before it

  [[nodiscard]] std::vector<std::uint8_t> bytes() const {
    std::vector<std::uint8_t> out;
    const bool ros1 = serialization == Serialization::kRos1;
    const auto put = [&](auto value) {
      while (!ros1 && (out.size() % sizeof(value)) != 0)
        out.push_back(0xAA);
      std::uint8_t raw[sizeof(value)];
      std::memcpy(raw, &value, sizeof(value));
      out.insert(out.end(), raw, raw + sizeof(value));
    };
    if (ros1) put(std::uint32_t{7});  // seq
    put(static_cast<std::uint32_t>(stamp / kNsPerSecond));
    put(static_cast<std::uint32_t>(stamp % kNsPerSecond));
    put(static_cast<std::uint32_t>(frame.size() + (ros1 ? 0 : 1)));
    out.insert(out.end(), frame.begin(), frame.end());
    if (!ros1) out.push_back(0);
    put(static_cast<std::uint64_t>(stamp));
    put(static_cast<std::uint32_t>(points));
    put(lidar_id);
    for (int i = 0; i < 3; ++i)
      put(std::uint8_t{0});
    put(static_cast<std::uint32_t>(points));
    for (int i = 0; i < points; ++i) {
      const int place = i == backward ? i - 2 : i;
      put(static_cast<std::uint32_t>(place) * step_ns);
      put(1.0F + static_cast<float>(i));
      put(-2.0F);
      put(0.5F * static_cast<float>(i));
      put(static_cast<std::uint8_t>(i));
      put(tag);
      put(static_cast<std::uint8_t>(i % lines));
    }
    if (!ros1) out.insert(out.begin(), {0, 1, 0, 0});
    return out;
  }
};

std::vector<Stored> frames_of(HandMade made, const std::string& type, int count = 12) {
  const auto topic = channel("/livox/lidar", type, made.serialization);
  std::vector<Stored> messages;
  for (int i = 0; i < count; ++i) {
    made.stamp = kStart + i * kFrame;
    messages.push_back({topic, made.stamp + kFrame, made.bytes()});
  }
  return messages;
}

std::unique_ptr<Recording> open(const std::vector<Stored>& messages, Log& log) {
  return open_messages(
      "x.bag", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
}

std::vector<ScanPtr> scans_of(Recording& recording) {
  std::vector<ScanPtr> scans;
  for (const Event& event : read_all(recording)) {
    if (const auto* scan = std::get_if<ScanPtr>(&event)) scans.push_back(*scan);
  }
  return scans;
}

TEST(Livox, ReadsTheBytesOfBothSerialisations) {
  for (const Serialization serialization : {Serialization::kRos1, Serialization::kCdr}) {
    HandMade made;
    made.serialization = serialization;
    const std::vector<Stored> messages = frames_of(made, kSecond);
    Log log;
    const auto recording = open(messages, log);
    const std::vector<ScanPtr> scans = scans_of(*recording);
    ASSERT_EQ(scans.size(), 12U);
    const Scan& scan = *scans[3];
    EXPECT_EQ(scan.stamp, kStart + 3 * kFrame);
    EXPECT_EQ(scan.ring_count, 0);
    EXPECT_TRUE(scan.has_point_times);
    ASSERT_EQ(scan.points.size(), 100U);
    for (int i = 0; i < 100; ++i) {
      const ScanPoint& point = scan.points[static_cast<std::size_t>(i)];
      EXPECT_EQ(point.x, 1.0F + static_cast<float>(i));
      EXPECT_EQ(point.y, -2.0F);
      EXPECT_EQ(point.z, 0.5F * static_cast<float>(i));
      EXPECT_EQ(point.intensity, static_cast<float>(i));
      EXPECT_EQ(point.ring, i % 4);
      EXPECT_EQ(point.t_ns, 900'000U * static_cast<unsigned>(i));
    }
    EXPECT_TRUE(log.warnings().empty()) << all_warnings(log);
  }
}

TEST(Livox, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  Scan scan = make_scan(kStart, 333, 5);
  scan.ring_count = 0;
  for (ScanPoint& point : scan.points) {
    point.ring %= 4;
    point.tag = static_cast<std::uint8_t>(point.ring == 2 ? 0x12 : 0);
  }
  McapWriterOptions options;
  options.livox = true;
  McapWriter writer(folder / "a.mcap", options);
  for (int i = 0; i < 10; ++i) {
    scan.stamp = kStart + i * kFrame;
    writer.write(ScanPtr(std::make_shared<Scan>(scan)));
  }
  writer.finish();
  Log log;
  const auto recording = open_recording(folder / "a.mcap", {}, log);
  const std::vector<ScanPtr> scans = scans_of(*recording);
  ASSERT_EQ(scans.size(), 10U);
  scan.stamp = kStart + 9 * kFrame;
  expect_same(*scans[9], scan);
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    EXPECT_EQ(scans[9]->points[i].tag, scan.points[i].tag);
  EXPECT_EQ(recording->topics().front().name, "/livox/lidar");
  // As PointCloud2 the tag is a field of its own.
  const ByteBuffer cloud = encode_point_cloud2(scan);
  const auto again = decode_point_cloud2(MessageReader(cloud.span(), Serialization::kCdr));
  ASSERT_TRUE(again);
  const auto layout = CloudLayout::find(*again);
  TimeConvention convention;
  convention.kind = TimeConvention::Kind::kOffset;
  const ConvertedCloud converted = convert_cloud(*again, *layout, convention);
  EXPECT_EQ(converted.scan->points[2].tag, scan.points[2].tag);
  EXPECT_NE(converted.scan->points[2].tag, 0);
}

TEST(Livox, NamesOffsetsThatAreAllZero) {
  HandMade made;
  made.step_ns = 0;
  const std::vector<Stored> messages = frames_of(made, kFirst);
  Log log;
  const auto recording = open(messages, log);
  EXPECT_FALSE(scans_of(*recording).front()->has_point_times);
  EXPECT_EQ(count_of(log, "recording.no_point_times"), 1U) << all_warnings(log);
}

TEST(Livox, NamesASingleFrameWhoseOffsetsAreAllZero) {
  HandMade made;
  std::vector<Stored> messages = frames_of(made, kSecond, 40);
  made.step_ns = 0;
  made.stamp = kStart + 40 * kFrame;
  messages.push_back({messages.front().channel, made.stamp + kFrame, made.bytes()});
  Log log;
  const auto recording = open(messages, log);
  const std::vector<ScanPtr> scans = scans_of(*recording);
  EXPECT_TRUE(scans[39]->has_point_times);
  EXPECT_FALSE(scans[40]->has_point_times);
  EXPECT_EQ(count_of(log, "recording.same_point_times"), 1U) << all_warnings(log);
}

TEST(Livox, NamesOffsetsThatRunBackwards) {
  HandMade made;
  made.backward = 50;
  const std::vector<Stored> messages = frames_of(made, kSecond);
  Log log;
  const auto recording = open(messages, log);
  const std::vector<ScanPtr> scans = scans_of(*recording);
  EXPECT_EQ(scans.front()->points.size(), 100U);
  EXPECT_EQ(scans.front()->points[50].t_ns, 48U * 900'000U);
  EXPECT_EQ(count_of(log, "recording.backward_point_times"), 12U) << all_warnings(log);
}

TEST(Livox, LeavesOutASecondSensorOnTheTopic) {
  HandMade made;
  std::vector<Stored> messages = frames_of(made, kSecond);
  made.lidar_id = 3;
  made.points = 20;
  const std::vector<Stored> other = frames_of(made, kSecond);
  std::vector<Stored> both;
  for (std::size_t i = 0; i < other.size(); ++i) {
    both.push_back(other[i]);
    both.push_back(messages[i]);
  }
  Log log;
  const auto recording = open(both, log);
  const std::vector<ScanPtr> scans = scans_of(*recording);
  ASSERT_EQ(scans.size(), 12U);
  EXPECT_EQ(scans.front()->points.size(), 100U);
  EXPECT_EQ(count_of(log, "recording.other_frames"), 12U) << all_warnings(log);
  EXPECT_EQ(recording->topics().front().left_out, 12U);
}

// Bits 4 and 5 number the returns with the first driver; with the second one they are a mark.
TEST(Livox, TellsReturnsByTheTag) {
  HandMade made;
  made.lines = 6;
  made.tag = 0x20;
  Log log;
  EXPECT_EQ(scans_of(*open(frames_of(made, kFirst), log)).front()->points[5].return_index, 1);
  const ScanPtr second = scans_of(*open(frames_of(made, kSecond), log)).front();
  EXPECT_EQ(second->points[5].return_index, 0);
  EXPECT_EQ(second->points[5].tag, 0x20);
  EXPECT_EQ(livox_return(0x10), 0);
  EXPECT_EQ(livox_return(0x00), 0);
  EXPECT_EQ(livox_return(0x3F), 2);
}

std::vector<Stored> with_imu(std::vector<Stored> messages) {
  const auto topic = channel("/livox/imu", "sensor_msgs/msg/Imu");
  for (int i = 0; i < 300; ++i) {
    ImuSample sample;
    sample.stamp = kStart + i * 5'000'000LL;
    sample.specific_force = {0.0, 0.0, 1.0};  // in g, as the driver has it
    std::vector<std::uint8_t> data = bytes_of(encode_imu(sample));
    messages.push_back({topic, sample.stamp, std::move(data)});
  }
  return messages;
}

TEST(Livox, PlacesTheImuOfAMid360) {
  HandMade made;
  made.frame = "imu";  // as encode_imu writes it
  Log log;
  const std::vector<Stored> messages = with_imu(frames_of(made, kSecond));
  const auto recording = open(messages, log);
  const Rig& rig = recording->rig();
  EXPECT_EQ(rig.lidar_model, "Mid-360");
  ASSERT_TRUE(rig.body_from_imu);
  const Pose lidar_from_imu = rig.body_from_lidar.inverse() * *rig.body_from_imu;
  EXPECT_NEAR((lidar_from_imu.translation() - Eigen::Vector3d(0.011, 0.02329, -0.04412)).norm(),
              0.0, 1e-12);
  EXPECT_NEAR(lidar_from_imu.angle(), 0.0, 1e-12);
  EXPECT_EQ(count_of(log, "recording.livox_imu_place"), 0U) << all_warnings(log);
  for (const Event& event : read_all(*recording)) {
    const auto* sample = std::get_if<ImuSample>(&event);
    if (sample == nullptr) continue;
    ASSERT_NEAR(sample->specific_force.z(), 9.80665, 1e-9);
  }
}

TEST(Livox, SaysWhereItDoesNotKnowThePlaceOfTheImu) {
  HandMade made;
  made.frame = "imu";
  made.lines = 6;
  Log log;
  const std::vector<Stored> messages = with_imu(frames_of(made, kFirst));
  const auto recording = open(messages, log);
  EXPECT_TRUE(recording->rig().body_from_imu);
  EXPECT_EQ(count_of(log, "recording.livox_imu_place"), 1U) << all_warnings(log);
}

TEST(Livox, PassesOverAMessageThatIsCut) {
  HandMade made;
  for (const Serialization serialization : {Serialization::kRos1, Serialization::kCdr}) {
    made.serialization = serialization;
    std::vector<Stored> messages = frames_of(made, kSecond);
    messages[5].data.pop_back();
    Log log;
    const auto recording = open(messages, log);
    EXPECT_EQ(scans_of(*recording).size(), 11U);
    EXPECT_EQ(count_of(log, "recording.unreadable_message"), 1U) << all_warnings(log);
  }
}

TEST(Livox, NamesLidarsThatAreNotRead) {
  std::vector<Stored> messages = frames_of({}, kSecond);
  messages.push_back({channel("/ouster/lidar_packets", "ouster_ros/msg/PacketMsg"), kStart, {}});
  messages.push_back({channel("/chatter", "std_msgs/msg/String"), kStart, {}});
  Log log;
  (void)open(messages, log);
  EXPECT_EQ(count_of(log, "recording.unread_lidar"), 1U) << all_warnings(log);
  EXPECT_NE(all_warnings(log).find("/ouster/lidar_packets"), std::string::npos);
}

}  // namespace
}  // namespace understory
