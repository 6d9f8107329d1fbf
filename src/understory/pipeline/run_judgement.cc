#include "understory/pipeline/run_judgement.h"

#include <fmt/format.h>

namespace understory {
namespace {

// A prediction bridges a scan or two without harm; beyond these shares the map has weak places.
constexpr double kMostUnmatchedShare = 0.02;
constexpr double kMostEmptyShare = 0.10;
constexpr double kLongestLidarGapS = 1.0;
constexpr double kMostSmearM = 0.05;

double share(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

void judge_scans(const MappingCounts& counts, std::vector<std::string>& reasons) {
  const std::uint64_t failed = counts.unmatched + counts.gated;
  if (share(failed, counts.scans) > kMostUnmatchedShare) {
    reasons.push_back(
        fmt::format("{} of {} scans ({:.1f} %) could not be matched to the map; their poses "
                    "are predictions",
                    failed, counts.scans, 100.0 * share(failed, counts.scans)));
  }
  if (share(counts.empty_scans, counts.scans) > kMostEmptyShare) {
    reasons.push_back(fmt::format("{} of {} scans had hardly any usable point", counts.empty_scans,
                                  counts.scans));
  }
}

void judge_outages(const MappingSession& session, const RunFacts& facts,
                   std::vector<std::string>& reasons) {
  const MappingCounts& counts = session.counts();
  if (counts.segments > 1) {
    reasons.push_back(
        fmt::format("the position was lost {} time(s), first at {} s; the map consists of {} "
                    "pieces that do not fit together",
                    counts.segments - 1, format_seconds(counts.first_lost), counts.segments));
  }
  const EventOrderer::StreamReport& lidar = facts.time_repair.streams[EventOrderer::kLidar];
  if (to_seconds(lidar.longest_gap) <= kLongestLidarGapS) return;
  const TimeNs imu_gap = facts.time_repair.streams[EventOrderer::kImu].longest_gap;
  const bool carried = session.odometry().uses_imu() && to_seconds(imu_gap) <= kLongestLidarGapS &&
                       counts.segments == 1;
  reasons.push_back(fmt::format(
      "the lidar was silent for {:.1f} s before {} s; the way in between was {}, so the map before "
      "and after may be offset",
      to_seconds(lidar.longest_gap), format_seconds(lidar.after_longest_gap),
      carried ? "told by the IMU alone" : "guessed"));
}

}  // namespace

RecordingDamage recording_damage(const Log& log, std::uint64_t scans) {
  RecordingDamage damage;
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key == "recording.damaged") {
      damage.hurt.push_back(fmt::format("the recording is damaged ({} place(s), the first: {})",
                                        warning.count, warning.first_message));
    } else if (warning.key == "recording.damaged_packet" &&
               warning.count > scans) {  // more than one a scan
      damage.hurt.push_back(fmt::format("{} packets of the lidar are damaged, the first: {}",
                                        warning.count, warning.first_message));
    } else if (warning.key == "recording.truncated") {
      damage.missing.push_back("the recording is cut off; what came after is missing: " +
                               warning.first_message);
    }
  }
  return damage;
}

double smear_of(const Pose& step) {
  constexpr double kRangeM = 10.0;
  return step.translation().norm() + kRangeM * step.angle();
}

std::string smear_reason(const Log& log, double smear_m) {
  if (smear_m <= kMostSmearM) return {};
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key != "recording.no_point_times") continue;
    return fmt::format("{}; the sensor moved so much that points 10 m away are smeared by {:.2f} m",
                       warning.first_message, smear_m);
  }
  return {};
}

std::string imu_refusal(const std::string& reason) {
  return reason +
         "; the recording was mapped without the IMU: check how it is mounted (--extrinsics FILE), "
         "its axes, units and clock";
}

RunJudgement judge_run(const MappingSession& session, const RunFacts& facts, double smear_m,
                       const Log& log) {
  RunJudgement judgement;
  judge_scans(session.counts(), judgement.reasons);
  judge_outages(session, facts, judgement.reasons);
  const ImuTrust trust = session.odometry().motion().imu_trust();
  if (!session.imu_refused().empty()) {
    judgement.reasons.push_back(imu_refusal(session.imu_refused()));
  } else if (!trust.trusted) {
    judgement.reasons.push_back(trust.reason);
  }
  const RecordingDamage damage = recording_damage(log, session.counts().scans);
  judgement.reasons.insert(judgement.reasons.end(), damage.hurt.begin(), damage.hurt.end());
  if (const std::string reason = smear_reason(log, smear_m); !reason.empty())
    judgement.reasons.push_back(reason);
  std::vector<std::string> missing = damage.missing;
  const bool cut = !missing.empty();
  if (!judgement.reasons.empty()) judgement.status = RunStatus::kUntrusted;
  if (cut && judgement.status == RunStatus::kComplete) judgement.status = RunStatus::kPartial;
  if (facts.stopped) {
    judgement.status = RunStatus::kPartial;
    missing.insert(missing.begin(),
                   "stopped by the user before the end of the recording; go on with "
                   "`understory map --resume`");
  }
  judgement.reasons.insert(judgement.reasons.begin(), missing.begin(), missing.end());
  return judgement;
}

}  // namespace understory
