#pragma once

#include "understory/util/config/config.h"

namespace understory {

// Above these a run is not `complete`. How each was found: docs/reference/troubleshooting.md, the
// limits; `./run accuracy --spoilt --fit` shows what good and wrong maps have of each number.
struct JudgementConfig {
  // Partial: what was not used.
  double max_unused_scans = 0.01;  // share of the scans, and of the messages of any other sensor
  double max_unused_s = 1.0;       // of any other sensor; of the lidar when the others end
  // Untrusted. A prediction bridges a scan or two without harm; beyond these shares the map has
  // weak places.
  double max_unmatched = 0.02;
  double max_empty = 0.10;
  double max_few = 0.10;     // share of the time after the beginning, see MatchCourse
  double max_chance = 0.10;  // the same
  double max_blur_growth = 1.15;
  double longest_lidar_gap_s = 1.0;
  double max_smear_m = 0.05;
  double max_lidars_apart_m = 0.05;  // one of several beside the first one, see LidarOffset
  double max_repeated = 0.01;        // share of the scans; no lidar sees the same twice
  // Share of the steps, see MotionLimits. A scan at a wrong place makes two or three such steps.
  // Beyond the first share the run is partial; beyond the second, or where the times of the scans
  // were assumed, it is untrusted.
  double max_misplaced = 0.01;
  double max_impossible = 0.04;
  // Without an IMU nothing but matching tells the motion within a scan. A path that shakes from
  // scan to scan bends the next scan by its own error: its map is blurred.
  double max_shake_m_s2 = 10.0;
  // A scan at a wrong place comes back; a path that does not come back has come off its map.
  double max_jump_m = 1.0;
  // Motion within scans over motion between them, see ScanMotion: 1 is right.
  double min_scan_motion = 0.4;
  double max_scan_motion = 1.8;
  int min_scan_motion_probes = 6;  // fewer tell nothing
  // Acceleration by matching over that by the accelerometer, see MotionScale: 1 is right.
  double min_imu_scale = 0.9;
  double max_imu_scale = 1.1;
  int min_imu_windows = 60;          // fewer tell nothing, nor does
  double min_imu_spread_m_s2 = 0.2;  // an even motion
  // Where accelerations have nothing to do with each other, their correlation is less. They also
  // differ by more than matching is uncertain (2 cm of a scan make 0.4 m/s^2).
  double min_imu_correlation = 0.7;
  double max_imu_scatter_m_s2 = 0.8;
  int min_imu_scatter_windows = 30;  // fewer tell nothing: 10 s
  // All ranges too long or too short, see RangeCheck. Tall grass that hides the ground from afar
  // looks like ranges that are too long by its height.
  double max_range_offset_m = 0.4;
  int min_range_pairs = 5;  // fewer tell nothing
};
void describe(ConfigTable& table, JudgementConfig& config);

}  // namespace understory
