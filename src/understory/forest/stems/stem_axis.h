#pragma once

#include <Eigen/Core>
#include <cmath>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

inline constexpr double kBreastHeight = 1.3;

// Distance of a point from the centre line, and its height along it over breast height.
struct AxisPlace {
  double distance_m = 0.0;
  double along_m = 0.0;
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();  // unit, from the axis to the point
};

// The centre line of a stem and its cone, ready to be asked about many points.
class StemAxis {
 public:
  explicit StemAxis(const StemFit& stem)
      : centre_(stem.centre),
        axis_(Eigen::Vector3d(stem.slope.x(), stem.slope.y(), 1.0) /
              std::sqrt(1.0 + stem.slope.squaredNorm())),
        radius_m_(stem.radius_m),
        taper_(stem.taper) {}

  [[nodiscard]] AxisPlace place(const SlicePoint& point) const {
    const Eigen::Vector3d q(static_cast<double>(point.x) - centre_.x(),
                            static_cast<double>(point.y) - centre_.y(),
                            static_cast<double>(point.height_m) - kBreastHeight);
    AxisPlace place;
    place.along_m = q.dot(axis_);
    const Eigen::Vector3d out = q - place.along_m * axis_;
    place.distance_m = out.norm();
    if (place.distance_m > 0.0) place.outward = out / place.distance_m;
    return place;
  }
  // Whether a point may lie within `reach` of the centre line: false only if it does not.
  [[nodiscard]] bool may_be_within(const SlicePoint& point, double reach) const {
    // Across the axis a horizontal distance shrinks at most by the cosine of the lean.
    const double run = (static_cast<double>(point.height_m) - kBreastHeight) / axis_.z();
    const double x = static_cast<double>(point.x) - centre_.x() - run * axis_.x();
    const double y = static_cast<double>(point.y) - centre_.y() - run * axis_.y();
    return (x * x + y * y) * axis_.z() * axis_.z() <= reach * reach * (1.0 + 1e-9);
  }
  // How far a point lies outside of the surface; negative inside.
  [[nodiscard]] double surface_error(const AxisPlace& place) const {
    return place.distance_m - (radius_m_ + taper_ * place.along_m);
  }
  [[nodiscard]] double surface_error(const SlicePoint& point) const {
    return surface_error(place(point));
  }

 private:
  Eigen::Vector2d centre_;
  Eigen::Vector3d axis_;
  double radius_m_;
  double taper_;
};

}  // namespace understory
