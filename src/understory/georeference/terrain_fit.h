#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/geometry/raster.h"
#include "understory/georeference/combined_place.h"

namespace understory {

// Levelling to a terrain model by one rigid motion (P1 section 3, table 1). Robust least squares
// fit the heights of points on the ground: stem feet, or cells of an own terrain model.
struct TerrainFitConfig {
  // How far off the place and the heading may be to begin with: 0 keeps them, so that only height
  // and tilt are fitted. Otherwise the relief moves them, as far as it can tell.
  double place_sd_m = 0.0;
  double yaw_sd_deg = 0.0;
  // Heights of a terrain model err together over that far. Points nearer to each other count as one
  // in the judgement of how much the relief tells.
  double correlation_m = 5.0;
  // What other sources know of the place that the points were laid on; place_sd_m and yaw_sd_deg
  // do not count then.
  std::optional<PlaceEvidence> known;
};

// A point on the ground; `sd_m` is how well its height is known.
struct GroundPoint {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  double sd_m = 0.1;
};

// The rigid motion that lays ground points on a terrain model, and how well they lie on it. Metres.
struct TerrainFit {
  bool found = false;
  std::string reason;  // if not
  Pose terrain_from_world;
  std::size_t points = 0;     // with terrain below them
  std::size_t used = 0;       // of these, not so far off that they were not used
  double rms_before_m = 0.0;  // heights above the terrain, of all of them, the mean taken off
  double mean_before_m = 0.0;
  double rms_m = 0.0;     // after
  double median_m = 0.0;  // of the absolute heights after
  double tilt_deg = 0.0;  // by which up was turned
  // What is still uncertain after the fit, one standard deviation.
  double place_sd_m = 0.0;
  double yaw_sd_deg = 0.0;
  // The same for all degrees of freedom: the covariance of a turn about the axes of the terrain
  // model (rad), then a shift (m). The turn is through `middle`, the points' mean after the fit.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Matrix6d spread = Matrix6d::Zero();
};

// Not found where fewer than ten points, or points on one line, lie on the terrain. Deterministic.
[[nodiscard]] TerrainFit fit_to_terrain(const std::vector<GroundPoint>& points,
                                        const Raster& terrain, const TerrainFitConfig& config);

}  // namespace understory
