#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/output/report/report.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"

namespace understory {

// What walking through the finished trajectory yields for report and run.json.
struct TrajectoryFacts {
  Trajectory trajectory;  // as a reader of trajectory.tum gets it
  std::vector<ReportScan> scans;
  std::vector<float> cpu_ms;  // of each scan, see ScanRecord
  std::vector<float> wall_ms;
  std::vector<ScanBlock> costs;  // of each scan
  double length_m = 0.0;
  double duration_s = 0.0;
  double period_ms = 0.0;  // median time between scans
  MotionEvidence motion;
  MatchEvidence match;  // what the path and the matches say of it
  std::uint64_t weak = 0;
};

// Writes trajectory.tum and states.csv.gz of a finished run into `folder`. Throws OutputError.
[[nodiscard]] TrajectoryFacts write_dense_trajectory(const std::filesystem::path& folder,
                                                     const DenseFrontEnd& front_end);

}  // namespace understory
