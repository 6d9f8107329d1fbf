#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>

#include "understory/geometry/raster.h"
#include "understory/georeference/systems/geodetic.h"

namespace understory {

// A rectangle of the plane, metres.
struct PlaneArea {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
};

// Reads heights from a terrain model: GeoTIFF, ESRI ASCII grid (.asc), XYZ on a regular grid, or
// whatever else GDAL knows as a raster. North-up, first band, metres. No-data cells are NaN.
//
// A model without a coordinate system is taken as it lies. One with a system is brought into the
// frame east, north, up at `origin` by the full transform. Without an origin it is taken as it lies
// too, in the system's own metres.
//
// Only the part over `area` is read. Throws InputError where the file is no raster of heights, is
// rotated, or does not reach the area. So it does where it is in degrees and there is no origin.
[[nodiscard]] Raster read_terrain(const std::filesystem::path& path, const PlaneArea& area,
                                  const std::optional<GeodeticPlace>& origin);

}  // namespace understory
