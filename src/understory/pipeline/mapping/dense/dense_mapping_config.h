#pragma once

#include <functional>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/obstacles.h"
#include "understory/georeference/satellites/in_match/satellite_belief.h"
#include "understory/map/carrier_region.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/odometry/dense/dense_odometry.h"
#include "understory/pipeline/georeferencing/gnss_in_graph.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/mapping/event_loop_config.h"
#include "understory/pipeline/run_folder/output_config.h"
#include "understory/util/config/config.h"
#include "understory/util/config/config_origins.h"

namespace understory {

// Everything that can be set for the dense front end. Each part is described where it belongs; this
// is only their sum.
struct DenseMappingConfig {
  EventLoopConfig loop;
  bool imu_rate = false;  // write trajectory_imu.tum: a prediction for each sample of the IMU
  // Refine place and clock of the IMU from the recording itself.
  bool refine_imu = false;
  // Below 1: each such part of a scan gives a pose of its own, in trajectory_partial.tum.
  double scan_fraction = 1.0;
  DenseOdometryConfig odometry;
  KeyframeMap::Config keyframe_map;
  CarrierSearchConfig carrier;
  MapTiles::Config map;
  double keyframe_thin_m = 0.02;  // thins a scan's cloud before it is stored for the map
  double map_range_max_m = 60.0;  // farther returns do not enter the finished map
  bool map_enabled = true;        // write map.laz and what is made from it
  bool copc = false;              // the same points as map.copc.laz beside it
  InventoryConfig inventory = basic_inventory();
  ObstacleConfig obstacles;
  GeoreferenceConfig georeference;
  OutputConfig output;
  GnssUseConfig gnss;
  SatelliteBeliefConfig satellites;
  JudgementConfig judgement;
  MotionLimits motion_limits;
  double cloud_distance_m = 1.0;  // weighted distance (37) between scans whose clouds are kept
  // The same between scans of which only what is far is kept; 0: none. adapt() sets it for a full
  // inventory.
  double far_cloud_distance_m = 0.0;
  double far_m = 12.0;  // from the lidar on: what is far
  // A lidar whose full scans have fewer points than this (16 beams) gets other settings, where
  // nobody set them (adapt()). Thinned like dense scans, its scans would leave too few points in a
  // cell.
  int sparse_scan_points = 60000;
  // Of these, preprocess.voxel.voxel_size_m. Maps by the sleigh had been 0.2 % too small with 0.4
  // m.
  double sparse_voxel_m = 0.1;
  int lost_after_scans = 30;   // unmatched scans in a row after which a new segment begins
  double max_memory_mb = 0.0;  // resident, MB of 10^6 bytes; 0: no limit
  // What follows from it (memory_plan.h), no setting of its own: bytes that the inventory of the
  // finished map may take; 0: any.
  double inventory_bytes = 0.0;
};

// The table of all keys, bound to `config`.
[[nodiscard]] ConfigTable dense_mapping_table(DenseMappingConfig& config);

// Names of the shipped profiles, and their YAML text. Throws ConfigError for an unknown name.
[[nodiscard]] std::vector<std::string> profile_names();
[[nodiscard]] std::string profile_text(const std::string& name);

// Defaults, then the profile, then the file, then the settings ("key=value"). Empty = none.
[[nodiscard]] ReadConfig<DenseMappingConfig> read_dense_mapping_config(
    const std::string& profile, const std::string& file, const std::vector<std::string>& settings);

// A configuration as `to_yaml` of its table wrote it; `found` says where a file lies now that is
// named in it. Throws ConfigError.
void reread(DenseMappingConfig& config, const std::string& yaml, const std::string& origin,
            const std::function<std::string(const std::string&)>& found);

}  // namespace understory
