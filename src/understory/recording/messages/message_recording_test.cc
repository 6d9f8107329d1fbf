#include "understory/recording/messages/message_recording.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/stored_messages_test_support.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using test::all_warnings;
using test::bytes_of;
using test::channel;
using test::count_of;
using test::kStart;
using test::make_scan;
using test::read_all;
using test::Stored;
using test::StoredSource;
using test::TemporaryFolder;
using test::write_bytes;

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
  sort_stably(messages, [](const Stored& a, const Stored& b) { return a.log_time < b.log_time; });
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

// Two receivers at 5 Hz on a carrier that goes north-east at 2 m/s. The second is 90 ms later and a
// metre north-west of the first: their line leads to 315 degrees.
struct TwoReceiversBag {
  std::string first_frame = "gps";
  std::string second_frame = "gps_left";
  std::string placed_frame = "gps_left";
  TimeNs placed_at = kStart;
  double distance_m = 1.0;
  TimeNs second_begins = kStart;

  [[nodiscard]] std::vector<Stored> messages() const {
    const auto first = channel("/front/fix", "sensor_msgs/msg/NavSatFix");
    const auto second = channel("/left/fix", "sensor_msgs/msg/NavSatFix");
    const std::vector<NamedTransform> places = {
        {"base_link", "lidar", Pose()},
        {"base_link", "gps", Pose(Eigen::Quaterniond::Identity(), {0.5, 0.0, 1.0})},
        {"base_link", placed_frame, Pose(Eigen::Quaterniond::Identity(), {0.5, distance_m, 1.0})}};
    std::vector<Stored> all = {{channel("/tf_static", "tf2_msgs/msg/TFMessage"), placed_at,
                                bytes_of(encode_transforms(places, kStart))}};
    const auto clouds = channel("/points", "sensor_msgs/msg/PointCloud2");
    const auto fix_at = [](TimeNs stamp, double aside_m) {
      const double way = std::sqrt(2.0) * static_cast<double>(stamp - kStart) * 1e-9;
      GnssFix fix;
      fix.stamp = stamp;
      fix.latitude_deg = (way + aside_m * std::sqrt(0.5)) / 110'574.27;  // on the equator
      fix.longitude_deg = (way - aside_m * std::sqrt(0.5)) / 111'319.49;
      fix.covariance = 1e-4 * Eigen::Matrix3d::Identity();
      fix.quality = 4;
      return fix;
    };
    for (int i = 0; i < 60; ++i) {
      const TimeNs now = kStart + i * 200'000'000LL;
      all.push_back({clouds, now, bytes_of(encode_point_cloud2(make_scan(now, 100, 1)))});
      all.push_back({first, now, bytes_of(encode_nav_sat_fix(fix_at(now, 0.0), first_frame))});
      const TimeNs later = now + 90'000'000LL;
      if (later < second_begins) continue;
      all.push_back(
          {second, later, bytes_of(encode_nav_sat_fix(fix_at(later, 1.0), second_frame))});
    }
    sort_stably(all, [](const Stored& a, const Stored& b) { return a.log_time < b.log_time; });
    return all;
  }
};

// How many fixes have a heading. Each is that of the line; all fixes are those of the first
// antenna.
std::size_t headings_of(const std::vector<Event>& events) {
  std::size_t headings = 0;
  for (const Event& event : events) {
    const auto* fix = std::get_if<GnssFix>(&event);
    if (fix == nullptr) continue;
    EXPECT_EQ((fix->stamp - kStart) % 200'000'000LL, 0);
    if (std::isnan(fix->heading_deg)) continue;
    ++headings;
    EXPECT_NEAR(fix->heading_deg, 315.0, 0.05);
    EXPECT_NEAR(fix->heading_sd_deg, std::sqrt(2e-4) * 180.0 / M_PI, 0.01);
  }
  return headings;
}

std::size_t headings_of(const TwoReceiversBag& receivers, Log& log,
                        const OpenOptions& options = {}) {
  const std::vector<Stored> messages = receivers.messages();
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, options, log);
  return headings_of(read_all(*recording));
}

TEST(MessageRecording, PositionsOfTwoAntennasTellTheHeading) {
  const std::vector<Stored> messages = TwoReceiversBag().messages();
  const auto open = [&](Log&) { return std::make_unique<StoredSource>(messages); };
  Log log;
  const auto recording = open_messages("x.mcap", open, {}, log);
  std::vector<Event> events;
  for (int i = 0; i < 70; ++i)
    events.push_back(*recording->next());
  // Another reading goes on there.
  BinaryWriter writer;
  ASSERT_TRUE(recording->save(writer));
  BinaryReader reader(writer.bytes(), "place");
  const auto again = open_messages("x.mcap", open, {}, log);
  again->load(reader);
  for (const Event& event : read_all(*again))
    events.push_back(event);
  ASSERT_EQ(events.size(), 120U);
  // Four pairs tell how distances scatter; the first fix lies before the second antenna's first.
  EXPECT_EQ(headings_of(events), 55U);
  EXPECT_EQ(all_warnings(log), "");
  for (const TopicReport& topic : again->topics()) {
    if (topic.name == "/left/fix") {
      EXPECT_EQ(topic.role, "gnss");
    }
  }
}

TEST(MessageRecording, ASecondTopicOfPositionsIsNoAntennaWithoutItsPlace) {
  const auto why = [](const TwoReceiversBag& receivers) {
    Log log;
    EXPECT_EQ(headings_of(receivers, log), 0U);
    EXPECT_EQ(count_of(log, "recording.second_antenna"), 1U);
    EXPECT_EQ(log.warnings().size(), 1U);
    return all_warnings(log);
  };
  TwoReceiversBag one_frame;
  one_frame.second_frame = "gps";
  EXPECT_NE(why(one_frame).find("both are in the frame gps"), std::string::npos);
  TwoReceiversBag no_place;
  no_place.placed_frame = "gps_right";
  EXPECT_NE(why(no_place).find("the place of gps_left on the body is not known"),
            std::string::npos);
  TwoReceiversBag filter;
  filter.second_frame = "base_link";
  EXPECT_NE(why(filter).find("their frame is that of the body, base_link"), std::string::npos);
  TwoReceiversBag together;
  together.distance_m = 0.01;
  EXPECT_NE(why(together).find("less than a decimetre apart"), std::string::npos);
}

// A file places antennas, and does not say whose topic is which.
TEST(MessageRecording, AFileThatPlacesAntennasNeedsTheTopicOfTheFirst) {
  const TemporaryFolder folder;
  const std::string text =
      "body_frame: base_link\nbody_from_gnss: {translation_m: [0.5, 0, 1]}\n"
      "body_from_second_gnss: {translation_m: [0.5, 1, 1]}\n";
  OpenOptions options;
  options.extrinsics_file = folder / "rig.yaml";
  write_bytes(options.extrinsics_file, {text.begin(), text.end()});
  TwoReceiversBag receivers;
  receivers.second_frame = "gps";
  Log log;
  EXPECT_EQ(headings_of(receivers, log, options), 0U);
  EXPECT_NE(all_warnings(log).find("--gnss-topic"), std::string::npos) << all_warnings(log);
  options.gnss_topic = "/front/fix";
  Log quiet;
  EXPECT_EQ(headings_of(receivers, quiet, options), 55U);
  EXPECT_EQ(all_warnings(quiet), "");
}

TEST(MessageRecording, PositionsThatAreNotAsFarApartAsTheAntennasTellNone) {
  TwoReceiversBag receivers;
  receivers.distance_m = 1.6;
  Log log;
  EXPECT_EQ(headings_of(receivers, log), 0U);
  EXPECT_EQ(count_of(log, "recording.antenna_distance"), 1U);
  EXPECT_NE(all_warnings(log).find("20 of 20 pairs"), std::string::npos) << all_warnings(log);
  EXPECT_NE(all_warnings(log).find("1.60 m (the last ones 1.00 m"), std::string::npos);
  // A run that goes on says so if the first part has not.
  const std::vector<Stored> messages = receivers.messages();
  const auto open = [&](Log&) { return std::make_unique<StoredSource>(messages); };
  for (const int events : {10, 100}) {
    Log before;
    const auto recording = open_messages("x.mcap", open, {}, before);
    for (int i = 0; i < events; ++i)
      (void)recording->next();
    BinaryWriter writer;
    ASSERT_TRUE(recording->save(writer));
    BinaryReader reader(writer.bytes(), "place");
    Log after;
    const auto again = open_messages("x.mcap", open, {}, after);
    again->load(reader);
    (void)read_all(*again);
    EXPECT_EQ(count_of(before, "recording.antenna_distance"), events == 10 ? 0U : 1U);
    EXPECT_EQ(count_of(after, "recording.antenna_distance"), events == 10 ? 1U : 0U);
  }
}

TEST(MessageRecording, ASecondAntennaThatComesLateIsUsedFromThenOn) {
  TwoReceiversBag late;
  late.second_begins = kStart + 7'000'000'000LL;
  Log log;
  EXPECT_EQ(headings_of(late, log), 20U);
  EXPECT_EQ(all_warnings(log), "");
  TwoReceiversBag late_place;
  late_place.placed_at = kStart + 7'000'000'000LL;
  Log placed;
  EXPECT_GT(headings_of(late_place, placed), 18U);
  EXPECT_EQ(count_of(placed, "recording.second_antenna"), 1U) << all_warnings(placed);
}

// Sentences tell the heading better; the second topic of positions stays out then.
TEST(MessageRecording, SentencesComeBeforePositionsOfASecondAntenna) {
  std::vector<Stored> messages = TwoReceiversBag().messages();
  const auto sentences = channel("/nmea", "nmea_msgs/msg/Sentence");
  for (int i = 0; i < 60; ++i) {
    const TimeNs now = kStart + i * 200'000'000LL;
    messages.push_back({sentences, now, sentence_message(now, "gps_left", "$GPHDT,12.5,T\r\n")});
  }
  sort_stably(messages, [](const Stored& a, const Stored& b) { return a.log_time < b.log_time; });
  Log log;
  const auto recording = open_messages(
      "x.mcap", [&](Log&) { return std::make_unique<StoredSource>(messages); }, {}, log);
  for (const Event& event : read_all(*recording)) {
    if (const auto* fix = std::get_if<GnssFix>(&event)) {
      EXPECT_EQ(fix->heading_deg, 12.5);
    }
  }
  EXPECT_EQ(count_of(log, "recording.several_gnss_topics"), 1U) << all_warnings(log);
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
