#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// A map of trees as a file holds it.
struct TreeMapFile {
  // x and y in the file's coordinates; z of the ground, NaN where the file has none; heights and
  // diameters in metres, NaN where unknown.
  std::vector<Tree> trees;
  std::string coordinate_system;     // "EPSG:3067" or WKT; empty: local metres, or not known
  std::vector<std::string> remarks;  // what was taken for granted, in words for the user
};

// Reads a map of trees: a CSV table (.csv, .csv.gz, .txt), or points that GDAL reads (GeoPackage,
// shapefile, GeoJSON). Of layers it takes `trees`, else the first one with points.
//
// Columns are found by name in any case: x, y (or east_m, north_m; easting, northing; longitude,
// latitude), z, height_m (or height, h). The diameter is dbh_m (or dbh, d; dbh_cm). A diameter
// without a unit in its name is taken for centimetres where the median is above 2, for millimetres
// above 200. A median that no stand has is remarked on. `crs` is the system of a file that states
// none. Throws InputError where there is no such file, no tree, no position, or a cell is no
// number.
[[nodiscard]] TreeMapFile read_tree_map(const std::filesystem::path& path, const std::string& crs);

}  // namespace understory
