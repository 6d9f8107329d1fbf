#include "understory/pipeline/mapping/dense/dense_mapping_config.h"

#include <algorithm>

#include "understory/georeference/plot_file.h"
#include "understory/pipeline/profiles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

void describe_map(ConfigTable& table, DenseMappingConfig& config) {
  table.add("enabled", config.map_enabled, "write map.laz and what is made from it");
  table.add("copc", config.copc,
            "write map.copc.laz as well: the points of map.laz in an octree, for viewers");
  table.add("range_max_m", config.map_range_max_m, {1.0, 1000.0}, "m",
            "farther returns do not enter the finished map");
  table.add("keyframe_thin_m", config.keyframe_thin_m, {0.0, 1.0}, "m",
            "one point per cube of this edge of each scan in it; 0: all");
  table.add("cloud_distance_m", config.cloud_distance_m, {0.0, 100.0}, "m",
            "distance between scans whose clouds make the finished map; turns count as for "
            "keyframes; of sparse scans 0.1");
  table.add("far_cloud_distance_m", config.far_cloud_distance_m, {0.0, 100.0}, "m",
            "the same between scans of which only far points are kept, where no other cloud shows "
            "their place from near; 0: none; with inventory.extent=full 0.25");
  table.add("far_m", config.far_m, {1.0, 1000.0}, "m", "from so far on a point is far");
  table.add("thin_m", config.map.thin_m, {0.0, 1.0}, "m",
            "one point per cube of this edge of the finished map; 0: all");
  table.add("tile_m", config.map.tile_m, {1.0, 1000.0}, "m", "tiles in which it is finished");
  table.section("carrier", [&] { describe(table, config.carrier); });
}

}  // namespace

ConfigTable dense_mapping_table(DenseMappingConfig& config) {
  ConfigTable table;
  table.add("imu_rate", config.imu_rate,
            "write trajectory_imu.tum, a prediction of the pose for each sample of the IMU");
  table.add("refine_imu", config.refine_imu,
            "refine place and clock of the IMU while mapping; what differs from the given values "
            "is mapped anew");
  table.add("scan_fraction", config.scan_fraction, {0.05, 1.0}, "",
            "below 1: each such part of a scan gives a pose as soon as its last point is there, in "
            "trajectory_partial.tum");
  table.section("time_repair", [&] { EventOrderer::describe(table, config.loop.time_repair); });
  describe(table, config.odometry);
  table.section("registration", [&] {
    describe(table, config.odometry.match);
    describe(table, config.keyframe_map.local_map.matcher);
  });
  KeyframeMap::describe(table, config.keyframe_map);
  table.section("map", [&] { describe_map(table, config); });
  table.section("inventory", [&] { describe(table, config.inventory); });
  table.section("obstacles", [&] { describe(table, config.obstacles); });
  table.section("georeference", [&] { describe(table, config.georeference); });
  table.section("output", [&] { describe(table, config.output); });
  table.section("gnss", [&] {
    describe(table, config.gnss);
    table.section("match", [&] { describe(table, config.satellites); });
  });
  table.section("judgement", [&] {
    describe(table, config.judgement);
    table.section("motion", [&] { describe(table, config.motion_limits); });
  });
  table.section("run", [&] {
    table.add("checkpoint_interval_s", config.loop.checkpoint_interval_s, {0.1, 5.0}, "s",
              "of recording between checkpoints");
    table.add(
        "sparse_scan_points", config.sparse_scan_points, {0, 100000000}, "points",
        "with fewer points in a full scan, settings are adapted as to a sparse lidar; 0: never");
    table.add("sparse_voxel_m", config.sparse_voxel_m, {0.01, 10.0}, "m",
              "preprocess.voxel.voxel_size_m of a sparse lidar, unless that key is set");
    table.add("lost_after_scans", config.lost_after_scans, {1, 100000}, "scans",
              "unmatched scans in a row after which a new piece of map begins");
    table.add("max_memory_mb", config.max_memory_mb, {0.0, 1e6}, "MB",
              "memory that the run may have resident (10^6 bytes); 0: no limit");
    table.add("realtime_queue_scans", config.loop.realtime_queue_scans, {1, 1000}, "scans",
              "--realtime: scans that may wait; older ones are dropped");
  });
  return table;
}

std::vector<std::string> profile_names() {
  std::vector<std::string> names;
  for (const auto& profile : shipped_profiles())
    names.emplace_back(profile.name);
  return names;
}

std::string profile_text(const std::string& name) {
  for (const auto& profile : shipped_profiles()) {
    if (name == profile.name) return std::string(profile.yaml);
  }
  std::string known;
  for (const std::string& each : profile_names())
    known += (known.empty() ? "" : ", ") + each;
  throw ConfigError({"--profile " + name + ": unknown; there are " + known});
}

ReadConfig<DenseMappingConfig> read_dense_mapping_config(const std::string& profile,
                                                         const std::string& file,
                                                         const std::vector<std::string>& settings) {
  DenseMappingConfig config;
  ConfigTable table = dense_mapping_table(config);
  ConfigProblems problems;
  ConfigOrigins origins;
  problems.gather([&] {
    if (profile.empty()) return;
    // A profile also says what maps by stems need.
    std::vector<std::string> of_stems;
    table.read_yaml(profile_text(profile), "profile " + profile, &of_stems);
    note_yaml(table, profile_text(profile), "profile " + profile, origins);
  });
  problems.gather([&] {
    if (file.empty()) return;
    table.read_file(file);
    note_file(table, file, origins);
  });
  problems.gather([&] { table.set(settings); });
  note_settings(table, settings, origins);
  problems.gather([&] { check(config.georeference); });
  problems.gather([&] {
    if (config.imu_rate && !config.odometry.imu_enabled)
      throw ConfigError(
          {"imu_rate: predictions for each sample of the IMU need "
           "motion.imu_enabled=true"});
  });
  problems.gather([&] {
    if (config.refine_imu && !config.odometry.imu_enabled)
      throw ConfigError(
          {"refine_imu: place and clock of the IMU are refined where it is used: "
           "motion.imu_enabled=true"});
  });
  problems.gather([&] {
    if (config.copc && !config.map_enabled)
      throw ConfigError({"map.copc: map.copc.laz needs the map, and map.enabled is false"});
  });
  problems.gather([&] {
    const auto matcher = make_matcher(config.keyframe_map.local_map.matcher);
    if (config.odometry.tops.points == ScanPoints::kTreeTops &&
        matcher->feature_finder() != nullptr)
      throw ConfigError(
          {"preprocess.points: tree_tops does not go with registration.method loam or loam_ground, "
           "which choose points of their own"});
  });
  problems.throw_if_any();
  return {config, origins};
}

void reread(DenseMappingConfig& config, const std::string& yaml, const std::string& origin,
            const std::function<std::string(const std::string&)>& found) {
  dense_mapping_table(config).read_yaml(yaml, origin);
  config.odometry.machine_boxes_file = found(config.odometry.machine_boxes_file);
  std::string& plots = config.inventory.stand.plots;
  if (!is_plot_text(plots)) plots = found(plots);
}

}  // namespace understory
