#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/geometry/raster.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/georeference/systems/moved_raster.h"
#include "understory/output/clouds/las_writer.h"
#include "understory/output/layers/geo_files.h"
#include "understory/sensor/tree.h"
#include "understory/util/log.h"

namespace understory {

// The way from the world frame into the frame of the layers. `layers` must outlive it.
[[nodiscard]] FrameChange change_into(const LayerFrame& layers);

// The trees in the frame of the layers; their standard deviations turn with the axes.
[[nodiscard]] std::vector<Tree> trees_in(const LayerFrame& layers, const std::vector<Tree>& trees);
// The path in the frame of the layers, without the jitter of a sensor at rest.
[[nodiscard]] PathLine path_in(const LayerFrame& layers, const std::vector<StampedPose>& path);

// How map.laz is written: coordinate system, offset, steps.
[[nodiscard]] LasOptions las_options(const LayerFrame& layers);

// Asks for map.copc.laz beside the map.laz of these options. Where an octree does not suit the
// coordinate system it is left out, with a warning ("copc.degrees").
void ask_for_copc(LasOptions& options, Log& log);

// Stumps and lying stems with their ends in the frame of the layers.
[[nodiscard]] std::vector<DrawnWood> dead_wood_in(const LayerFrame& layers,
                                                  const InventoryResult& inventory);
// Places to look from again, in the frame of the layers.
[[nodiscard]] std::vector<LookPoint> looks_in(const LayerFrame& layers,
                                              const std::vector<LookAgain>& places);

// Crowns of the world frame in that of the layers. Their outlines lie at the ground of the trees.
[[nodiscard]] std::vector<CrownOutline> crowns_in(const LayerFrame& layers,
                                                  std::vector<CrownOutline> crowns,
                                                  const std::vector<Tree>& trees);

// Writes trees.gpkg with the layers trees and path (frame of both: world). Throws OutputError.
void write_tree_layers(const std::filesystem::path& folder, const std::vector<Tree>& trees,
                       const std::vector<StampedPose>& path, const LayerFrame& layers);
// The same with the layers look_again, plots and crowns of an inventory.
void write_tree_layers(const std::filesystem::path& folder, const InventoryResult& inventory,
                       const std::vector<StampedPose>& path, const LayerFrame& layers,
                       const std::vector<StandPlot>& plots);

// Writes dtm.tif, and chm.tif and dsm.tif where the canopy is not empty, over cells of the layers'
// grid. `change` leads there from the frame of the rasters. Throws OutputError.
void write_raster_layers(const std::filesystem::path& folder, const Raster& terrain,
                         const Raster& canopy, const FrameChange& change, const LayerFrame& layers);

// Writes map.qgs over what lies in the folder by then. `path` (world frame) is what the window
// shows first. Throws OutputError.
void write_layer_project(const std::filesystem::path& folder, const std::string& title,
                         const std::vector<StampedPose>& path, const LayerFrame& layers);

}  // namespace understory
