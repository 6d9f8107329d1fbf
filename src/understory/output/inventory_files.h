#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "understory/forest/inventory.h"
#include "understory/output/map_picture.h"

namespace understory {

// Writes trees.csv, trees.gpkg, dtm.tif and chm.tif into `folder` (the rasters only where there is
// one). `crs` is WKT or "EPSG:25832", empty for a local frame. Throws OutputError.
void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const std::string& crs);

// Adds a block of a cloud to the picture of the map.
void add_to_picture(MapPicture& picture, std::span<const Eigen::Vector3d> points,
                    const GroundModel& ground);

}  // namespace understory
