#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/geometry/raster.h"
#include "understory/sensor/tree.h"

namespace understory {

// GeoTIFF, float32, deflate, NaN as no-data. `crs_wkt` is WKT or
// "EPSG:25832"; empty: local coordinates, no system.
void write_geotiff(const std::filesystem::path& path, const Raster& raster,
                   const std::string& crs_wkt);

// GeoPackage with one layer `trees` of points (x, y, z = ground) and the columns of trees.csv.
void write_trees_gpkg(const std::filesystem::path& path, const std::vector<Tree>& trees,
                      const std::string& crs_wkt);

}  // namespace understory
