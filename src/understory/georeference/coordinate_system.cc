#include "understory/georeference/coordinate_system.h"

#include <cpl_error.h>
#include <fmt/format.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>

#include "understory/util/error.h"

namespace understory {

struct CoordinateSystem::Impl {
  OGRSpatialReference system;
  std::unique_ptr<OGRCoordinateTransformation> from_wgs84;
  std::unique_ptr<OGRCoordinateTransformation> to_wgs84;
};

CoordinateSystem::CoordinateSystem(const std::string& definition)
    : impl_(std::make_unique<Impl>()) {
  CPLPushErrorHandler(CPLQuietErrorHandler);
  OGRSpatialReference wgs84;
  wgs84.SetWellKnownGeogCS("WGS84");
  wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  impl_->system.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const bool known = impl_->system.SetFromUserInput(definition.c_str()) == OGRERR_NONE &&
                     (impl_->system.IsProjected() != 0 || impl_->system.IsGeographic() != 0);
  if (known) impl_->from_wgs84.reset(OGRCreateCoordinateTransformation(&wgs84, &impl_->system));
  if (known) impl_->to_wgs84.reset(OGRCreateCoordinateTransformation(&impl_->system, &wgs84));
  CPLPopErrorHandler();
  if (impl_->from_wgs84 == nullptr || impl_->to_wgs84 == nullptr)
    throw ConfigError({"'" + definition.substr(0, 60) +
                       "' is no coordinate system on the earth: expected one like EPSG:3067"});
}

CoordinateSystem::~CoordinateSystem() = default;

std::optional<Eigen::Vector3d> CoordinateSystem::from_place(const GeodeticPlace& place) const {
  double x = place.longitude_deg;
  double y = place.latitude_deg;
  double z = place.height_m;
  CPLPushErrorHandler(CPLQuietErrorHandler);
  const bool done = impl_->from_wgs84->Transform(1, &x, &y, &z) != 0;
  CPLPopErrorHandler();
  if (!done || !std::isfinite(x) || !std::isfinite(y)) return std::nullopt;
  return Eigen::Vector3d(x, y, z);
}

std::optional<GeodeticPlace> CoordinateSystem::to_place(const Eigen::Vector3d& point) const {
  double x = point.x();
  double y = point.y();
  double z = point.z();
  CPLPushErrorHandler(CPLQuietErrorHandler);
  const bool done = impl_->to_wgs84->Transform(1, &x, &y, &z) != 0;
  CPLPopErrorHandler();
  if (!done || !std::isfinite(x) || !std::isfinite(y) || std::abs(y) > 90.0) return std::nullopt;
  return GeodeticPlace{y, x, z};
}

bool CoordinateSystem::is_geographic() const {
  return impl_->system.IsGeographic() != 0;
}

double metres_per_unit(const std::string& definition) {
  if (definition.empty()) return std::nan("");
  OGRSpatialReference system;
  CPLPushErrorHandler(CPLQuietErrorHandler);
  const bool known = system.SetFromUserInput(definition.c_str()) == OGRERR_NONE;
  CPLPopErrorHandler();
  if (!known) return std::nan("");
  return system.IsGeographic() != 0 ? 0.0 : system.GetLinearUnits();
}

std::string utm_zone(const GeodeticPlace& place) {
  const int zone =
      std::clamp(static_cast<int>(std::floor((place.longitude_deg + 180.0) / 6.0)) + 1, 1, 60);
  return fmt::format("EPSG:{}", (place.latitude_deg < 0.0 ? 32700 : 32600) + zone);
}

}  // namespace understory
