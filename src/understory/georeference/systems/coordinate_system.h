#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "understory/georeference/systems/geodetic.h"

namespace understory {

// A coordinate system by PROJ: every point goes through the full transform, as grid north turns
// from true north and grid scale is not 1. x is east (or longitude), y north (or latitude). Heights
// are passed through unless the system has a vertical part that PROJ can follow. Not thread-safe.
class CoordinateSystem {
 public:
  // "EPSG:3067", "EPSG:3067+5773" (with a vertical part) or WKT. Throws ConfigError if it is not a
  // system.
  explicit CoordinateSystem(const std::string& definition);
  // Nothing where the constructor would throw.
  [[nodiscard]] static std::optional<CoordinateSystem> find(const std::string& definition);
  ~CoordinateSystem();
  CoordinateSystem(CoordinateSystem&&) noexcept;
  CoordinateSystem& operator=(CoordinateSystem&&) noexcept;

  // Nothing where the system is not defined for the place.
  [[nodiscard]] std::optional<Eigen::Vector3d> from_place(const GeodeticPlace& place) const;
  // The way back. Nothing where the system is not defined there.
  [[nodiscard]] std::optional<GeodeticPlace> to_place(const Eigen::Vector3d& point) const;
  [[nodiscard]] bool is_geographic() const;  // degrees instead of metres
  // Metres per unit in the plane; 0 for degrees.
  [[nodiscard]] double plane_unit_m() const;
  // Metres per unit of heights.
  [[nodiscard]] double height_unit_m() const;
  // "EPSG:3067", "EPSG:3067+5773"; empty where the system has no code.
  [[nodiscard]] std::string code() const;
  [[nodiscard]] std::string name() const;  // "ETRS89 / TM35FIN(E,N)"
  // WKT 1 as LAS 1.4 wants it; WKT 2 where WKT 1 has no words for it.
  [[nodiscard]] std::string wkt() const;
  // Name of the vertical part, "EGM96 height"; empty where heights are those of the ellipsoid.
  [[nodiscard]] std::string vertical_name() const;
  // Whether PROJ has the grid that the vertical part needs. Without it PROJ passes heights through
  // and says nothing.
  [[nodiscard]] bool follows_heights(const GeodeticPlace& place) const;
  // From here on only the part in the plane.
  void drop_vertical();
  // False where the place is outside of the area that the system is made for; true where PROJ does
  // not know the area.
  [[nodiscard]] bool is_made_for(const GeodeticPlace& place) const;

 private:
  struct Impl;
  explicit CoordinateSystem(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Metres per unit of a projected system in the plane ("EPSG:2276" or WKT): 0.3048006 for US survey
// feet. 0 for one in degrees, NaN where nothing is known (an empty or strange definition).
[[nodiscard]] double metres_per_unit(const std::string& definition);

// Throws InputError where the system of a file says that its coordinates are not in metres.
void require_metres(const std::string& definition, const std::string& file);

// "EPSG:32635": the UTM zone of a place, WGS 84.
[[nodiscard]] std::string utm_zone(const GeodeticPlace& place);

}  // namespace understory
