#include "understory/recording/messages/message_recording.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/recording/messages/message_encode.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace test;

struct Stored {
  std::shared_ptr<const MessageChannel> channel;
  TimeNs log_time = 0;
  std::vector<std::uint8_t> data;
};

class StoredSource : public MessageSource {
 public:
  explicit StoredSource(const std::vector<Stored>& messages) : messages_(messages) {}
  bool next(RawMessage& message) override {
    if (at_ == messages_.size()) return false;
    const Stored& stored = messages_[at_++];
    message = {stored.channel, stored.log_time, stored.data};
    return true;
  }
  void save(BinaryWriter& writer) const override { writer.put(static_cast<std::uint64_t>(at_)); }
  void load(BinaryReader& reader) override {
    at_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
  }
  [[nodiscard]] std::string format() const override { return "test"; }
  [[nodiscard]] double progress() const override { return 0.0; }

 private:
  const std::vector<Stored>& messages_;
  std::size_t at_ = 0;
};

std::shared_ptr<const MessageChannel> channel(const std::string& topic, const std::string& type) {
  auto made = std::make_shared<MessageChannel>();
  made->topic = topic;
  made->type = type;
  return made;
}

std::vector<std::uint8_t> bytes_of(const ByteBuffer& buffer) {
  return {buffer.span().begin(), buffer.span().end()};
}

// A message whose frame "lidar" is replaced by another name of five letters.
std::vector<std::uint8_t> with_frame(std::vector<std::uint8_t> data, const std::string& frame) {
  const std::string old = "lidar";
  const auto at = std::search(data.begin(), data.end(), old.begin(), old.end());
  std::copy(frame.begin(), frame.end(), at);
  return data;
}

// Clouds of a lidar of 500 points and of another of 100, on one topic.
std::vector<Stored> two_lidars(const std::string& second) {
  const auto clouds = channel("/points", "sensor_msgs/msg/PointCloud2");
  std::vector<Stored> messages;
  for (int i = 0; i < 30; ++i) {
    const TimeNs now = kStart + i * 100'000'000LL;
    const TimeNs other = now + 50'000'000LL;
    messages.push_back(
        {clouds, other + 100'000'000LL,
         with_frame(bytes_of(encode_point_cloud2(make_scan(other, 100, 2))), second)});
    messages.push_back(
        {clouds, now + 150'000'000LL,
         with_frame(bytes_of(encode_point_cloud2(make_scan(now, 500, 1))), "front")});
  }
  return messages;
}

// Bug: the clouds of both were taken to come from the place of one.
TEST(MessageRecording, LeavesOutASecondLidarOnTheTopic) {
  const std::vector<Stored> messages = two_lidars("rear_");
  Log log;
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
  const std::vector<Event> events = read_all(*recording);
  ASSERT_EQ(events.size(), 30U);
  for (const Event& event : events)
    EXPECT_EQ(std::get<ScanPtr>(event)->points.size(), 500U);
  EXPECT_EQ(recording->topics().front().left_out, 30U);
  EXPECT_EQ(count_of(log, "recording.other_frames"), 30U) << all_warnings(log);
  EXPECT_NE(all_warnings(log).find("frames front and rear_"), std::string::npos);
}

// Two names of one place are one sensor.
TEST(MessageRecording, TakesTwoNamesOfOnePlaceForOneLidar) {
  std::vector<Stored> messages = two_lidars("rear_");
  const std::vector<NamedTransform> same = {{"base_link", "front", Pose()},
                                            {"front", "rear_", Pose()}};
  messages.insert(messages.begin(), {channel("/tf_static", "tf2_msgs/msg/TFMessage"), kStart,
                                     bytes_of(encode_transforms(same, kStart))});
  Log log;
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
  EXPECT_EQ(read_all(*recording).size(), 60U);
  EXPECT_EQ(count_of(log, "recording.other_frames"), 0U) << all_warnings(log);
}

// Bug: a transform that came after the survey was never used.
TEST(MessageRecording, UsesATransformThatComesAfterTheFirstScans) {
  std::vector<Stored> messages = two_lidars("front");
  const auto imu = channel("/imu", "sensor_msgs/msg/Imu");
  for (int i = 0; i < 900; ++i) {
    ImuSample sample;
    sample.stamp = kStart + i * 10'000'000LL;
    messages.push_back({imu, sample.stamp, bytes_of(encode_imu(sample))});
  }
  const std::vector<NamedTransform> late = {{"front", "imu", Pose()}};
  messages.push_back({channel("/tf_static", "tf2_msgs/msg/TFMessage"), kStart + 8'000'000'000LL,
                      bytes_of(encode_transforms(late, kStart))});
  std::stable_sort(messages.begin(), messages.end(),
                   [](const Stored& a, const Stored& b) { return a.log_time < b.log_time; });
  Log log;
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
  EXPECT_FALSE(recording->rig().body_from_imu.has_value());
  (void)read_all(*recording);
  EXPECT_TRUE(recording->rig().body_from_imu.has_value()) << all_warnings(log);
  EXPECT_EQ(count_of(log, "recording.late_extrinsics"), 1U) << all_warnings(log);
}

// nmea_msgs/Sentence as a driver writes it.
std::vector<std::uint8_t> sentence_message(TimeNs stamp, const std::string& frame,
                                           const std::string& sentence) {
  CdrWriter out;
  out.put_header(stamp, frame);
  out.put_text(sentence);
  return bytes_of(out.bytes());
}

TEST(MessageRecording, JoinsHeadingsToThePositionsOfTheirEpoch) {
  const auto positions = channel("/fix", "sensor_msgs/msg/NavSatFix");
  const auto sentences = channel("/nmea", "nmea_msgs/msg/Sentence");
  std::vector<Stored> messages;
  for (int i = 0; i < 40; ++i) {
    GnssFix fix;
    fix.stamp = kStart + i * 200'000'000LL;
    fix.quality = 1;
    messages.push_back({positions, fix.stamp, bytes_of(encode_nav_sat_fix(fix))});
    // Stamped when they come, 15 ms later; the driver passes on other sentences, too. Number 7 has
    // no heading, number 9 is far too late.
    const TimeNs late = fix.stamp + (i == 9 ? 60'000'000LL : 15'000'000LL);
    const std::string heading = i == 7 ? "" : std::to_string(i) + ".5";
    messages.push_back({sentences, late, sentence_message(late, "gnss", "$GPGSA,A,3,,,,,,,,,")});
    messages.push_back(
        {sentences, late, sentence_message(late, "gnss", "$GPHDT," + heading + ",T\r\n")});
  }
  Log log;
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
  const std::vector<Event> events = read_all(*recording);
  ASSERT_EQ(events.size(), 40U);
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto& fix = std::get<GnssFix>(events[i]);
    EXPECT_EQ(fix.stamp, kStart + static_cast<TimeNs>(i) * 200'000'000LL);
    if (i == 7 || i == 9) {
      EXPECT_TRUE(std::isnan(fix.heading_deg)) << i;
    } else {
      EXPECT_EQ(fix.heading_deg, static_cast<double>(i) + 0.5);
    }
  }
  EXPECT_FALSE(recording->rig().body_from_second_gnss);
}

// Bug: without an index a sensor that begins late was refused where the user named its topic.
TEST(MessageRecording, FindsANamedTopicThatBeginsLateWithoutAnIndex) {
  std::vector<Stored> messages = two_lidars("rear_");
  const auto imu = channel("/second/imu", "sensor_msgs/msg/Imu");
  for (int i = 0; i < 10; ++i) {
    ImuSample sample;
    sample.stamp = kStart + 30'000'000'000LL + i * 10'000'000LL;
    messages.push_back({imu, sample.stamp, bytes_of(encode_imu(sample))});
  }
  const auto open = [&](Log&) { return std::make_unique<StoredSource>(messages); };
  OpenOptions options;
  options.imu_topic = "/second/imu";
  Log log;
  const auto recording = open_messages("x.mcap", open, options, log);
  EXPECT_EQ(read_all(*recording).size(), 40U);
  options.imu_topic = "/third/imu";
  EXPECT_THROW((void)open_messages("x.mcap", open, options, log), InputError);
}

}  // namespace
}  // namespace understory
