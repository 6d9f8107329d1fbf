#include "understory/pipeline/judgement/run_evidence.h"

namespace understory {
namespace {

using Figures = std::map<std::string, Figure>;

void put(Figures& figures, const std::string& name, std::uint64_t value) {
  figures[name] = static_cast<std::int64_t>(value);
}

void put_sensor(Figures& figures, const std::string& name, const SensorEvidence& sensor) {
  put(figures, name + "_received", sensor.received);
  put(figures, name + "_unreadable", sensor.unreadable);
  put(figures, name + "_not_numbers", sensor.not_numbers);
  put(figures, name + "_late", sensor.late);
  put(figures, name + "_glitches", sensor.glitches);
  put(figures, name + "_duplicates", sensor.duplicates);
  put(figures, name + "_stamp_taken", sensor.stamp_taken);
  put(figures, name + "_reordered", sensor.reordered);
  put(figures, name + "_clock_jumps", sensor.clock_jumps);
  figures[name + "_longest_gap_s"] = sensor.longest_gap_s;
  figures[name + "_unused_s"] = sensor.unused_s;
  figures[name + "_silent_at_end_s"] = sensor.silent_at_end_s;
}

void put_motion(Figures& figures, const MotionEvidence& motion) {
  put(figures, "steps", motion.steps);
  put(figures, "steps_impossible", motion.impossible);
  figures["speed_p99_m_s"] = motion.speed_p99_m_s;
  figures["speed_max_m_s"] = motion.fastest_m_s;
  figures["acceleration_p95_m_s2"] = motion.acceleration_p95_m_s2;
  figures["acceleration_p99_m_s2"] = motion.acceleration_p99_m_s2;
  figures["acceleration_max_m_s2"] = motion.hardest_m_s2;
  figures["jump_max_m"] = motion.jump_m;
  figures["step_max_s"] = motion.longest_step_s;
  figures["turn_rate_p99_deg_s"] = motion.turn_rate_p99_deg_s;
}

void put_match(Figures& figures, const MatchEvidence& match) {
  put(figures, "scans_mapped", match.scans);
  put(figures, "scans_unmatched", match.unmatched);
  put(figures, "scans_empty", match.empty);
  put(figures, "scans_repeated", match.repeated);
  put(figures, "segments", match.segments);
  put(figures, "segments_joined", match.joined);
  figures["inliers_mean"] = match.inliers_mean;
  figures["inliers_low"] = match.inliers_low;
  figures["fitness_rms_m"] = match.fitness_rms_m;
  figures["few_share"] = match.few_share;
  figures["chance_share"] = match.chance_share;
  figures["blur_growth"] = match.blur_growth;
  figures["range_offset_m"] = match.range_offset_m;
  figures["range_offset_error_m"] = match.range_offset_error_m;
  figures["range_pairs"] = std::int64_t{match.range_pairs};
  figures["smear_m"] = match.smear_m;
  figures["scan_motion_ratio"] = match.scan_motion_ratio;
  figures["scan_motion_sd"] = match.scan_motion_sd;
  figures["scan_motion_probes"] = std::int64_t{match.scan_motion_probes};
}

void put_further_lidar(Figures& figures, const FurtherLidarEvidence& lidar) {
  if (lidar.number == 0) return;
  figures["further_lidar"] = std::int64_t{lidar.number};
  figures["further_lidar_apart_m"] = lidar.apart_m;
  figures["further_lidar_late_s"] = lidar.late_s;
  figures["further_lidar_late_sd_s"] = lidar.late_sd_s;
  figures["further_lidar_misplaced_m"] = lidar.misplaced_m;
  figures["further_lidar_misplaced_sd_m"] = lidar.misplaced_sd_m;
}

void put_stems(Figures& figures, const StemRunEvidence& stems) {
  put(figures, "views", stems.views);
  put(figures, "views_doubtful", stems.doubtful);
  figures["loops_solved"] = stems.loops_solved;
}

void put_stand(Figures& figures, const StandEvidence& stand) {
  figures["few_points_near_breast"] = stand.few_near_breast;
  figures["map_upright"] = stand.not_upright.empty();
  figures["trees_once"] = stand.two_images.empty();
}

}  // namespace

Figures figures_of(const RunEvidence& evidence) {
  Figures figures;
  figures["stopped"] = evidence.stopped;
  put(figures, "scans_dropped", evidence.dropped_scans);
  for (const SensorRole& role : kSensorRoles)
    put_sensor(figures, role.name, evidence.*role.evidence);
  put(figures, "damaged_places", evidence.damaged_places);
  put(figures, "damaged_packets", evidence.damaged_packets);
  figures["cut_off"] = evidence.cut_off;
  figures["times_assumed"] = evidence.times_assumed;
  figures["point_times_missing"] = evidence.point_times_missing;
  put(figures, "scans_mixed_times", evidence.mixed_times);
  figures["tilt_at_end_deg"] = evidence.tilt_at_end_deg;
  figures["accelerometer_bias_m_s2"] = evidence.accelerometer_bias_m_s2;
  figures["imu_used"] = evidence.imu_used;
  figures["imu_on_probation"] = evidence.imu_on_probation;
  figures["imu_doubted_s"] = evidence.imu_doubted_s;
  figures["imu_cleared"] = evidence.imu_cleared;
  figures["imu_trusted"] = evidence.imu_distrust.empty();
  figures["imu_motion_scale"] = evidence.imu_motion_scale;
  figures["imu_motion_correlation"] = evidence.imu_motion_correlation;
  figures["imu_motion_spread_m_s2"] = evidence.imu_motion_spread_m_s2;
  figures["imu_motion_windows"] = std::int64_t{evidence.imu_motion_windows};
  put_motion(figures, evidence.motion);
  put_match(figures, evidence.match);
  put_further_lidar(figures, evidence.further_lidar);
  if (!evidence.by_stems) put_stand(figures, evidence.stand);
  if (evidence.by_stems) put_stems(figures, evidence.stems);
  return figures;
}

}  // namespace understory
