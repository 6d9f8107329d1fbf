#pragma once

#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/judgement/judgement_config.h"
#include "understory/pipeline/judgement/run_evidence.h"

namespace understory {

// The verdict on a run, for run.json and the terminal.
struct RunJudgement {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // for the user, the cause first; empty if complete
};

// Whether the result of a run is to be trusted, and if not why: a pure function of numbers, for
// both front ends. Partial: some of the recording was not used (the run was stopped, the recording
// is cut off, scans were dropped, a sensor was not used). Untrusted, whatever is missing: something
// hurt the result.
[[nodiscard]] RunJudgement judge_run(const RunEvidence& evidence, const JudgementConfig& config);

// What a list of trees lacks where too few points lie near breast height, for the user.
[[nodiscard]] std::string few_points_reason(bool any_trees);

// How far a point 10 m away moves against the sensor on that step from scan to scan, metres.
[[nodiscard]] double smear_of(const Pose& step);

// What is said of a run that was made without its IMU, for that reason.
[[nodiscard]] std::string imu_refusal(const std::string& reason);

}  // namespace understory
