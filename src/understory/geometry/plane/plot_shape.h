#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

namespace understory {

// A closed line in the plane, metres. The last point is joined to the first one.
using PlaneRing = std::vector<Eigen::Vector2d>;

// The outline of a sample plot in the horizontal plane, metres, in the frame of its stand. Outer
// rings run against the clock, holes with the clock (`orient` sees to it).
struct PlotShape {
  std::string id;
  // "circle", "polygon", "cell" of a grid, or "seen": all that was seen, which has no rings.
  std::string kind;
  std::vector<PlaneRing> rings;
  // Of a circle: its centre, and the radius as it was given.
  Eigen::Vector2d centre = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  double radius_m = std::numeric_limits<double>::quiet_NaN();

  // Less its holes. 0 without rings.
  [[nodiscard]] double area_m2() const;
  // By the even-odd rule.
  [[nodiscard]] bool contains(const Eigen::Vector2d& point) const;
  // Metres to the nearest point of any ring; infinite without rings.
  [[nodiscard]] double distance_to_border(const Eigen::Vector2d& point) const;
  // Where the line y = `y` crosses the rings, in ascending order. Inside lies between the first and
  // the second crossing, the third and the fourth, and so on.
  [[nodiscard]] std::vector<double> crossings(double y) const;
  // West, south, east and north edge; infinite (and reversed) without rings.
  [[nodiscard]] Eigen::Vector4d box() const;
};

// The area inside a ring by Gauss's formula, positive where it runs against the clock.
[[nodiscard]] double signed_area_m2(const PlaneRing& ring);
// Turns a ring where it does not run as asked.
void orient(PlaneRing& ring, bool against_the_clock);

// A circle of `radius_m` (over 0), as a polygon of the same area. `squeeze` maps the unit circle's
// points first: the identity, or for a radius that was measured along a slope its inverse stretch.
[[nodiscard]] PlotShape circle_plot(const std::string& id, const Eigen::Vector2d& centre,
                                    double radius_m,
                                    const Eigen::Matrix2d& squeeze = Eigen::Matrix2d::Identity());

// What a plane slope does to a circle whose radius was measured along the ground. In the direction
// of the gradient it shrinks by the cosine of the slope. `gradient`: rise per metre along x and y.
[[nodiscard]] Eigen::Matrix2d slope_squeeze(const Eigen::Vector2d& gradient);

}  // namespace understory
