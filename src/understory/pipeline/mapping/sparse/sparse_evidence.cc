#include "understory/pipeline/mapping/sparse/sparse_evidence.h"

#include <string>
#include <vector>

#include "understory/pipeline/judgement/evidence_gathering.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"

namespace understory {
namespace {

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

}  // namespace

void gather_sparse(const SparseFrontEnd& front_end, const RunFacts& facts, const Recording& source,
                   const Log& log, RunEvidence& evidence) {
  ReadingFacts reading;
  reading.source = &source;
  reading.time_repair = &facts.time_repair;
  reading.log = &log;
  reading.last_scan_end = front_end.last_scan_end();
  reading.imu_wanted = front_end.config().front_end.imu.use;
  reading.imu_usage = front_end.imu_usage();
  gather_reading(reading, evidence);
  evidence.stopped = facts.stopped;
  evidence.unreadable = facts.unreadable;
  evidence.goes_on_by = facts.goes_on_by;
  evidence.dropped_scans = facts.dropped_scans;
  const ImuTrust trust = front_end.imu_trust();
  const std::string& refused = front_end.imu_refused();
  evidence.imu_distrust = refused.empty() ? trust.reason : imu_refusal(refused);
  evidence.imu_used = reading.imu_wanted && source.rig().body_from_imu.has_value() &&
                      evidence.imu.received > 0 && evidence.imu_distrust.empty();
  gather_imu_trust(trust, evidence);
  evidence.match.scans = front_end.path().size();
  evidence.match.repeated = front_end.repeated();
  evidence.match.smear_m = mean_smear_m(front_end.path());
  evidence.motion = motion_of(front_end.path(), front_end.config().correction.motion_limits);
}

}  // namespace understory
