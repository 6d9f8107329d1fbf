#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "understory/georeference/geodetic.h"

namespace understory {

// A coordinate system by PROJ: every point goes through the full transform, as grid north turns
// from true north and grid scale is not 1. x is east (or longitude), y north (or latitude). Heights
// are passed through unless the system has a vertical part that PROJ can follow. Not thread-safe.
class CoordinateSystem {
 public:
  // "EPSG:3067" or WKT. Throws ConfigError if it is not a system.
  explicit CoordinateSystem(const std::string& definition);
  ~CoordinateSystem();
  CoordinateSystem(const CoordinateSystem&) = delete;
  CoordinateSystem& operator=(const CoordinateSystem&) = delete;

  // Nothing where the system is not defined for the place.
  [[nodiscard]] std::optional<Eigen::Vector3d> from_place(const GeodeticPlace& place) const;
  // The way back. Nothing where the system is not defined there.
  [[nodiscard]] std::optional<GeodeticPlace> to_place(const Eigen::Vector3d& point) const;
  [[nodiscard]] bool is_geographic() const;  // degrees instead of metres

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Metres per unit of a projected system in the plane ("EPSG:2276" or WKT): 0.3048006 for US survey
// feet. 0 for one in degrees, NaN where nothing is known (an empty or strange definition).
[[nodiscard]] double metres_per_unit(const std::string& definition);

// "EPSG:32635": the UTM zone of a place, WGS 84.
[[nodiscard]] std::string utm_zone(const GeodeticPlace& place);

}  // namespace understory
