#pragma once

#include <filesystem>
#include <string>

#include "understory/forest/inventory.h"
#include "understory/pipeline/inventory/stand_cloud.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory inventory`.
struct InventoryRequest {
  std::string cloud;  // a point cloud, or a run folder: then its map.laz
  std::filesystem::path run_folder;
  bool overwrite = false;  // what an earlier run left in the folder
  CloudFrame frame;
  // Where the scanner was, frame of the cloud: `timestamp_s x y z qx qy qz qw` a line. Empty: that
  // of the run, if there is one.
  std::filesystem::path trajectory;
  bool slice = false;  // the cloud is one thin cut near breast height: only diameters and places
  std::string coordinate_system;  // of a cloud that names none: "EPSG:3067" or WKT; empty: unknown
  InventoryConfig config;
  CloudTilesConfig tiles;
  bool copc = false;           // map.copc.laz beside map.laz; of a full inventory
  ConfigRecord config_record;  // for run.json
  std::string config_file;     // that the user named; not to be overwritten
};

// From a point cloud to the run folder. Of a run's map the results are in the frames of the run:
// trees.csv in its world frame, the layers in its coordinate system. Writes ground, trees, rasters,
// report. Throws InputError where the cloud cannot be read or is neither in metres nor upright,
// OutputError, and Stopped where the user stops it. The folder is then as it was.
[[nodiscard]] RunOutcome run_inventory(const InventoryRequest& request, Log& log,
                                       const ProgressSink& progress);

}  // namespace understory
