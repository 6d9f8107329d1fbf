#include "understory/georeference/systems/geodetic.h"

#include <cmath>

#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kSemiMajor = 6378137.0;  // WGS 84
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricity2 = kFlattening * (2.0 - kFlattening);

// Radius of curvature across the meridian.
double across(double latitude) {
  const double s = std::sin(latitude);
  return kSemiMajor / std::sqrt(1.0 - kEccentricity2 * s * s);
}

Eigen::Vector3d ecef(const GeodeticPlace& place) {
  const double lat = place.latitude_deg * kDegree;
  const double lon = place.longitude_deg * kDegree;
  const double n = across(lat);
  return {(n + place.height_m) * std::cos(lat) * std::cos(lon),
          (n + place.height_m) * std::cos(lat) * std::sin(lon),
          (n * (1.0 - kEccentricity2) + place.height_m) * std::sin(lat)};
}

}  // namespace

EastNorthUp::EastNorthUp(const GeodeticPlace& origin)
    : origin_(origin), origin_in_ecef_(ecef(origin)) {
  const double lat = origin.latitude_deg * kDegree;
  const double lon = origin.longitude_deg * kDegree;
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0.0);
  const Eigen::Vector3d north(-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon),
                              std::cos(lat));
  const Eigen::Vector3d up(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon),
                           std::sin(lat));
  ecef_from_enu_ << east, north, up;
}

Eigen::Vector3d EastNorthUp::from_place(const GeodeticPlace& place) const {
  return ecef_from_enu_.transpose() * (ecef(place) - origin_in_ecef_);
}

GeodeticPlace EastNorthUp::to_place(const Eigen::Vector3d& point_in_enu) const {
  const Eigen::Vector3d p = origin_in_ecef_ + ecef_from_enu_ * point_in_enu;
  const double plane = std::hypot(p.x(), p.y());
  double latitude = std::atan2(p.z(), plane * (1.0 - kEccentricity2));
  double height = 0.0;
  for (int i = 0; i < 6; ++i) {  // each step gains three digits or more
    const double n = across(latitude);
    const double s = std::sin(latitude);
    height = plane * std::cos(latitude) + p.z() * s - n * (1.0 - kEccentricity2 * s * s);
    latitude = std::atan2(p.z(), plane * (1.0 - kEccentricity2 * n / (n + height)));
  }
  return {latitude / kDegree, std::atan2(p.y(), p.x()) / kDegree, height};
}

Pose change_of_frame(const GeodeticPlace& from, const GeodeticPlace& into) {
  const EastNorthUp source(from);
  const EastNorthUp target(into);
  const Eigen::Matrix3d rotation = target.ecef_from_enu_.transpose() * source.ecef_from_enu_;
  const Eigen::Vector3d shift =
      target.ecef_from_enu_.transpose() * (source.origin_in_ecef_ - target.origin_in_ecef_);
  return {Eigen::Quaterniond(rotation), shift};
}

}  // namespace understory
