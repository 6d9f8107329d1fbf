#include "understory/pipeline/correction/correction_evidence.h"

#include <algorithm>

#include "understory/pipeline/judgement/evidence_gathering.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"

namespace understory {
namespace {

// Steps that nothing vouches for: those without a match, and those with a weak one that no loop and
// no correction bridges.
std::size_t doubtful_steps(const CorrectionRun& run) {
  std::vector<int> bridges(run.steps.size() + 1, 0);  // begin and end of each, to be summed up
  const auto bridge = [&](int from, int to) {
    ++bridges[static_cast<std::size_t>(std::min(from, to)) + 1];
    --bridges[static_cast<std::size_t>(std::max(from, to)) + 1];
  };
  for (std::size_t k = 0; k < run.correction.loops.size(); ++k) {
    if (run.correction.accepted[k] != 0)
      bridge(run.correction.loops[k].match, run.correction.loops[k].query);
  }
  for (const TriedCorrection& tried : run.correction.self.tried) {
    if (tried.kept) bridge(tried.pair.j, tried.pair.i);
  }
  std::size_t doubtful = 0;
  int bridged = 0;
  for (std::size_t k = 0; k < run.steps.size(); ++k) {
    bridged += bridges[k];
    const SparseStepStatus status = run.steps[k].status;
    doubtful += status == SparseStepStatus::kUnmatched ||
                        (status == SparseStepStatus::kWeak && bridged == 0)
                    ? 1
                    : 0;
  }
  return doubtful;
}

double mean_smear_m(const std::vector<StampedPose>& path) {
  double sum = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i)
    sum += smear_of(path[i - 1].world_from_body.inverse() * path[i].world_from_body);
  return path.size() < 2 ? 0.0 : sum / static_cast<double>(path.size() - 1);
}

MotionEvidence motion_of(const std::vector<StampedPose>& path, const MotionLimits& limits) {
  PathEvidence motion(limits);
  for (const StampedPose& pose : path)
    motion.add(pose);
  return motion.evidence();
}

void gather_recording(const CorrectionRequest& request, const Log& log, RunEvidence& evidence) {
  const SparseScans& scans = *request.scans;
  ReadingFacts reading;
  reading.source = scans.source;
  reading.time_repair = &scans.time_repair;
  reading.log = &log;
  reading.last_scan_end = scans.last_scan_end;
  reading.imu_wanted = scans.imu_wanted;
  reading.imu_hearing = scans.imu_hearing;
  gather_reading(reading, evidence);
  if (scans.realtime) evidence.dropped_scans = scans.realtime->dropped_scans;
  evidence.stopped = evidence.stopped || scans.stopped;
  evidence.unreadable = scans.unreadable;
  evidence.imu_used = scans.imu_wanted && scans.source->rig().body_from_imu.has_value() &&
                      scans.imu_distrust.empty();
  evidence.imu_distrust = scans.imu_distrust;
  gather_motion_scale(scans.imu_trust, evidence);
  evidence.match.scans = scans.path.size();
  evidence.match.repeated = scans.repeated;
  evidence.match.smear_m = mean_smear_m(scans.path);
  evidence.motion = motion_of(scans.path, request.config.motion_limits);
}

}  // namespace

RunEvidence evidence_of(const CorrectionRequest& request, const CorrectionRun& run,
                        std::size_t trees, const Log& log) {
  RunEvidence evidence;
  evidence.by_stems = true;
  evidence.stopped = run.stopped;
  evidence.stems.views = run.steps.size();
  evidence.stems.doubtful = doubtful_steps(run);
  evidence.stems.trees = trees;
  evidence.stems.loops_solved = run.correction.converged;
  evidence.stems.loops_reason = run.correction.reason;
  if (request.scans != nullptr) gather_recording(request, log, evidence);
  return evidence;
}

}  // namespace understory
