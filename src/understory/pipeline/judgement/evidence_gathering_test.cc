#include "understory/pipeline/judgement/evidence_gathering.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "understory/recording/finding.h"

namespace understory {
namespace {

// A recording that has been read: what its topics hold is given.
class TopicsRecording : public Recording {
 public:
  explicit TopicsRecording(std::vector<TopicReport> topics) : topics_(std::move(topics)) {}

  std::optional<Event> next() override { return std::nullopt; }
  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override { return topics_; }
  std::string format() const override { return "test"; }
  double progress() const override { return 1.0; }

 private:
  Rig rig_;
  std::vector<TopicReport> topics_;
};

TopicReport topic(const std::string& role, double first_s, double last_s) {
  TopicReport report;
  report.role = role;
  report.messages = 100;
  report.first_stamp = from_seconds(first_s);
  report.last_stamp = from_seconds(last_s);
  return report;
}

// Of a recording that was read to its end; what it points to has to live as long.
ReadingFacts facts_of(const TopicsRecording& recording, const EventOrderer::Report& repair,
                      const Log& log) {
  ReadingFacts facts;
  facts.source = &recording;
  facts.time_repair = &repair;
  facts.log = &log;
  facts.last_scan_end = from_seconds(160.0);
  return facts;
}

// A lidar from 100 s to 160 s, and an IMU whose stamps lie between these.
RunEvidence gathered_reading(double imu_first_s, double imu_last_s, double imu_offset_s) {
  const TopicsRecording recording(
      {topic("lidar", 100.0, 160.0), topic("imu", imu_first_s, imu_last_s)});
  EventOrderer::Report repair;
  repair.streams[EventOrderer::kImu].offset = from_seconds(imu_offset_s);
  const Log log;
  ReadingFacts facts = facts_of(recording, repair, log);
  RunEvidence evidence;
  gather_reading(facts, evidence);
  return evidence;
}

TEST(EvidenceGathering, AnImuThatBeginsLateOrStops) {
  const std::string why = gathered_reading(104.0, 155.0, 0.0).imu.unused_why;
  EXPECT_NE(why.find("it begins 4.0 s after the lidar"), std::string::npos) << why;
  EXPECT_NE(why.find("it stops 5.0 s before the lidar"), std::string::npos) << why;
}

// A regression: the stamps were compared before their clock was mended.
TEST(EvidenceGathering, AClockThatWasMendedIsNoLateImu) {
  const std::string ahead = gathered_reading(103.0, 163.0, -3.0).imu.unused_why;
  EXPECT_EQ(ahead, "its samples came after their scans were processed");
  const std::string behind = gathered_reading(97.0, 157.0, 3.0).imu.unused_why;
  EXPECT_EQ(behind, "its samples came after their scans were processed");
  const std::string late = gathered_reading(100.0, 156.0, 4.0).imu.unused_why;
  EXPECT_EQ(late, "it begins 4.0 s after the lidar");
}

// A regression: samples in degrees per second were dropped with a warning, and the run was
// complete.
TEST(EvidenceGathering, SamplesThatCannotBeUsedHaveNoSay) {
  const TopicsRecording recording({topic("lidar", 100.0, 160.0), topic("imu", 100.0, 160.0)});
  const EventOrderer::Report repair;
  const Log log;
  ReadingFacts facts = facts_of(recording, repair, log);
  ImuSample sample;
  sample.specific_force = {0.0, 0.0, 9.81};
  for (int k = 0; k < 300; ++k) {
    sample.stamp = from_seconds(100.0 + 0.01 * k);
    sample.angular_rate = {0.0, 0.0, k > 100 ? 100.0 : 1.0};  // degrees per second
    facts.imu_usage.add(sample, true, ImuNoiseConfig());
  }
  RunEvidence evidence;
  gather_reading(facts, evidence);
  EXPECT_NEAR(evidence.imu.unused_s, 1.99, 1e-9);
  EXPECT_NE(evidence.imu.unused_why.find("degrees per second"), std::string::npos);
  facts.imu_wanted = false;
  gather_reading(facts, evidence);
  EXPECT_EQ(evidence.imu.unused_s, 0.0);
}

TEST(EvidenceGathering, WhatTheReadersCouldNotUse) {
  TopicReport imu = topic("imu", 100.0, 160.0);
  imu.not_numbers = 7;
  TopicReport fixes = topic("gnss", 0.0, 0.0);
  fixes.messages = 0;  // rows of a table of which none can be read
  fixes.unreadable = 5;
  const TopicsRecording recording({topic("lidar", 100.0, 160.0), imu, fixes});
  const EventOrderer::Report repair;
  const Log log;
  RunEvidence evidence;
  gather_reading(facts_of(recording, repair, log), evidence);
  EXPECT_EQ(evidence.imu.not_numbers, 7U);
  EXPECT_EQ(evidence.gnss.unreadable, 5U);
}

// A regression: the samples of an IMU at 10 Hz lie too far apart to go by, and nothing said so.
TEST(EvidenceGathering, AnImuTooSlowToGoBy) {
  RunEvidence evidence;
  evidence.imu.unused_s = 0.2;
  ImuTrust trust;
  trust.without_samples_s = 11.9;
  gather_imu_trust(trust, evidence);
  EXPECT_DOUBLE_EQ(evidence.imu.unused_s, 11.9);
  EXPECT_NE(evidence.imu.unused_why.find("too far apart"), std::string::npos);
  EXPECT_FALSE(evidence.imu_on_probation);
}

TEST(EvidenceGathering, WhoWentOnAfterWhom) {
  const TopicsRecording recording({topic("lidar", 100.0, 160.0)});
  EventOrderer::Report repair;
  // Before the epoch of the clock: a sensor that is not there does not outlast them.
  const double ends_s[] = {-3.0, -1.0, 0.0};
  for (const auto stream : {EventOrderer::kLidar, EventOrderer::kImu, EventOrderer::kGnss}) {
    repair.streams[stream].released = 1;
    repair.streams[stream].newest = from_seconds(ends_s[stream] - 10.0);
  }
  const Log log;
  RunEvidence evidence;
  gather_reading(facts_of(recording, repair, log), evidence);
  EXPECT_DOUBLE_EQ(evidence.lidar.silent_at_end_s, 3.0);
  EXPECT_EQ(evidence.lidar.outlived_by, "GNSS");
  EXPECT_DOUBLE_EQ(evidence.imu.silent_at_end_s, 1.0);
  EXPECT_DOUBLE_EQ(evidence.gnss.silent_at_end_s, 0.0);
  EXPECT_DOUBLE_EQ(evidence.mag.silent_at_end_s, 0.0);  // there is none
  TopicReport log_beside = topic("gnss", 90.0, 1000.0);
  log_beside.beside = true;
  const TopicsRecording folder({topic("lidar", 100.0, 160.0), log_beside});
  RunEvidence of_folder;
  gather_reading(facts_of(folder, repair, log), of_folder);
  EXPECT_EQ(of_folder.lidar.outlived_by, "IMU");
}

TEST(EvidenceGathering, FindingsOfTheReaders) {
  const TopicsRecording recording({topic("lidar", 100.0, 160.0)});
  const EventOrderer::Report repair;
  Log log;
  report_finding(log, Finding::kDamage, "at byte 5");
  report_finding(log, Finding::kDamage, "at byte 9");
  report_finding(log, Finding::kDamagedPacket, "packet 7");
  report_finding(log, Finding::kOtherSensor, "two frames");
  report_finding(log, Finding::kLateSensor, "udp 2369");
  report_finding(log, Finding::kCutOff, "at byte 17");
  report_finding(log, Finding::kAssumedTimes, "10 a second");
  report_finding(log, Finding::kNoPointTimes, "no time field");
  ReadingFacts facts;
  facts.source = &recording;
  facts.time_repair = &repair;
  facts.log = &log;
  RunEvidence evidence;
  gather_reading(facts, evidence);
  EXPECT_EQ(evidence.damaged_places, 2U);
  EXPECT_EQ(evidence.first_damage, "at byte 5");
  EXPECT_EQ(evidence.damaged_packets, 1U);
  EXPECT_EQ(evidence.first_damaged_packet, "packet 7");
  EXPECT_EQ(evidence.other_sensor_messages, 1U);
  EXPECT_EQ(evidence.first_other_sensor, "two frames");
  EXPECT_EQ(evidence.late_sensor, "udp 2369");
  EXPECT_TRUE(evidence.cut_off);
  EXPECT_EQ(evidence.where_cut_off, "at byte 17");
  EXPECT_TRUE(evidence.times_assumed);
  EXPECT_TRUE(evidence.point_times_missing);
  EXPECT_EQ(evidence.why_no_point_times, "no time field");
}

}  // namespace
}  // namespace understory
