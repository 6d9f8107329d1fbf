#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "understory/forest/inventory.h"
#include "understory/forest/stand/stand_table.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/report/map_picture.h"

namespace understory {

// trees.csv, and of a full inventory stem_curves.csv. Throws OutputError.
void write_tree_tables(const std::filesystem::path& folder, const InventoryResult& inventory);

// Writes trees.csv, stem_curves.csv (of a full inventory), trees.gpkg, dtm.tif, chm.tif and dsm.tif
// into `folder` (the rasters only where there is one). The inventory is in the world frame of
// `layers`; trees.csv stays in it. Where there are plots they come into trees.gpkg. Throws
// OutputError.
void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const LayerFrame& layers, const std::vector<StandPlot>& plots = {});
// The same of a cloud that is in the coordinate system `crs` ("EPSG:25832" or WKT) already; empty
// for a local frame.
void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const std::string& crs, const std::vector<StandPlot>& plots = {});

// trees.csv and trees.gpkg of a cut: it has no ground and no canopy. Throws OutputError.
void write_slice_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                       const std::string& crs);

// Adds a block of a cloud (world frame) to the picture of the map, in the frame that it is drawn
// in.
void add_to_picture(MapPicture& picture, std::span<const Eigen::Vector3d> points,
                    const GroundModel& ground, const LayerFrame& drawing);

}  // namespace understory
