#include "understory/pipeline/judgement/judgement_config.h"

namespace understory {

namespace {

// The path's against the accelerometer's.
void describe_accelerations(ConfigTable& table, JudgementConfig& config) {
  const ConfigTable::Range ratios{-1e6, 1e6};
  table.add("min_imu_scale", config.min_imu_scale, ratios, "",
            "untrusted: accelerations by matching are less than this share of the accelerometer's");
  table.add("max_imu_scale", config.max_imu_scale, ratios, "",
            "untrusted: accelerations by matching are more than this share of the accelerometer's");
  table.add("min_imu_windows", config.min_imu_windows, {1, 1000000}, "windows",
            "with fewer windows of a third of a second the scale of accelerations is not judged");
  table.add("min_imu_spread_m_s2", config.min_imu_spread_m_s2, {0.0, 100.0}, "m/s^2",
            "below this standard deviation the accelerations are not judged");
  table.add("min_imu_correlation", config.min_imu_correlation, {-1.0, 1.0}, "",
            "untrusted, with the next: accelerations by matching and IMU correlate by less");
  table.add("max_imu_scatter_m_s2", config.max_imu_scatter_m_s2, {0.0, 1000.0}, "m/s^2",
            "untrusted, with min_imu_correlation: they differ by a larger standard deviation");
  table.add("min_imu_scatter_windows", config.min_imu_scatter_windows, {1, 1000000}, "windows",
            "with fewer windows their correlation is not judged");
}

}  // namespace

void describe(ConfigTable& table, JudgementConfig& config) {
  const ConfigTable::Range shares{0.0, 1.0};
  const ConfigTable::Range seconds{0.0, 1e6};
  table.add("max_unused_scans", config.max_unused_scans, shares, "",
            "partial: a larger share of the scans, or of another sensor's messages, was not used");
  table.add("max_unused_s", config.max_unused_s, seconds, "s",
            "partial: another sensor was not used, or outlasted the lidar, for longer");
  table.add("max_unmatched", config.max_unmatched, shares, "",
            "untrusted: a larger share of the scans could not be matched");
  table.add("max_empty", config.max_empty, shares, "",
            "untrusted: a larger share of the scans had hardly any usable point");
  table.add(
      "max_few", config.max_few, shares, "",
      "untrusted: over a larger share of the time scans found few of their points in the map");
  table.add(
      "max_chance", config.max_chance, shares, "",
      "untrusted: over a larger share of the time matched points lay no nearer than by chance");
  table.add(
      "max_blur_growth", config.max_blur_growth, {1.0, 1e6}, "",
      "untrusted: distance of matched points in the last third over that in the first is larger");
  table.add("longest_lidar_gap_s", config.longest_lidar_gap_s, seconds, "s",
            "untrusted: the lidar was silent for longer");
  table.add("max_smear_m", config.max_smear_m, {0.0, 100.0}, "m",
            "untrusted: points have no times and are smeared by more, 10 m away");
  table.add("max_lidars_apart_m", config.max_lidars_apart_m, {0.0, 100.0}, "m",
            "untrusted: the points of one lidar lie by more beside those of the first one");
  table.add("max_repeated", config.max_repeated, shares, "",
            "untrusted: a larger share of the scans holds the same points as the scan before");
  table.add("max_misplaced", config.max_misplaced, shares, "",
            "partial: a larger share of the steps is a motion that no carrier makes");
  table.add("max_impossible", config.max_impossible, shares, "",
            "untrusted: a larger share of the steps is a motion that no carrier makes");
  table.add("max_shake_m_s2", config.max_shake_m_s2, {0.0, 1e6}, "m/s^2",
            "partial: without an IMU one step in twenty is accelerated by more");
  table.add("max_jump_m", config.max_jump_m, {0.0, 1e6}, "m",
            "untrusted: the path goes astray by more over such motions and does not come back");
  const ConfigTable::Range ratios{-1e6, 1e6};
  table.add(
      "min_scan_motion", config.min_scan_motion, ratios, "",
      "untrusted: within scans the sensor moves less than this share of the motion from scan to "
      "scan");
  table.add("max_scan_motion", config.max_scan_motion, ratios, "",
            "untrusted: within scans the sensor moves more than this share of that motion");
  table.add("min_scan_motion_probes", config.min_scan_motion_probes, {1, 1000000}, "scans",
            "with fewer scans the motion within scans is not judged");
  describe_accelerations(table, config);
  table.add("max_range_offset_m", config.max_range_offset_m, {0.0, 1000.0}, "m",
            "untrusted: all ranges seem to be too long or too short by more");
  table.add("min_range_pairs", config.min_range_pairs, {1, 1000000}, "pairs",
            "with fewer pairs of views the ranges are not judged");
}

}  // namespace understory
