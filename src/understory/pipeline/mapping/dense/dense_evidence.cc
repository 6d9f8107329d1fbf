#include "understory/pipeline/mapping/dense/dense_evidence.h"

#include <algorithm>
#include <cmath>

#include "understory/pipeline/judgement/evidence_gathering.h"
#include "understory/pipeline/judgement/run_judgement.h"

namespace understory {

void gather_dense(const DenseFrontEnd& front_end, const RunFacts& facts, const Recording& source,
                  const Log& log, RunEvidence& evidence) {
  const bool refused = !front_end.imu_refused().empty();
  ReadingFacts reading;
  reading.source = &source;
  reading.time_repair = &facts.time_repair;
  reading.log = &log;
  reading.last_scan_end = front_end.last_scan_end();
  reading.imu_wanted = refused || front_end.imu_wanted();
  reading.imu_usage = front_end.imu_usage();
  gather_reading(reading, evidence);
  evidence.stopped = facts.stopped;
  evidence.unreadable = facts.unreadable;
  evidence.goes_on_by = facts.goes_on_by;
  evidence.dropped_scans = facts.dropped_scans;
  evidence.imu_used = front_end.odometry().uses_imu();
  const ImuTrust trust = front_end.odometry().motion().imu_trust();
  if (refused) {
    evidence.imu_distrust = imu_refusal(front_end.imu_refused());
  } else if (!trust.trusted) {
    evidence.imu_distrust = trust.reason;
  }
  gather_imu_trust(trust, evidence);
  evidence.imu_cleared = front_end.imu_cleared();
  const Eigen::Quaterniond level = front_end.odometry().motion().level_from_world();
  const double up = (level * Eigen::Vector3d::UnitZ()).z();
  evidence.tilt_at_end_deg = std::acos(std::clamp(up, -1.0, 1.0)) * 180.0 / M_PI;
  const NavState last = front_end.odometry().motion().predict(front_end.last_scan_end());
  evidence.accelerometer_bias_m_s2 = last.accel_bias.norm();
  const ScanMotion scan_motion = front_end.odometry().scan_motion();
  evidence.match.scan_motion_ratio = scan_motion.ratio;
  evidence.match.scan_motion_sd = scan_motion.sd;
  evidence.match.scan_motion_probes = scan_motion.probes;
  if (const auto offset = front_end.odometry().lidar_offset()) {
    evidence.further_lidar = {static_cast<int>(offset->lidar) + 1,
                              offset->apart_m,
                              offset->late_s,
                              offset->late_sd_s,
                              offset->misplaced_m,
                              offset->misplaced_sd_m};
  }
  const DenseCounts& counts = front_end.counts();
  MatchEvidence& match = evidence.match;
  match.scans = counts.scans;
  match.unmatched = counts.unmatched + counts.gated;
  match.empty = counts.empty_scans;
  match.repeated = counts.repeated;
  match.by_satellites = counts.by_satellites;
  const MapPieces pieces = front_end.map().finished_pieces();
  match.segments = pieces.groups() + (counts.segments - pieces.count());
  match.joined = counts.segments - match.segments;
  if (counts.segments > 1) match.first_lost = format_seconds(counts.first_lost);
  for (std::size_t piece = 1; piece < pieces.count(); ++piece) {
    const TimeNs start = front_end.map().keyframes()[pieces.begin(piece)].stamp;
    if (pieces.together(piece - 1, piece) &&
        format_seconds(start) == evidence.lidar.after_longest_gap)
      match.gap_joined = true;
  }
}

}  // namespace understory
