#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "understory/geometry/pose.h"
#include "understory/georeference/systems/geodetic.h"

namespace understory {

class CoordinateSystem;

// The frame that the layers of a run are written in: map.laz, rasters, trees.gpkg. It is a
// coordinate system where the place on the globe is known, else a local frame in metres. A rigid
// motion leads from the world frame to east, north, up at a place. From there it goes to latitude
// and longitude, and by PROJ into the system. Points between the nodes of a grid are interpolated,
// within 0.1 mm of PROJ up to latitudes of 75 degrees (layer_frame_test.cc). Not thread-safe.
class LayerFrame {
 public:
  // The world frame itself.
  LayerFrame();
  // A local frame, metres.
  explicit LayerFrame(const Pose& layer_from_world);
  // A coordinate system, "EPSG:3067" or WKT. Heights are those of its vertical part where PROJ has
  // the grid for it; else the part is dropped, and heights are above the ellipsoid. Throws
  // ConfigError if it is no system or does not reach the origin.
  LayerFrame(const Pose& enu_from_world, const GeodeticPlace& origin,
             const std::string& definition);
  ~LayerFrame();
  LayerFrame(LayerFrame&&) noexcept;
  LayerFrame& operator=(LayerFrame&&) noexcept;

  // Whether the layers are in the world frame.
  [[nodiscard]] bool is_world() const;
  // Null in a local frame.
  [[nodiscard]] const CoordinateSystem* system() const;
  // WKT of the system; empty in a local frame.
  [[nodiscard]] const std::string& wkt() const;
  // "EPSG:3067", or the name of a system without a code; empty in a local frame.
  [[nodiscard]] const std::string& code() const;
  // What heights are above, in words.
  [[nodiscard]] const std::string& heights() const;
  // Where the place has no height: what they are above is said by this.
  void name_heights(const std::string& heights);
  // Whether a vertical part was asked for whose grid PROJ does not have.
  [[nodiscard]] bool lacks_geoid() const;

  // A point of the world frame (metres) in this frame: x east, y north, z up in the units of the
  // system. Throws ConfigError where the system does not reach it.
  [[nodiscard]] Eigen::Vector3d from_world(const Eigen::Vector3d& point_in_world) const;
  // The same by PROJ for this very point.
  [[nodiscard]] Eigen::Vector3d exact_from_world(const Eigen::Vector3d& point_in_world) const;
  // Back, within 0.1 mm.
  [[nodiscard]] Eigen::Vector3d to_world(const Eigen::Vector3d& point_in_layer) const;

  // Units of the plane per metre: 1, feet, or degrees of a meridian.
  [[nodiscard]] double units_per_metre() const;
  // The smallest step that a cloud is stored with: a millimetre in the plane, whatever the unit.
  [[nodiscard]] Eigen::Vector3d resolution() const;
  // Round numbers near the origin, so that large coordinates lose no precision.
  [[nodiscard]] Eigen::Vector3d offset() const;
  // At the origin: true north clockwise from grid north, degrees, and metres of the grid per metre
  // of the ground. 0 and 1 in a local frame.
  [[nodiscard]] double north_deg() const;
  [[nodiscard]] double scale() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
