#include "understory/georeference/systems/coordinate_system.h"

#include <cpl_error.h>
#include <fmt/format.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/util/error.h"

namespace understory {

namespace {

// Of an authority's part of a system: "3067"; empty where it has no code.
std::string code_of(const OGRSpatialReference& system, const char* part) {
  const char* code = system.GetAuthorityCode(part);
  const char* authority = system.GetAuthorityName(part);
  return code == nullptr || authority == nullptr ? "" : std::string(authority) + ":" + code;
}

}  // namespace

struct CoordinateSystem::Impl {
  OGRSpatialReference system;
  std::unique_ptr<OGRCoordinateTransformation> from_wgs84;
  std::unique_ptr<OGRCoordinateTransformation> to_wgs84;

  // From longitude, latitude and height above the ellipsoid; false where PROJ knows no way.
  bool connect() {
    OGRSpatialReference wgs84;
    wgs84.importFromEPSG(4979);
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    from_wgs84.reset(OGRCreateCoordinateTransformation(&wgs84, &system));
    to_wgs84.reset(OGRCreateCoordinateTransformation(&system, &wgs84));
    return from_wgs84 != nullptr && to_wgs84 != nullptr;
  }
  bool open(const std::string& definition) {
    CPLPushErrorHandler(CPLQuietErrorHandler);
    system.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const bool known = system.SetFromUserInput(definition.c_str()) == OGRERR_NONE &&
                       (system.IsProjected() != 0 || system.IsGeographic() != 0) && connect();
    CPLPopErrorHandler();
    return known;
  }
};

CoordinateSystem::CoordinateSystem(const std::string& definition)
    : impl_(std::make_unique<Impl>()) {
  if (!impl_->open(definition))
    throw ConfigError({"'" + definition.substr(0, 60) +
                       "' is no coordinate system on the earth: expected one like EPSG:3067"});
}

CoordinateSystem::CoordinateSystem(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

std::optional<CoordinateSystem> CoordinateSystem::find(const std::string& definition) {
  auto impl = std::make_unique<Impl>();
  if (!impl->open(definition)) return std::nullopt;
  return CoordinateSystem(std::move(impl));
}

CoordinateSystem::~CoordinateSystem() = default;
CoordinateSystem::CoordinateSystem(CoordinateSystem&&) noexcept = default;
CoordinateSystem& CoordinateSystem::operator=(CoordinateSystem&&) noexcept = default;

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

double CoordinateSystem::plane_unit_m() const {
  return is_geographic() ? 0.0 : impl_->system.GetTargetLinearUnits("PROJCS");
}

double CoordinateSystem::height_unit_m() const {
  return vertical_name().empty() ? 1.0 : impl_->system.GetTargetLinearUnits("VERT_CS");
}

std::string CoordinateSystem::code() const {
  const OGRSpatialReference& system = impl_->system;
  if (std::string whole = code_of(system, nullptr); !whole.empty()) return whole;
  if (system.IsCompound() == 0) return "";
  const std::string plane = code_of(system, is_geographic() ? "GEOGCS" : "PROJCS");
  const std::string heights = code_of(system, "VERT_CS");
  if (plane.empty() || heights.empty()) return "";
  return plane + "+" + heights.substr(heights.find(':') + 1);
}

std::string CoordinateSystem::name() const {
  const char* name = impl_->system.GetName();
  return name == nullptr ? "" : name;
}

std::string CoordinateSystem::wkt() const {
  char* text = nullptr;
  CPLPushErrorHandler(CPLQuietErrorHandler);
  if (impl_->system.exportToWkt(&text) != OGRERR_NONE || text == nullptr || *text == '\0') {
    CPLFree(text);
    text = nullptr;
    const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
    impl_->system.exportToWkt(&text, options);
  }
  CPLPopErrorHandler();
  std::string wkt = text == nullptr ? "" : text;
  CPLFree(text);
  return wkt;
}

std::string CoordinateSystem::vertical_name() const {
  if (impl_->system.IsVertical() == 0) return "";
  const char* name = impl_->system.GetAttrValue("VERT_CS");
  return name == nullptr ? "vertical system" : name;
}

bool CoordinateSystem::follows_heights(const GeodeticPlace& place) const {
  if (vertical_name().empty()) return false;
  // No geoid lies within a micrometre of the ellipsoid but on single lines.
  constexpr double kSameM = 1e-6;
  const auto at = from_place(place);
  return at && std::abs(at->z() * height_unit_m() - place.height_m) > kSameM;
}

void CoordinateSystem::drop_vertical() {
  impl_->system.StripVertical();
  impl_->connect();
}

bool CoordinateSystem::is_made_for(const GeodeticPlace& place) const {
  OGRSpatialReference plane(impl_->system);
  if (plane.IsCompound() != 0) plane.StripVertical();
  double west = 0.0;
  double south = 0.0;
  double east = 0.0;
  double north = 0.0;
  if (!plane.GetAreaOfUse(&west, &south, &east, &north, nullptr) || west < -180.0) return true;
  const bool across = west > east;  // the date line
  const bool inside_x = across ? place.longitude_deg >= west || place.longitude_deg <= east
                               : place.longitude_deg >= west && place.longitude_deg <= east;
  return inside_x && place.latitude_deg >= south && place.latitude_deg <= north;
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

void require_metres(const std::string& definition, const std::string& file) {
  const double unit_m = metres_per_unit(definition);
  if (!std::isfinite(unit_m) || std::abs(unit_m - 1.0) < 1e-9) return;
  throw InputError(file, "",
                   fmt::format("expected metres: its coordinate system {}. Project it first, for "
                               "instance to UTM",
                               unit_m == 0.0 ? std::string("is in degrees")
                                             : fmt::format("counts in units of {:.7g} m", unit_m)));
}

std::string utm_zone(const GeodeticPlace& place) {
  const int zone =
      std::clamp(static_cast<int>(std::floor((place.longitude_deg + 180.0) / 6.0)) + 1, 1, 60);
  return fmt::format("EPSG:{}", (place.latitude_deg < 0.0 ? 32700 : 32600) + zone);
}

}  // namespace understory
