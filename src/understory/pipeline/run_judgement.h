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

// Whether the result of a run is to be trusted, and if not why, in words for the user. Partial: the
// run was stopped. Untrusted: something hurt the result (lost scans, an IMU that contradicts the
// lidar, an outage bridged by prediction).
[[nodiscard]] RunJudgement judge_run(const MappingSession& session, const RunFacts& facts,
                                     const Log& log);

}  // namespace understory
