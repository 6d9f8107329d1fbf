#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/ground_area.h"

namespace understory {

// Points of one slice that hang together.
struct PointGroup {
  std::vector<Eigen::Vector2f> points;  // metres
  std::uint64_t place = 0;  // of its first cell: the same wherever else points are added
  GroundArea window;        // a circle counts here if its centre lies in this
};

// How points are grouped.
struct PointGroupConfig {
  double reach_m = 0.08;  // cells of this size that touch, also by a corner, hang together
  int min_points = 5;     // of a group
  double margin_m = 1.3;  // a window of a large group also holds the points so near to it
  bool whole = false;     // none is cut
  GroundArea area;        // groups that reach into it are asked for
  // Where the frame of the points begins. Groups of one cloud have the same place in any frame that
  // begins at a multiple of the reach.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
};

// Groups by their places. A group of undergrowth may go on for a hundred metres. One that is longer
// than 4 m is cut by a fixed grid of windows of 8 m. What is found at a place then depends only on
// points within group_reach_m of it. Single precision: `points` lie within some km of zero.
[[nodiscard]] std::vector<PointGroup> groups_near(const std::vector<Eigen::Vector2f>& points,
                                                  const PointGroupConfig& config);

// m: the margin of windows for circles of this radius and band.
[[nodiscard]] double group_margin_m(double max_radius_m, double band_m);
// m: what lies farther away has no influence on the circles at a place.
[[nodiscard]] double group_reach_m(double max_radius_m, double band_m);

}  // namespace understory
