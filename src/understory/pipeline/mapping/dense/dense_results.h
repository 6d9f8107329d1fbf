#pragma once

#include <memory>
#include <optional>
#include <string>

#include "understory/forest/inventory.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/georeferencing/map_placing.h"
#include "understory/pipeline/inventory/stand_plots.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/pipeline/mapping/dense/dense_trajectory.h"
#include "understory/pipeline/mapping/finished_map.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/mapping/tiled_map.h"
#include "understory/pipeline/run_folder/run_outcome.h"

namespace understory {

// What is made of a run that was read. That of its clouds is empty where no map is wanted.
struct DenseProducts {
  TrajectoryFacts trajectory;
  std::optional<FoundPlacement> placement;  // where it was found before the map was made
  bool has_fixes = false;                   // of satellites
  PlacedMap placed;
  LeftOutCarrier carrier;            // its path is that of `trajectory`
  std::unique_ptr<MapTiles> tiles;   // of the finished cloud
  std::unique_ptr<TiledMap> forest;  // the same as the inventory takes it, which goes before it
  InventoryResult inventory;
  StandResult figures;      // of the stand and its plots, once the frame of the layers is known
  std::string not_upright;  // why z of the map is not up; empty: it is, or an IMU tells it
  LidarViewFigures lidar_view;
};

// How the front end's finished run lies against its `fixes`, which must outlive the result.
[[nodiscard]] MappedPath mapped_path(const ReadRecording& recording, const DenseFrontEnd& front_end,
                                     const Trajectory& trajectory,
                                     const std::vector<GnssFix>& fixes);

// Writes what the dense front end has found beside trajectory, states and fixes, which are written
// by then: keyframes, graph, map, trees, terrain, run.json, report. Throws OutputError.
[[nodiscard]] RunOutcome write_dense_results(const ReadRecording& recording,
                                             DenseFrontEnd& front_end, DenseProducts& made);

}  // namespace understory
