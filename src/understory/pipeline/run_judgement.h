#pragma once

#include <string>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/pipeline/mapping_session.h"
#include "understory/pipeline/run_writer.h"

namespace understory {

struct RunJudgement {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;
};

// Damage of a recording that takes data away (`missing`) or makes it unreliable (`hurt`), not what
// was merely mended, in words for the user. `scans`: of the recording.
struct RecordingDamage {
  std::vector<std::string> hurt;
  std::vector<std::string> missing;
};
[[nodiscard]] RecordingDamage recording_damage(const Log& log, std::uint64_t scans);

// How far a point 10 m away moves against the sensor on that step from scan to scan, metres.
[[nodiscard]] double smear_of(const Pose& step);
// What is to be said where scans had no time per point and moved by `smear_m` on average; empty if
// that is little, or they had. Folders of clouds are taken to be deskewed and are not warned of.
[[nodiscard]] std::string smear_reason(const Log& log, double smear_m);

// What is said of a run that was made without its IMU, for that reason.
[[nodiscard]] std::string imu_refusal(const std::string& reason);

// Whether the result of a run is to be trusted, and if not why, in words for the user. Partial: the
// run was stopped, or the recording is cut off. Untrusted: something hurt the result (lost scans,
// an IMU that contradicts the lidar, an outage bridged by prediction, scans blurred by motion).
// `smear_m`: how far a point 10 m away moves against the sensor during a scan, on average.
[[nodiscard]] RunJudgement judge_run(const MappingSession& session, const RunFacts& facts,
                                     double smear_m, const Log& log);

}  // namespace understory
