#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"
#include "understory/forest/stand/stand_table.h"
#include "understory/geometry/plane/plot_shape.h"
#include "understory/geometry/raster.h"
#include "understory/sensor/tree.h"

namespace understory {

// Cloud optimized GeoTIFF (tiles, overviews by the mean of the cells from 512 cells on), float32,
// deflate, NaN as no-data. `crs_wkt` is WKT or
// "EPSG:25832"; empty: local coordinates, no system. `meaning` is the description of its band.
void write_geotiff(const std::filesystem::path& path, const Raster& raster,
                   const std::string& crs_wkt, const std::string& meaning = "");

// The path of the scanner as a line on a map.
struct PathLine {
  std::vector<Eigen::Vector3d> points;  // frame of the layer; fewer than two: no line
  double begin_s = 0.0;                 // times as in trajectory.tum
  double end_s = 0.0;
  double length_m = 0.0;
};

// A place to stand at, so that trees are measured again, as a point on a map.
struct LookPoint {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // frame of the layer
  std::vector<int> trees;                           // ids, nearest first
  double bearing_deg = 0.0;                         // to their middle, clockwise from the y axis
  std::string reason;
};

// The crown of one tree, seen from above.
struct CrownOutline {
  int tree = 0;                  // its id
  std::vector<PlaneRing> rings;  // frame of the layer; each hole after the ring around it
};

// A stump or a lying stem on a map, with its ends in the frame of the layer.
struct DrawnWood {
  DeadWood piece;  // as it was measured
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
};

// What trees.gpkg holds beside the layer `trees`. A layer without rows is left out.
struct TreeLayers {
  PathLine path;                      // `path`
  std::vector<LookPoint> look_again;  // `look_again`
  std::vector<StandPlot> plots;       // `plots`: their rings `drawn`, as polygons
  std::vector<CrownOutline> crowns;   // `crowns`: polygons, with what trees.csv says of each crown
  std::vector<DrawnWood> dead_wood;   // `stumps`: points; `logs`: lines from the thick end
  std::string heights;                // what z is above
};

// GeoPackage with the layer `trees` of points (x, y, z = ground) and the columns of trees.csv, and
// the other layers that are not empty. Without a system the layers have srs_id -1 (undefined
// Cartesian), which QGIS takes for metres.
void write_trees_gpkg(const std::filesystem::path& path, const std::vector<Tree>& trees,
                      const std::string& crs_wkt, const TreeLayers& layers = {});

}  // namespace understory
