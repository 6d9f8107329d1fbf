#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace understory {

// A QGIS project over the layers of a folder.
struct QgisProject {
  std::string title;
  std::string crs_wkt;   // empty: no system, plane metres
  std::string crs_code;  // "EPSG:3067"; empty where the system has no code
  // What the window shows first: west, south, east, north; all 0: QGIS decides.
  std::array<double, 4> extent{};
};

// Writes map.qgs, which opens what lies in the folder, by relative paths. It knows the layers of
// trees.gpkg (trees, places to look from again, plots and path), chm.tif, dsm.tif, dtm.tif,
// free_height.tif, obstacles.laz and map.laz. QGIS 3.16 or newer; the cloud needs 3.26 and is not
// shown until it is switched on. Throws OutputError.
void write_qgis_project(const std::filesystem::path& folder, const QgisProject& project);
// Its text. `files`: names of the files that are there; `vectors`: names of the layers of
// trees.gpkg.
[[nodiscard]] std::string qgis_project_xml(const QgisProject& project,
                                           const std::vector<std::string>& vectors,
                                           const std::vector<std::string>& files);

}  // namespace understory
