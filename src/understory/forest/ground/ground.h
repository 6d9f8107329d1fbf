#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "understory/forest/ground/unseen_ground.h"
#include "understory/forest/point_blocks.h"
#include "understory/geometry/raster.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// The terrain under a stand, found by letting a cloth fall on the cloud turned upside down (P4-9:
// cloth simulation filter, W. Zhang et al., Remote Sensing 8(6):501, 2016) and then laying a smooth
// surface through the points that the cloth touched.
struct GroundConfig {
  double cell_m = 0.5;     // of the terrain model and between the nodes of the cloth
  int stiffness = 2;       // times the inner forces act in a step: 1 steep, 2 rolling, 3 flat
  int steps = 500;         // at most
  double touch_m = 0.5;    // points this near to the cloth are ground for the terrain model
  double class_m = 0.20;   // points this near to the terrain model are of class ground
  double max_gap_m = 8.0;  // how far terrain is filled in from the nearest ground point
};
void describe(ConfigTable& table, GroundConfig& config);

// The ground under a cloud, as a raster in the frame of the cloud, metres.
struct GroundModel {
  Raster terrain;  // z of the ground
  GroundConfig config;
  UnseenGround unseen;          // how sure the terrain is
  double measured_share = 0.0;  // of the cells with a height: those that held ground points

  // Metres above the ground; NaN where the terrain is unknown.
  [[nodiscard]] double height_above(const Eigen::Vector3d& point) const;
  // The same for many points, on all threads.
  void heights_above(std::span<const Eigen::Vector3d> points, std::vector<double>& heights) const;
  // LAS classes: 2 ground, 3 / 4 / 5 low, medium, high vegetation (to 0.5 m, to 2 m, above),
  // 1 unclassified (no terrain there), 7 noise (more than a metre below the ground).
  [[nodiscard]] std::uint8_t las_class(double height_above_ground) const;
};

// Memory grows with the area, not with the number of points. Deterministic for any number of
// threads and any order of points, but for `level_m`: heights are held in single precision above
// it. Without it above the first point. The result has an empty terrain if there are no points.
// Polls `progress`.
[[nodiscard]] GroundModel estimate_ground(const PointBlocks& cloud, const GroundConfig& config,
                                          const ProgressSink& progress = {},
                                          std::optional<double> level_m = std::nullopt);

}  // namespace understory
