#include "understory/pipeline/georeferencing/methods/terrain_placement.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "understory/georeference/terrain_file.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace pipeline_constants::georeferencing;

namespace fs = std::filesystem;
using Eigen::Vector3d;

// Points on the ground, before the fit: cells of the run's own terrain model where it has one, else
// the feet of its trees.
std::vector<GroundPoint> ground_of(const GeoreferenceRequest& request, const MovableRun& run) {
  std::vector<GroundPoint> points;
  if (fs::exists(request.run / "dtm.tif")) {
    const LayerFrame& layers = *run.layers;
    PlaneArea area{Eigen::Vector2d::Constant(std::numeric_limits<double>::max()),
                   Eigen::Vector2d::Constant(std::numeric_limits<double>::lowest())};
    for (const StampedPose& pose : run.trajectory) {
      const Vector3d at = layers.from_world(pose.world_from_body.translation());
      area.low = area.low.cwiseMin(at.head<2>());
      area.high = area.high.cwiseMax(at.head<2>());
    }
    area.low.array() -= kReachM * layers.units_per_metre();
    area.high.array() += kReachM * layers.units_per_metre();
    const Raster own = read_terrain(request.run / "dtm.tif", area, std::nullopt);
    const int step =
        std::max(1, static_cast<int>(std::lround(layers.units_per_metre() / own.cell_m)));
    for (int row = 0; row < own.rows; row += step) {
      for (int column = 0; column < own.columns; column += step) {
        const double x = own.x0 + (column + 0.5) * own.cell_m;
        const double y = own.y0 + (row + 0.5) * own.cell_m;
        const double z = own.cell_value(x, y);
        if (std::isfinite(z)) points.push_back({layers.to_world({x, y, z}), 0.1});
      }
    }
    return points;
  }
  if (!run.has_trees)
    throw InputError(request.run.string(), "",
                     "expected dtm.tif or trees.csv: points on the ground");
  for (const Tree& tree : run.trees)
    points.push_back({{tree.x, tree.y, tree.z}, 0.1});
  return points;
}

PlaneArea area_of(const std::vector<GroundPoint>& points, double margin_m) {
  PlaneArea area;
  if (points.empty()) return area;
  area.low = area.high = points.front().point_in_world.head<2>();
  for (const GroundPoint& point : points) {
    area.low = area.low.cwiseMin(point.point_in_world.head<2>());
    area.high = area.high.cwiseMax(point.point_in_world.head<2>());
  }
  area.low.array() -= margin_m;
  area.high.array() += margin_m;
  return area;
}

}  // namespace

LevelledRun level_run(const GeoreferenceRequest& request, const MovableRun& run, const Pose& placed,
                      const std::optional<GeodeticPlace>& origin, const TerrainFitConfig& config) {
  std::vector<GroundPoint> points = ground_of(request, run);
  for (GroundPoint& point : points)
    point.point_in_world = placed * point.point_in_world;
  double place_sd_m = config.place_sd_m;
  if (config.known) place_sd_m = kReachM / 3.0;
  const Raster terrain =
      read_terrain(request.terrain_model, area_of(points, 10.0 + 3.0 * place_sd_m), origin);
  LevelledRun levelled{fit_to_terrain(points, terrain, config), placed};
  if (!levelled.fit.found)
    throw InputError(request.terrain_model.string(), "", levelled.fit.reason);
  levelled.target_from_world = levelled.fit.terrain_from_world * placed;
  return levelled;
}

void tell_levelled(const GeoreferenceRequest& request, const LevelledRun& levelled,
                   Placement& placement) {
  const TerrainFit& fit = levelled.fit;
  const Vector3d before = fit.terrain_from_world.inverse() * fit.middle;
  placement.figures.merge(std::map<std::string, Figure>{
      {"terrain_points", static_cast<std::int64_t>(fit.points)},
      {"terrain_points_used", static_cast<std::int64_t>(fit.used)},
      {"terrain_mean_before_m", fit.mean_before_m},
      {"terrain_rms_before_m", fit.rms_before_m},
      {"terrain_rms_m", fit.rms_m},
      {"terrain_median_m", fit.median_m},
      {"terrain_tilt_deg", fit.tilt_deg},
      {"terrain_moved_plane_m", (fit.middle - before).head<2>().norm()},
      {"terrain_place_sd_m", fit.place_sd_m},
      {"terrain_yaw_sd_deg", fit.yaw_sd_deg}});
  placement.summary += fmt::format(
      "{} of {} points on the ground used; vertical turned by {:.2f} degrees\nheights above the "
      "terrain {:.2f} m before (without their mean), {:.2f} m after, {:.2f} m in the median",
      fit.used, fit.points, fit.tilt_deg, fit.rms_before_m, fit.rms_m, fit.median_m);
  if (2 * fit.used < fit.points)
    placement.doubt(fmt::format("only {} of {} points on the ground agree with the terrain model",
                                fit.used, fit.points));
  if (const double spread_m = kSdOverMad * fit.median_m; spread_m > kMostTerrainSpreadM)
    placement.doubt(
        fmt::format("the ground does not fit the terrain model: after the fit its heights differ "
                    "by {:.2f} m (one standard deviation). The file may be a surface or canopy "
                    "model, or have another datum",
                    spread_m));
  placement.inputs.push_back(hash_input(request.terrain_model));
  if (fs::exists(request.run / "dtm.tif"))
    placement.inputs.push_back(hash_input(request.run / "dtm.tif"));
}

}  // namespace understory
