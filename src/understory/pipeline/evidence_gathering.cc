#include "understory/pipeline/evidence_gathering.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "understory/pipeline/run_judgement.h"

namespace understory {
namespace {

SensorEvidence sensor_of(const EventOrderer::StreamReport& stream) {
  SensorEvidence sensor;
  sensor.received = stream.received;
  sensor.late = stream.late;
  sensor.glitches = stream.glitches;
  sensor.duplicates = stream.duplicates;
  sensor.reordered = stream.reordered;
  sensor.clock_jumps = stream.clock_jumps;
  sensor.unheard_s = to_seconds(stream.without_say);
  sensor.longest_gap_s = to_seconds(stream.longest_gap);
  if (stream.longest_gap > 0) sensor.after_longest_gap = format_seconds(stream.after_longest_gap);
  return sensor;
}

// A topic that has this role, or null.
const TopicReport* topic_of(const std::vector<TopicReport>& topics, const std::string& role) {
  const auto found = std::find_if(topics.begin(), topics.end(), [&](const TopicReport& topic) {
    return topic.role == role && topic.messages > 0;
  });
  return found == topics.end() ? nullptr : &*found;
}

// Why the IMU had no say, in words.
std::string silence_of_imu(const ReadingFacts& facts, const TopicReport* imu,
                           const TopicReport* lidar, const SensorEvidence& sensor) {
  constexpr double kNoticeableS = 0.1;
  std::string why;
  const auto add = [&](const std::string& what) { why += (why.empty() ? "" : "; ") + what; };
  if (facts.imu_without_place > 0) {
    add(fmt::format(
        "nothing tells where it sits on the carrier for {:.1f} s; give --extrinsics FILE",
        to_seconds(facts.imu_without_place)));
  }
  if (imu != nullptr && lidar != nullptr) {
    const double late = to_seconds(imu->first_stamp - lidar->first_stamp);
    if (late > kNoticeableS) add(fmt::format("it begins {:.1f} s after the lidar", late));
    const double missing = to_seconds(facts.last_scan_end - imu->last_stamp);
    if (missing > kNoticeableS) add(fmt::format("it stops {:.1f} s before the lidar", missing));
  }
  if (sensor.longest_gap_s > kNoticeableS) {
    add(fmt::format("it was silent for {:.1f} s before {} s", sensor.longest_gap_s,
                    sensor.after_longest_gap));
  }
  return why.empty() ? "scans left before its samples came" : why;
}

// Why another sensor had no say, in words.
std::string loss_of(const SensorEvidence& sensor) {
  return fmt::format(
      "of its {} messages {} came too late, {} had a stamp far off, {} were unreadable",
      sensor.received + sensor.unreadable, sensor.late, sensor.glitches, sensor.unreadable);
}

// What the readers have told of files, clouds and points.
void gather_remarks(const Log& log, RunEvidence& evidence) {
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key == "recording.damaged") {
      evidence.damaged_places = warning.count;
      evidence.first_damage = warning.first_message;
    } else if (warning.key == "recording.damaged_packet") {
      evidence.damaged_packets = warning.count;
      evidence.first_damaged_packet = warning.first_message;
    } else if (warning.key == "recording.other_frames") {
      evidence.other_sensor_messages = warning.count;
      evidence.first_other_sensor = warning.first_message;
    } else if (warning.key == "recording.late_sensor") {
      evidence.late_sensor = warning.first_message;
    } else if (warning.key == "recording.truncated") {
      evidence.cut_off = true;
      evidence.where_cut_off = warning.first_message;
    } else if (warning.key == "recording.assumed_rate") {
      evidence.times_assumed = true;
    } else if (warning.key == "recording.no_point_times") {
      evidence.point_times_missing = true;
      evidence.why_no_point_times = warning.first_message;
    }
  }
}

}  // namespace

void gather_reading(const ReadingFacts& facts, RunEvidence& evidence) {
  const auto& streams = facts.time_repair->streams;
  evidence.lidar = sensor_of(streams[EventOrderer::kLidar]);
  evidence.imu = sensor_of(streams[EventOrderer::kImu]);
  evidence.gnss = sensor_of(streams[EventOrderer::kGnss]);
  evidence.mag = sensor_of(streams[EventOrderer::kMag]);
  const std::vector<TopicReport> topics = facts.source->topics();
  const std::pair<const char*, SensorEvidence*> sensors[] = {{"lidar", &evidence.lidar},
                                                             {"imu", &evidence.imu},
                                                             {"gnss", &evidence.gnss},
                                                             {"mag", &evidence.mag}};
  for (const auto& [role, sensor] : sensors) {
    const TopicReport* topic = topic_of(topics, role);
    if (topic != nullptr) sensor->unreadable = topic->unreadable;
    sensor->unheard_why = loss_of(*sensor);
  }
  if (facts.imu_wanted) {
    evidence.imu.unheard_s = std::max(evidence.imu.unheard_s, to_seconds(facts.imu_without_place));
    evidence.imu.unheard_why =
        silence_of_imu(facts, topic_of(topics, "imu"), topic_of(topics, "lidar"), evidence.imu);
  } else {
    evidence.imu.unheard_s = 0.0;
  }
  gather_remarks(*facts.log, evidence);
}

void gather_dense(const MappingSession& session, const RunFacts& facts, const Recording& source,
                  const Log& log, RunEvidence& evidence) {
  const bool refused = !session.imu_refused().empty();
  ReadingFacts reading;
  reading.source = &source;
  reading.time_repair = &facts.time_repair;
  reading.log = &log;
  reading.last_scan_end = session.last_scan_end();
  reading.imu_wanted = refused || session.imu_wanted();
  reading.imu_without_place = session.counts().imu_without_place;
  gather_reading(reading, evidence);
  evidence.stopped = facts.stopped;
  evidence.unreadable = facts.unreadable;
  evidence.dropped_scans = facts.dropped_scans;
  evidence.imu_used = session.odometry().uses_imu();
  const ImuTrust trust = session.odometry().motion().imu_trust();
  if (refused) {
    evidence.imu_distrust = imu_refusal(session.imu_refused());
  } else if (!trust.trusted) {
    evidence.imu_distrust = trust.reason;
  }
  evidence.imu_motion_scale = trust.motion_scale;
  evidence.imu_motion_correlation = trust.motion_correlation;
  evidence.imu_motion_spread_m_s2 = trust.motion_spread_m_s2;
  evidence.imu_motion_windows = trust.motion_windows;
  const ScanMotion scan_motion = session.odometry().scan_motion();
  evidence.match.scan_motion_ratio = scan_motion.ratio;
  evidence.match.scan_motion_probes = scan_motion.probes;
  const MappingCounts& counts = session.counts();
  MatchEvidence& match = evidence.match;
  match.scans = counts.scans;
  match.unmatched = counts.unmatched + counts.gated;
  match.empty = counts.empty_scans;
  match.repeated = counts.repeated;
  match.segments = counts.segments;
  if (counts.segments > 1) match.first_lost = format_seconds(counts.first_lost);
}

}  // namespace understory
