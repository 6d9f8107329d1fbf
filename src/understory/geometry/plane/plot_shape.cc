#include "understory/geometry/plane/plot_shape.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace understory {
namespace {

// Corners of the polygon that stands for a circle: its border is within 0.02 % of the radius.
constexpr int kCircleCorners = 180;

double distance_to_segment(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                           const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((point - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (point - a - t * along).norm();
}

}  // namespace

double signed_area_m2(const PlaneRing& ring) {
  double twice = 0.0;
  if (ring.empty()) return 0.0;
  // From the first point on, so that large coordinates lose no digits.
  const Eigen::Vector2d origin = ring.front();
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Eigen::Vector2d a = ring[i] - origin;
    const Eigen::Vector2d b = ring[(i + 1) % ring.size()] - origin;
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * twice;
}

void orient(PlaneRing& ring, bool against_the_clock) {
  if ((signed_area_m2(ring) > 0.0) != against_the_clock) std::reverse(ring.begin(), ring.end());
}

double PlotShape::area_m2() const {
  double sum = 0.0;
  for (const PlaneRing& ring : rings)
    sum += signed_area_m2(ring);
  return sum;
}

std::vector<double> PlotShape::crossings(double y) const {
  std::vector<double> places;
  for (const PlaneRing& ring : rings) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Eigen::Vector2d& a = ring[i];
      const Eigen::Vector2d& b = ring[(i + 1) % ring.size()];
      if ((a.y() > y) == (b.y() > y)) continue;
      places.push_back(a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
    }
  }
  std::sort(places.begin(), places.end());
  return places;
}

bool PlotShape::contains(const Eigen::Vector2d& point) const {
  const std::vector<double> places = crossings(point.y());
  const auto left = std::upper_bound(places.begin(), places.end(), point.x()) - places.begin();
  return left % 2 == 1;
}

double PlotShape::distance_to_border(const Eigen::Vector2d& point) const {
  double least = std::numeric_limits<double>::infinity();
  for (const PlaneRing& ring : rings) {
    for (std::size_t i = 0; i < ring.size(); ++i)
      least = std::min(least, distance_to_segment(point, ring[i], ring[(i + 1) % ring.size()]));
  }
  return least;
}

Eigen::Vector4d PlotShape::box() const {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Eigen::Vector4d box(kFar, kFar, -kFar, -kFar);
  for (const PlaneRing& ring : rings) {
    for (const Eigen::Vector2d& point : ring) {
      box.head<2>() = box.head<2>().cwiseMin(point);
      box.tail<2>() = box.tail<2>().cwiseMax(point);
    }
  }
  return box;
}

PlotShape circle_plot(const std::string& id, const Eigen::Vector2d& centre, double radius_m,
                      const Eigen::Matrix2d& squeeze) {
  PlotShape shape;
  shape.id = id;
  shape.kind = "circle";
  shape.centre = centre;
  shape.radius_m = radius_m;
  const double step = 2.0 * M_PI / kCircleCorners;
  const double corner_radius = radius_m * std::sqrt(step / std::sin(step));
  PlaneRing ring;
  for (int i = 0; i < kCircleCorners; ++i) {
    const Eigen::Vector2d on_unit(std::cos(i * step), std::sin(i * step));
    ring.push_back(centre + corner_radius * (squeeze * on_unit));
  }
  orient(ring, true);
  shape.rings.push_back(std::move(ring));
  return shape;
}

Eigen::Matrix2d slope_squeeze(const Eigen::Vector2d& gradient) {
  const double rise = gradient.norm();
  if (!(rise > 0.0)) return Eigen::Matrix2d::Identity();
  const Eigen::Vector2d along = gradient / rise;
  const double cosine = 1.0 / std::sqrt(1.0 + rise * rise);
  return Eigen::Matrix2d::Identity() - (1.0 - cosine) * along * along.transpose();
}

}  // namespace understory
