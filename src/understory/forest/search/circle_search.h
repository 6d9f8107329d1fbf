#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/ground_area.h"
#include "understory/util/progress.h"

namespace understory {

// A circle among the points of one horizontal slice.
struct Circle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  double rms_m = 0.0;     // of the points on it
  double arc_deg = 0.0;   // covered by them, in steps of 10 degrees
  double even_deg = 0.0;  // the arc if they lay evenly: small where most are in one place
  int on = 0;             // points on it
  int inside = 0;         // points well within: a stem has none, foliage has many
};

// Which circles count as cross sections of stems. Metres and degrees.
struct CircleSearchConfig {
  double min_radius_m = 0.025;
  double max_radius_m = 0.6;
  double band_m = 0.02;   // points this near to the circle are on it
  double reach_m = 0.08;  // points nearer to each other than about this hang together
  int min_points = 5;
  double min_arc_deg = 50.0;
  GroundArea area;  // circles in it are wanted; some beyond come along
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // of the frame of the points
  // Of a single cut: groups are not cut, and draws are by their number. The area is not looked at.
  bool whole_groups = false;
};

// All circles of each slice. RANSAC samples each group of points that hang together (see
// groups_near), and Gauss-Newton minimises a robust geometric distance. Draws are by the place of a
// group: `seed` and the points near a circle decide on it; points far away and threads do not. The
// time is nearly proportional to the number of points. Polls `progress`. `work` is told how many
// points were sorted, fitted and taken away, each as often as it was.
[[nodiscard]] std::vector<std::vector<Circle>> find_circles(
    const std::vector<std::vector<Eigen::Vector2f>>& slices, const CircleSearchConfig& config,
    std::uint64_t seed, const ProgressSink& progress = {}, std::uint64_t* work = nullptr);

// Least-squares circle through the points near `start`, with Tukey weights over `band_m`; its
// figures are counted anew. on = 0 if it fails.
[[nodiscard]] Circle refine_circle(const std::vector<Eigen::Vector2f>& points, const Circle& start,
                                   double band_m);

}  // namespace understory
