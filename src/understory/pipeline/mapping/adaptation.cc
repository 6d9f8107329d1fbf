#include "understory/pipeline/mapping/adaptation.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/pipeline/mapping/dense/memory_plan.h"
#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::adaptation;

// Changes values of a table that nobody set, and notes each change.
class Changes {
 public:
  Changes(ConfigTable table, const ConfigOrigins& origins)
      : table_(std::move(table)), origins_(origins) {}

  void set(const std::string& key, const std::string& to, const std::string& why,
           double when_s = 0.0) {
    if (origins_.count(key) == 0) set_anyway(key, to, why, when_s);
  }
  void at_most(const std::string& key, double now, double most, const std::string& why) {
    if (now > most) set(key, fmt::format("{}", most), why);
  }
  // Even where the user set it.
  void set_anyway(const std::string& key, const std::string& to, const std::string& why,
                  double when_s) {
    const std::string from = value_of(table_, key);
    set_value(table_, key, to);
    if (value_of(table_, key) != from)
      list_.push_back({key, from, value_of(table_, key), when_s, why});
  }
  [[nodiscard]] std::vector<ConfigAdaptation> list() const { return list_; }

 private:
  ConfigTable table_;
  const ConfigOrigins& origins_;
  std::vector<ConfigAdaptation> list_;
};

// What the matcher itself knows to suit such scans.
void suit_matcher(const DenseMappingConfig& config, const ScanTraits& scans, const std::string& why,
                  Changes& changes, double when_s = 0.0) {
  for (const SuitedSetting& setting : suited_settings(config.keyframe_map.local_map.matcher, scans))
    changes.set("registration." + setting.key, setting.value, why, when_s);
}

// A lidar with few rings, or open land, gives few points. Such a scan is thinned less, its
// keyframes lie closer, and fewer of its points need a match.
void suit_sparse_scans(const DenseMappingConfig& config, const SensorTraits& traits,
                       Changes& changes) {
  if (traits.scan_points == 0 ||
      traits.scan_points >= static_cast<std::uint64_t>(config.sparse_scan_points))
    return;
  const std::string rings = traits.rings > 0 ? fmt::format(" of {} rings", traits.rings) : "";
  const std::string why = fmt::format("{} points a scan{}, fewer than run.sparse_scan_points ({})",
                                      traits.scan_points, rings, config.sparse_scan_points);
  changes.at_most("preprocess.voxel.voxel_size_m", config.odometry.voxel.voxel_size_m,
                  config.sparse_voxel_m, why);
  changes.at_most("registration.min_inlier_ratio", config.odometry.match.min_inlier_ratio,
                  kSparseInlierRatio, why);
  changes.at_most("keyframe.distance_m", config.keyframe_map.keyframe.distance_m, kSparseKeyframeM,
                  why);
  if (config.keyframe_map.keyframe.below_found_share < kSparseFoundShare)
    changes.set("keyframe.below_found_share", fmt::format("{}", kSparseFoundShare), why);
  if (config.odometry.match.few_found_residual < kSparseFewFound)
    changes.set("registration.few_found_residual", fmt::format("{}", kSparseFewFound), why);
  suit_matcher(config, {.sparse = true}, why, changes);
  changes.at_most("map.cloud_distance_m", config.cloud_distance_m, kSparseCloudM, why);
}

// Trees far from the path show little in few clouds.
void suit_full_inventory(const DenseMappingConfig& config, Changes& changes) {
  if (config.inventory.extent != InventoryExtent::kFull) return;
  changes.set("map.far_cloud_distance_m", fmt::format("{}", kFarCloudM),
              "a full inventory: more points of trees far from the path");
}

// Without an IMU predictions are often far off.
void suit_scans_alone(const DenseMappingConfig& config, const SensorTraits& traits,
                      const RunConditions& conditions, Changes& changes) {
  std::string why;
  double when_s = 0.0;
  if (!config.odometry.imu_enabled) {
    why = "the IMU is switched off";
  } else if (traits.imu_is_numb) {
    why = "the IMU's samples are not numbers";
  } else if (!traits.has_imu && !conditions.imu_refined) {
    why = "no IMU whose place is known";
  } else if (!conditions.imu_refused.empty() || conditions.imu_doubted) {
    why = "the IMU contradicts them";
    when_s = conditions.imu_judged_s;
  } else {
    return;
  }
  suit_matcher(config, {.alone = true}, "scans alone: " + why, changes, when_s);
}

// What is told of keys before their meaning.
std::map<std::string, std::string> remarks_on(const std::vector<ConfigAdaptation>& changes,
                                              const ConfigOrigins& origins) {
  std::map<std::string, std::string> remarks;
  for (const auto& [key, origin] : origins)
    remarks[key] = "set by " + origin;
  for (const ConfigAdaptation& change : changes)
    remarks[change.key] = "adapted from " + change.from + ": " + change.why;
  return remarks;
}

constexpr const char* kLive = "--realtime: each sensor is in order, and waiting costs time";

}  // namespace

Adapted<DenseMappingConfig> adapt(const DenseMappingConfig& asked, const ConfigOrigins& origins,
                                  const SensorTraits& traits, const RunConditions& conditions) {
  Adapted<DenseMappingConfig> adapted{asked, {}};
  DenseMappingConfig& config = adapted.config;
  Changes changes(dense_mapping_table(config), origins);
  if (conditions.realtime) changes.set("time_repair.window_s", "0", kLive);
  suit_sparse_scans(asked, traits, changes);
  suit_scans_alone(asked, traits, conditions, changes);
  suit_full_inventory(asked, changes);
  if (!conditions.imu_refused.empty()) {
    changes.set_anyway("motion.imu_enabled", "false", conditions.imu_refused,
                       conditions.imu_judged_s);
  }
  config.keyframe_map.local_map.viewpoint = {traits.lidar_in_body, traits.further_lidars_in_body};
  keep_within_memory(config, traits);
  adapted.changes = changes.list();
  return adapted;
}

Adapted<SparseMappingConfig> adapt(const SparseMappingConfig& asked, const ConfigOrigins& origins,
                                   const RunConditions& conditions) {
  Adapted<SparseMappingConfig> adapted{asked, {}};
  Changes changes(sparse_mapping_table(adapted.config), origins);
  if (conditions.realtime) {
    changes.set("time_repair.window_s", "0", kLive);
    changes.set("stems.pace.longest_gap_s", "0", "--realtime: no scan waits for the next");
  }
  if (!conditions.imu_refused.empty()) {
    changes.set_anyway("stems.imu.use", "false", conditions.imu_refused, conditions.imu_judged_s);
  }
  adapted.changes = changes.list();
  return adapted;
}

// The table is made of the defaults, which it tells; its values are those of the fields later.
std::string commented_yaml(const Adapted<DenseMappingConfig>& adapted,
                           const ConfigOrigins& origins) {
  DenseMappingConfig config;
  const ConfigTable table = dense_mapping_table(config);
  config = adapted.config;
  return yaml_with_remarks(table, remarks_on(adapted.changes, origins));
}

std::string commented_yaml(const Adapted<SparseMappingConfig>& adapted,
                           const ConfigOrigins& origins) {
  SparseMappingConfig config;
  const ConfigTable table = sparse_mapping_table(config);
  config = adapted.config;
  return yaml_with_remarks(table, remarks_on(adapted.changes, origins));
}

void put_origins(BinaryWriter& writer, const ConfigOrigins& origins) {
  writer.put(static_cast<std::uint64_t>(origins.size()));
  for (const auto& [key, origin] : origins) {
    writer.put(key);
    writer.put(origin);
  }
}

ConfigOrigins get_origins(BinaryReader& reader) {
  ConfigOrigins origins;
  const auto count = reader.get<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string key = reader.get_string();
    origins[key] = reader.get_string();
  }
  return origins;
}

void put_conditions(BinaryWriter& writer, const RunConditions& conditions) {
  writer.put(conditions.realtime);
  writer.put(conditions.imu_doubted);
  writer.put(conditions.imu_cleared);
  writer.put(conditions.imu_refused);
  writer.put(conditions.imu_judged_s);
  writer.put(conditions.imu_refined.has_value());
  if (conditions.imu_refined) {
    put_pose(writer, conditions.imu_refined->body_from_imu);
    writer.put(conditions.imu_refined->late_s);
  }
  writer.put(conditions.imu_refinements);
}

RunConditions get_conditions(BinaryReader& reader) {
  RunConditions conditions;
  conditions.realtime = reader.get<bool>();
  conditions.imu_doubted = reader.get<bool>();
  conditions.imu_cleared = reader.get<bool>();
  conditions.imu_refused = reader.get_string();
  conditions.imu_judged_s = reader.get<double>();
  if (reader.get<bool>()) {
    conditions.imu_refined.emplace();
    conditions.imu_refined->body_from_imu = get_pose(reader);
    conditions.imu_refined->late_s = reader.get<double>();
  }
  conditions.imu_refinements = reader.get<int>();
  return conditions;
}

}  // namespace understory
