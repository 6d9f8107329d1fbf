#include "understory/pipeline/judgement/evidence_gathering.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "understory/pipeline/pipeline_constants.h"
#include "understory/recording/finding.h"

namespace understory {
namespace {

using namespace pipeline_constants::evidence_gathering;

SensorEvidence sensor_of(const EventOrderer::StreamReport& stream) {
  SensorEvidence sensor;
  sensor.received = stream.received;
  sensor.late = stream.late;
  sensor.glitches = stream.glitches;
  sensor.duplicates = stream.duplicates;
  sensor.stamp_taken = stream.stamp_taken;
  sensor.reordered = stream.reordered;
  sensor.clock_jumps = stream.clock_jumps;
  sensor.unused_s = to_seconds(stream.unused);
  sensor.longest_gap_s = to_seconds(stream.longest_gap);
  if (stream.longest_gap > 0) sensor.after_longest_gap = format_seconds(stream.after_longest_gap);
  return sensor;
}

// A topic that has this role, or null.
const TopicReport* topic_of(const std::vector<TopicReport>& topics, const std::string& role) {
  const auto found = std::find_if(topics.begin(), topics.end(), [&](const TopicReport& topic) {
    return topic.role == role && topic.messages + topic.unreadable > 0;
  });
  return found == topics.end() ? nullptr : &*found;
}

// How long the sensors of a recording went on after each other's last message.
void compare_ends(const EventOrderer::Report& report, const std::vector<TopicReport>& topics,
                  RunEvidence& evidence) {
  for (std::size_t s = 0; s < kSensorRoles.size(); ++s) {
    if (report.streams[s].released == 0) continue;
    SensorEvidence& sensor = evidence.*kSensorRoles[s].evidence;
    for (std::size_t other = 0; other < kSensorRoles.size(); ++other) {
      const TopicReport* topic = topic_of(topics, kSensorRoles[other].name);
      if (report.streams[other].released == 0 || (topic != nullptr && topic->beside)) continue;
      const double longer_s = to_seconds(report.streams[other].newest - report.streams[s].newest);
      if (longer_s <= sensor.silent_at_end_s) continue;
      sensor.silent_at_end_s = longer_s;
      sensor.outlived_by = kSensorRoles[other].words;
    }
  }
}

// When the messages of a topic begin and end, by the mended clock of its stream.
struct Span {
  TimeNs first = 0;
  TimeNs last = 0;
};
Span span_of(const TopicReport& topic, const EventOrderer::StreamReport& stream) {
  return {topic.first_stamp + stream.offset, topic.last_stamp + stream.offset};
}

// Why the IMU was not used, in words.
std::string why_imu_unused(const ReadingFacts& facts, const std::vector<TopicReport>& topics,
                           const SensorEvidence& sensor) {
  std::string why;
  const auto add = [&](const std::string& what) { why += (why.empty() ? "" : "; ") + what; };
  if (facts.imu_usage.without_place() > 0) {
    add(fmt::format("its place on the carrier is not known for {:.1f} s; give --extrinsics FILE",
                    to_seconds(facts.imu_usage.without_place())));
  }
  if (facts.imu_usage.unusable() > 0) {
    add(fmt::format(
        "its samples are not numbers or beyond its range for {:.1f} s (degrees per second?)",
        to_seconds(facts.imu_usage.unusable())));
  }
  const TopicReport* imu = topic_of(topics, "imu");
  const TopicReport* lidar = topic_of(topics, "lidar");
  if (imu != nullptr && lidar != nullptr) {
    const auto& streams = facts.time_repair->streams;
    const Span imu_span = span_of(*imu, streams[EventOrderer::kImu]);
    const Span lidar_span = span_of(*lidar, streams[EventOrderer::kLidar]);
    const double late = to_seconds(imu_span.first - lidar_span.first);
    if (late > kNoticeableS) add(fmt::format("it begins {:.1f} s after the lidar", late));
    const double missing = to_seconds(facts.last_scan_end - imu_span.last);
    if (missing > kNoticeableS) add(fmt::format("it stops {:.1f} s before the lidar", missing));
  }
  if (sensor.longest_gap_s > kNoticeableS) {
    add(fmt::format("it was silent for {:.1f} s before {} s", sensor.longest_gap_s,
                    sensor.after_longest_gap));
  }
  return why.empty() ? "its samples came after their scans were processed" : why;
}

// Why another sensor was not used, in words.
std::string why_unused(const SensorEvidence& sensor) {
  return fmt::format(
      "of its {} messages {} came too late, {} had a stamp far off, {} were unreadable",
      sensor.received + sensor.unreadable, sensor.late, sensor.glitches, sensor.unreadable);
}

// What the readers have found wrong or missing.
void gather_findings(const Log& log, RunEvidence& evidence) {
  const auto take = [&](Finding finding, std::uint64_t& count, std::string& first) {
    Found of_kind = found(log, finding);
    count = of_kind.count;
    first = std::move(of_kind.first);
  };
  take(Finding::kDamage, evidence.damaged_places, evidence.first_damage);
  take(Finding::kDamagedPacket, evidence.damaged_packets, evidence.first_damaged_packet);
  take(Finding::kOtherSensor, evidence.other_sensor_messages, evidence.first_other_sensor);
  take(Finding::kSilentLidar, evidence.silent_lidars, evidence.first_silent_lidar);
  evidence.late_sensor = found(log, Finding::kLateSensor).first;
  evidence.where_cut_off = found(log, Finding::kCutOff).first;
  evidence.cut_off = found(log, Finding::kCutOff).count > 0;
  evidence.times_assumed = found(log, Finding::kAssumedTimes).count > 0;
  evidence.why_no_point_times = found(log, Finding::kNoPointTimes).first;
  evidence.mixed_times = found(log, Finding::kMixedTimes).count;
  evidence.point_times_missing = found(log, Finding::kNoPointTimes).count > 0;
}

}  // namespace

void gather_reading(const ReadingFacts& facts, RunEvidence& evidence) {
  static_assert(kSensorRoles.size() == EventOrderer::kStreams);
  const std::vector<TopicReport> topics = facts.source->topics();
  for (std::size_t s = 0; s < kSensorRoles.size(); ++s) {
    SensorEvidence& sensor = evidence.*kSensorRoles[s].evidence;
    sensor = sensor_of(facts.time_repair->streams[s]);
    const TopicReport* topic = topic_of(topics, kSensorRoles[s].name);
    if (topic != nullptr) {
      sensor.unreadable = topic->unreadable;
      sensor.not_numbers = topic->not_numbers;
    }
    sensor.unused_why = why_unused(sensor);
  }
  compare_ends(*facts.time_repair, topics, evidence);
  if (facts.imu_wanted) {
    evidence.imu.unused_s =
        std::max(evidence.imu.unused_s, to_seconds(facts.imu_usage.without_place())) +
        to_seconds(facts.imu_usage.unusable());
    evidence.imu.unused_why = why_imu_unused(facts, topics, evidence.imu);
  } else {
    evidence.imu.unused_s = 0.0;
  }
  gather_findings(*facts.log, evidence);
}

void gather_imu_trust(const ImuTrust& trust, RunEvidence& evidence) {
  if (trust.without_samples_s > evidence.imu.unused_s) {
    evidence.imu.unused_s = trust.without_samples_s;
    evidence.imu.unused_why = "it was silent, or its samples lie too far apart to be integrated";
  }
  evidence.imu_on_probation = trust.on_probation;
  evidence.imu_doubted_s = trust.doubted_s;
  evidence.imu_motion_scale = trust.motion_scale;
  evidence.imu_motion_correlation = trust.motion_correlation;
  evidence.imu_motion_spread_m_s2 = trust.motion_spread_m_s2;
  evidence.imu_motion_windows = trust.motion_windows;
}

}  // namespace understory
