#include "understory/output/layers/layer_files.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/output/copc/copc_writer.h"
#include "understory/output/layers/crown_outlines.h"
#include "understory/output/layers/qgis_project.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr double kAtRestM = 0.1;   // a sensor at rest jitters by millimetres
constexpr double kAroundM = 20.0;  // of the path that a window shows

// Cosine and sine of the turn of the axes in the plane, without sign.
std::array<double, 2> turn_of(const LayerFrame& layers, const Vector3d& point) {
  Vector3d east = layers.from_world(point + Vector3d::UnitX()) - layers.from_world(point);
  if (layers.system() != nullptr && layers.system()->is_geographic())
    east.x() *= std::cos(layers.from_world(point).y() * M_PI / 180.0);
  const double length = east.head<2>().norm();
  return {std::abs(east.x()) / length, std::abs(east.y()) / length};
}

std::string band_meaning(const char* what, const LayerFrame& layers) {
  return layers.wkt().empty() ? std::string(what) : what + (", metres " + layers.heights());
}

}  // namespace

FrameChange change_into(const LayerFrame& layers) {
  return {[&layers](const Vector3d& point) { return layers.from_world(point); },
          [&layers](const Vector3d& point) { return layers.to_world(point); },
          layers.units_per_metre(), layers.is_world()};
}

std::vector<Tree> trees_in(const LayerFrame& layers, const std::vector<Tree>& trees) {
  if (layers.is_world()) return trees;
  std::vector<Tree> placed = trees;
  for (Tree& tree : placed) {
    const Vector3d from(tree.x, tree.y, std::isfinite(tree.z) ? tree.z : 0.0);
    const Vector3d at = layers.from_world(from);
    const auto [c, s] = turn_of(layers, from);
    const double x_sd = tree.x_sd_m;
    const double y_sd = tree.y_sd_m;
    tree.x = at.x();
    tree.y = at.y();
    if (std::isfinite(tree.z)) tree.z = at.z();
    tree.x_sd_m = std::hypot(c * x_sd, s * y_sd);
    tree.y_sd_m = std::hypot(s * x_sd, c * y_sd);
  }
  return placed;
}

PathLine path_in(const LayerFrame& layers, const std::vector<StampedPose>& path) {
  PathLine line;
  if (path.empty()) return line;
  line.begin_s = to_seconds(path.front().stamp);
  line.end_s = to_seconds(path.back().stamp);
  Vector3d last = path.front().world_from_body.translation();
  line.points.push_back(layers.from_world(last));
  for (const StampedPose& pose : path) {
    const Vector3d& here = pose.world_from_body.translation();
    const double step = (here - last).norm();
    if (step < kAtRestM) continue;
    line.length_m += step;
    line.points.push_back(layers.from_world(here));
    last = here;
  }
  return line;
}

std::vector<LookPoint> looks_in(const LayerFrame& layers, const std::vector<LookAgain>& places) {
  std::vector<LookPoint> looks;
  for (const LookAgain& place : places) {
    LookPoint look;
    Vector3d from = place.place;
    if (!std::isfinite(from.z())) from.z() = 0.0;
    look.place = layers.from_world(from);
    const Vector3d towards =
        layers.from_world(from + Vector3d(place.towards.x(), place.towards.y(), 0.0)) - look.place;
    const bool geographic = layers.system() != nullptr && layers.system()->is_geographic();
    const double east = geographic ? std::cos(look.place.y() * M_PI / 180.0) : 1.0;
    const double degrees = std::atan2(east * towards.x(), towards.y()) * 180.0 / M_PI;
    look.bearing_deg = std::round(degrees < 0.0 ? degrees + 360.0 : degrees);
    look.trees = place.trees;
    look.reason = reason_of(place);
    looks.push_back(std::move(look));
  }
  return looks;
}

std::vector<DrawnWood> dead_wood_in(const LayerFrame& layers, const InventoryResult& inventory) {
  std::vector<DrawnWood> drawn;
  if (!inventory.dead_wood) return drawn;
  for (const DeadWood& piece : *inventory.dead_wood)
    drawn.push_back({piece, layers.from_world(piece.from), layers.from_world(piece.to)});
  return drawn;
}

LasOptions las_options(const LayerFrame& layers) {
  LasOptions options;
  options.offset = layers.offset();
  options.scale = layers.resolution();
  options.crs_wkt = layers.wkt();
  return options;
}

void ask_for_copc(LasOptions& options, Log& log) {
  options.copc = suits_copc(options);
  if (options.copc) return;
  log.warn("copc.degrees",
           "map.copc.laz is not written: the cubes of its octree need the same unit along all "
           "axes, and the coordinate system has degrees. Choose one in metres by --crs");
}

std::vector<CrownOutline> crowns_in(const LayerFrame& layers, std::vector<CrownOutline> crowns,
                                    const std::vector<Tree>& trees) {
  if (layers.is_world()) return crowns;
  std::unordered_map<int, double> ground;
  for (const Tree& tree : trees)
    ground.emplace(tree.id, std::isfinite(tree.z) ? tree.z : 0.0);
  for (CrownOutline& crown : crowns) {
    const double z = ground.at(crown.tree);
    for (PlaneRing& ring : crown.rings)
      for (Eigen::Vector2d& point : ring)
        point = layers.from_world({point.x(), point.y(), z}).head<2>();
  }
  return crowns;
}

void write_tree_layers(const std::filesystem::path& folder, const std::vector<Tree>& trees,
                       const std::vector<StampedPose>& path, const LayerFrame& layers) {
  TreeLayers drawn;
  drawn.path = path_in(layers, path);
  drawn.heights = layers.heights();
  write_trees_gpkg(folder / "trees.gpkg", trees_in(layers, trees), layers.wkt(), drawn);
}

void write_tree_layers(const std::filesystem::path& folder, const InventoryResult& inventory,
                       const std::vector<StampedPose>& path, const LayerFrame& layers,
                       const std::vector<StandPlot>& plots) {
  TreeLayers drawn;
  drawn.path = path_in(layers, path);
  drawn.look_again = looks_in(layers, inventory.look_again);
  drawn.plots = plots;
  drawn.dead_wood = dead_wood_in(layers, inventory);
  drawn.crowns = crowns_in(layers, crown_outlines(inventory), inventory.trees);
  drawn.heights = layers.heights();
  write_trees_gpkg(folder / "trees.gpkg", trees_in(layers, inventory.trees), layers.wkt(), drawn);
}

void write_raster_layers(const std::filesystem::path& folder, const Raster& terrain,
                         const Raster& canopy, const FrameChange& change,
                         const LayerFrame& layers) {
  if (terrain.empty()) return;
  const Raster ground = moved_raster(terrain, terrain, change, CellHeights::kOfGround);
  write_geotiff(folder / "dtm.tif", ground, layers.wkt(),
                band_meaning("height of the ground", layers));
  if (canopy.empty()) return;
  const Raster above = moved_raster(canopy, terrain, change, CellHeights::kAboveGround);
  write_geotiff(folder / "chm.tif", above, layers.wkt(), "height of the canopy above the ground");
  write_geotiff(folder / "dsm.tif", absolute_heights(ground, above), layers.wkt(),
                band_meaning("height of the surface, treetops included", layers));
}

void write_layer_project(const std::filesystem::path& folder, const std::string& title,
                         const std::vector<StampedPose>& path, const LayerFrame& layers) {
  constexpr double kFar = std::numeric_limits<double>::max();
  QgisProject project{title, layers.wkt(), layers.code(), {kFar, kFar, -kFar, -kFar}};
  const double around = kAroundM * layers.units_per_metre();
  const PathLine line = path_in(layers, path);
  for (const Vector3d& point : line.points) {
    project.extent[0] = std::min(project.extent[0], point.x() - around);
    project.extent[1] = std::min(project.extent[1], point.y() - around);
    project.extent[2] = std::max(project.extent[2], point.x() + around);
    project.extent[3] = std::max(project.extent[3], point.y() + around);
  }
  write_qgis_project(folder, project);
}

}  // namespace understory
