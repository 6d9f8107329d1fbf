#include "understory/pipeline/georeferencing/methods/tree_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "understory/features/tree_tops.h"
#include "understory/forest/ground/canopy.h"
#include "understory/forest/ground/ground.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/georeference/trees/tree_map_file.h"
#include "understory/pipeline/inventory/stand_cloud.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The highest return above the ground in each cell.
Raster canopy_of(const PointBlocks& blocks, const GroundModel& ground, const Vector2d& origin,
                 const TreeTargetConfig& config) {
  CanopyCeiling ceiling;
  CanopyGrid grid(config.canopy_cell_m);
  std::vector<double> heights;
  for (const bool counting : {true, false}) {
    blocks([&](std::span<const Vector3d> points) {
      ground.heights_above(points, heights);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (!(heights[i] >= 0.0 && heights[i] <= config.tallest_m)) continue;
        const Vector2d place = points[i].head<2>() - origin;
        if (counting)
          ceiling.count(place, heights[i]);
        else if (ceiling.holds(place, heights[i]))
          grid.add(place, heights[i]);
      }
    });
    if (counting) ceiling.settle();
  }
  return grid.raster(origin.x(), origin.y());
}

TreeMapFile tops_of(const std::filesystem::path& path, const std::string& system,
                    const TreeTargetConfig& config, Log& log, const ProgressSink& progress) {
  const StandCloud stand = read_stand(path, {}, log, progress);
  if (!stand.doubt.empty())
    throw InputError(path.string(), "", "expected a cloud in metres with z up: " + stand.doubt);
  const PointBlocks unasked = blocks_of(stand.cloud);
  const PointBlocks blocks = polled(unasked, progress);
  const GroundModel ground = estimate_ground(unasked, {}, progress);
  TreeMapFile map;
  map.coordinate_system =
      stand.cloud.coordinate_system.empty() ? system : stand.cloud.coordinate_system;
  if (ground.terrain.empty()) return map;
  const Vector2d origin(std::round(ground.terrain.x0), std::round(ground.terrain.y0));
  for (const CanopyTop& top : find_canopy_tops(canopy_of(blocks, ground, origin, config), {})) {
    Tree tree;
    tree.id = static_cast<int>(map.trees.size()) + 1;
    tree.x = top.at.x();
    tree.y = top.at.y();
    tree.z = ground.terrain.interpolate(top.at.x(), top.at.y());
    tree.height_m = top.height_m;
    map.trees.push_back(tree);
  }
  if (map.trees.empty())
    throw InputError(path.string(), "", "expected a cloud of trees: no top was found in it");
  return map;
}

// The middle of the trees, by medians.
Vector3d middle_of(const std::vector<Tree>& trees) {
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> z;
  for (const Tree& tree : trees) {
    x.push_back(tree.x);
    y.push_back(tree.y);
    if (std::isfinite(tree.z)) z.push_back(tree.z);
  }
  return {upper_median(x), upper_median(y), upper_median(z)};
}

GeodeticPlace place_in(const CoordinateSystem& system, const Vector3d& point,
                       const std::filesystem::path& path) {
  const auto place = system.to_place(point);
  if (!place)
    throw InputError(path.string(), "",
                     fmt::format("expected coordinates of its coordinate system: x {:.2f}, y "
                                 "{:.2f} is no place in it",
                                 point.x(), point.y()));
  return *place;
}

// From the coordinate system to east, north, up, every tree by the full transform.
void bring_home(const TreeMapFile& map, const std::filesystem::path& path,
                const std::optional<GeodeticPlace>& place, TreeTarget& target) {
  const CoordinateSystem system(map.coordinate_system);
  const Vector3d middle = middle_of(target.trees);
  Vector3d about = middle;
  if (target.near) about.head<2>() = *target.near;
  target.origin = target.near || !place ? place_in(system, about, path) : *place;
  const EastNorthUp frame(*target.origin);
  for (Tree& tree : target.trees) {
    const bool ground_known = std::isfinite(tree.z);
    const Vector3d at = frame.from_place(
        place_in(system, {tree.x, tree.y, ground_known ? tree.z : middle.z()}, path));
    tree.x = at.x();
    tree.y = at.y();
    tree.z = ground_known ? at.z() : Tree::kUnknown;
  }
  if (target.near) target.near = Vector2d::Zero();
}

// The largest coordinate of the box around the trees.
double farthest_of(const TreeTarget& target) {
  return std::max(target.low.cwiseAbs().maxCoeff(), target.high.cwiseAbs().maxCoeff());
}

}  // namespace

TreeTarget read_tree_target(const std::filesystem::path& path, const std::string& system,
                            const std::optional<Vector2d>& near,
                            const std::optional<GeodeticPlace>& place,
                            const TreeTargetConfig& config, Log& log,
                            const ProgressSink& progress) {
  TreeTarget target;
  target.from_cloud = has_map_name(path);
  if (!std::filesystem::exists(path))
    throw InputError(path.string(), "", "expected a map of trees: no such file");
  const TreeMapFile map = target.from_cloud ? tops_of(path, system, config, log, progress)
                                            : read_tree_map(path, system);
  for (const std::string& remark : map.remarks)
    log.info(path.string() + ": " + remark);
  target.trees = map.trees;
  target.near = near;
  if (!map.coordinate_system.empty()) bring_home(map, path, place, target);
  target.low = target.high = {target.trees.front().x, target.trees.front().y};
  for (const Tree& tree : target.trees) {
    target.low = target.low.cwiseMin(Vector2d(tree.x, tree.y));
    target.high = target.high.cwiseMax(Vector2d(tree.x, tree.y));
  }
  const double width = (target.high - target.low).norm();
  if (!target.origin && width < config.narrowest_m && target.trees.size() > 1)
    throw InputError(path.string(), "",
                     fmt::format("expected metres: all trees lie within {:.2g} of each other. Give "
                                 "--tree-map-crs EPSG:4326 if these are degrees",
                                 width));
  if (!target.origin && farthest_of(target) > config.farthest_m)
    throw InputError(path.string(), "",
                     "expected a coordinate system: the file states none, and its coordinates are "
                     "not those of a local frame. Give --tree-map-crs EPSG:CODE");
  return target;
}

}  // namespace understory
