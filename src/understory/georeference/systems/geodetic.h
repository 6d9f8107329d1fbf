#pragma once

#include <Eigen/Core>

#include "understory/geometry/pose.h"

namespace understory {

// A place on WGS 84. Degrees; height above the ellipsoid, metres.
struct GeodeticPlace {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
};

// The local frame east, north, up with its origin at a place. Exact to a nanometre within the
// height of aircraft. Immutable, thread-safe.
class EastNorthUp {
 public:
  explicit EastNorthUp(const GeodeticPlace& origin);

  [[nodiscard]] const GeodeticPlace& origin() const { return origin_; }
  [[nodiscard]] Eigen::Vector3d from_place(const GeodeticPlace& place) const;
  [[nodiscard]] GeodeticPlace to_place(const Eigen::Vector3d& point_in_enu) const;

 private:
  GeodeticPlace origin_;
  Eigen::Vector3d origin_in_ecef_;
  Eigen::Matrix3d ecef_from_enu_;

  friend Pose change_of_frame(const GeodeticPlace& from, const GeodeticPlace& into);
};

// The motion that brings points of the frame east, north, up at `from` into the one at `into`.
[[nodiscard]] Pose change_of_frame(const GeodeticPlace& from, const GeodeticPlace& into);

}  // namespace understory
