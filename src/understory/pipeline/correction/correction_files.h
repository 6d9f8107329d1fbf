#pragma once

#include <chrono>
#include <vector>

#include "understory/pipeline/correction/correction.h"
#include "understory/pipeline/correction/stem_correction.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/timing.h"

namespace understory {

// What a correction run has found.
struct CorrectionRun {
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  std::vector<StemView> views;
  std::vector<SparseStep> steps;  // the chained odometry
  // Of every scan, before any correction; empty: the views are all there is.
  std::vector<StampedPose> path;
  StemCorrection correction;  // the answer
  std::vector<LoggedCut> head_cuts;
  bool stopped = false;
  InheritedTrust trust;  // of the run that the stems come from
  std::vector<InputHash> inputs;
  StageTimes times;
};

// Writes the run folder: odometry.tum, trajectory.tum, loops.csv, trees.csv, felled.csv, run.json,
// report.html.
[[nodiscard]] RunOutcome write_correction(const CorrectionRequest& request, CorrectionRun& run,
                                          Log& log);

}  // namespace understory
