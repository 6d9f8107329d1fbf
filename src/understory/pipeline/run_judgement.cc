#include "understory/pipeline/run_judgement.h"

#include <fmt/format.h>

namespace understory {
namespace {

// A prediction bridges a scan or two without harm; beyond these shares the map has weak places.
constexpr double kMostUnmatchedShare = 0.02;
constexpr double kMostEmptyShare = 0.10;
constexpr double kLongestLidarGapS = 1.0;

double share(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

}  // namespace

RunJudgement judge_run(const MappingSession& session, const RunFacts& facts, const Log& log) {
  RunJudgement judgement;
  const MappingCounts& counts = session.counts();
  const auto distrust = [&](const std::string& reason) { judgement.reasons.push_back(reason); };
  const std::uint64_t failed = counts.unmatched + counts.gated;
  if (share(failed, counts.scans) > kMostUnmatchedShare) {
    distrust(
        fmt::format("{} of {} scans ({:.1f} %) could not be matched to the map; their poses "
                    "are predictions",
                    failed, counts.scans, 100.0 * share(failed, counts.scans)));
  }
  if (counts.segments > 1) {
    distrust(
        fmt::format("the position was lost {} time(s); the map consists of {} pieces that do "
                    "not fit together",
                    counts.segments - 1, counts.segments));
  }
  if (share(counts.empty_scans, counts.scans) > kMostEmptyShare) {
    distrust(fmt::format("{} of {} scans had hardly any usable point", counts.empty_scans,
                         counts.scans));
  }
  const double gap = to_seconds(facts.time_repair.streams[EventOrderer::kLidar].longest_gap);
  if (gap > kLongestLidarGapS) {
    distrust(fmt::format("the lidar was silent for {:.1f} s; the motion in between is a prediction",
                         gap));
  }
  const ImuTrust trust = session.odometry().motion().imu_trust();
  if (!trust.trusted) distrust(trust.reason);
  for (const Log::Warning& warning : log.warnings()) {
    // Kinds of damage that take data away or make it unreliable, not what was merely mended.
    if (warning.key == "recording.damaged") {
      distrust(fmt::format("the recording is damaged ({} place(s), the first: {})", warning.count,
                           warning.first_message));
    } else if (warning.key == "imu.stopped") {
      distrust(warning.first_message);
    }
  }
  if (!judgement.reasons.empty()) judgement.status = RunStatus::kUntrusted;
  if (facts.stopped) {
    judgement.status = RunStatus::kPartial;
    judgement.reasons.insert(judgement.reasons.begin(),
                             "stopped by the user before the end of the recording");
  }
  return judgement;
}

}  // namespace understory
