#include "understory/georeference/systems/layer_frame.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <unordered_map>

#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace georeference_constants::layer_frame;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kMetresPerDegree = 6378137.0 * std::numbers::pi / 180.0;

// Corners of a cell of the grid in the layer's frame; bit 0 is x, bit 1 y, bit 2 z.
using Corners = std::array<Vector3d, 8>;

struct CellIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  bool operator==(const CellIndex&) const = default;
};
struct CellHash {
  std::size_t operator()(const CellIndex& cell) const {
    const auto mixed = [](std::int32_t value, std::uint64_t factor) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(value)) * factor;
    };
    return mixed(cell.x, 0x9E3779B97F4A7C15U) ^ mixed(cell.y, 0xC2B2AE3D27D4EB4FU) ^
           mixed(cell.z, 0x165667B19E3779F9U);
  }
};

double direction_deg(const Vector3d& step) {
  return std::atan2(step.x(), step.y()) * 180.0 / std::numbers::pi;
}

}  // namespace

struct LayerFrame::Impl {
  Pose enu_from_world;  // or layer_from_world, in a local frame
  bool world = true;    // that pose is the identity, and there is no system
  std::optional<EastNorthUp> enu;
  std::optional<CoordinateSystem> system;
  std::string wkt;
  std::string code;
  std::string heights = "in the local frame";
  bool lacks_geoid = false;
  Vector3d origin_in_world = Vector3d::Zero();
  Vector3d origin_in_layer = Vector3d::Zero();
  Matrix3d world_from_layer = Matrix3d::Identity();  // near the origin
  mutable std::unordered_map<CellIndex, Corners, CellHash> cells;
  mutable CellIndex last;
  mutable const Corners* corners = nullptr;

  [[nodiscard]] Vector3d exact(const Vector3d& point) const {
    const auto at = system->from_place(enu->to_place(enu_from_world * point));
    if (!at)
      throw ConfigError({"coordinate system " + code + " does not reach the place of the run"});
    return *at;
  }
  [[nodiscard]] const Corners& corners_of(const CellIndex& cell) const {
    if (corners != nullptr && cell == last) return *corners;
    const auto [found, made] = cells.try_emplace(cell);
    if (made) {
      for (int corner = 0; corner < 8; ++corner)
        found->second[static_cast<std::size_t>(corner)] =
            exact(kGridM * Vector3d(cell.x + (corner & 1), cell.y + (corner >> 1 & 1),
                                    cell.z + (corner >> 2)));
    }
    last = cell;
    corners = &found->second;
    return *corners;
  }
  void look_around();
};

// The system near its origin: as good as the whole to begin the way back with.
void LayerFrame::Impl::look_around() {
  constexpr double kStepM = 10.0;
  origin_in_world = enu_from_world.inverse() * Vector3d::Zero();
  origin_in_layer = exact(origin_in_world);
  Matrix3d layer_from_here;
  for (int axis = 0; axis < 3; ++axis)
    layer_from_here.col(axis) =
        (exact(origin_in_world + kStepM * Vector3d::Unit(axis)) - origin_in_layer) / kStepM;
  world_from_layer = layer_from_here.inverse();
}

LayerFrame::LayerFrame() : impl_(std::make_unique<Impl>()) {}

LayerFrame::LayerFrame(const Pose& layer_from_world) : LayerFrame() {
  impl_->enu_from_world = layer_from_world;
  impl_->world =
      layer_from_world.translation().isZero(0.0) && layer_from_world.rotation().vec().isZero(0.0);
}

LayerFrame::LayerFrame(const Pose& enu_from_world, const GeodeticPlace& origin,
                       const std::string& definition)
    : LayerFrame() {
  Impl& self = *impl_;
  self.enu_from_world = enu_from_world;
  self.world = false;
  self.enu.emplace(origin);
  self.system.emplace(definition);
  self.code = definition;
  if (!self.system->vertical_name().empty() && !self.system->follows_heights(origin)) {
    self.lacks_geoid = true;
    self.system->drop_vertical();
  }
  const std::string code = self.system->code();
  self.code = code.empty() ? self.system->name() : code;
  self.wkt = self.system->wkt();
  const std::string vertical = self.system->vertical_name();
  self.heights = vertical.empty() ? "above the ellipsoid" : "above the geoid (" + vertical + ")";
  self.look_around();
}

LayerFrame::~LayerFrame() = default;
LayerFrame::LayerFrame(LayerFrame&&) noexcept = default;
LayerFrame& LayerFrame::operator=(LayerFrame&&) noexcept = default;

bool LayerFrame::is_world() const {
  return impl_->world;
}
const CoordinateSystem* LayerFrame::system() const {
  return impl_->system ? &*impl_->system : nullptr;
}
const std::string& LayerFrame::wkt() const {
  return impl_->wkt;
}
const std::string& LayerFrame::code() const {
  return impl_->code;
}
const std::string& LayerFrame::heights() const {
  return impl_->heights;
}
void LayerFrame::name_heights(const std::string& heights) {
  impl_->heights = heights;
}
bool LayerFrame::lacks_geoid() const {
  return impl_->lacks_geoid;
}

Vector3d LayerFrame::exact_from_world(const Vector3d& point_in_world) const {
  if (impl_->world) return point_in_world;
  return impl_->system ? impl_->exact(point_in_world) : impl_->enu_from_world * point_in_world;
}

Vector3d LayerFrame::from_world(const Vector3d& point_in_world) const {
  const Vector3d in_cells = point_in_world / kGridM;
  if (!impl_->system || !(in_cells.cwiseAbs().maxCoeff() < kMostCells))
    return exact_from_world(point_in_world);
  const Vector3d low = in_cells.array().floor();
  const Corners& c =
      impl_->corners_of({static_cast<std::int32_t>(low.x()), static_cast<std::int32_t>(low.y()),
                         static_cast<std::int32_t>(low.z())});
  const Vector3d u = in_cells - low;
  const auto between = [](const Vector3d& a, const Vector3d& b, double share) -> Vector3d {
    return a + share * (b - a);
  };
  const Vector3d south = between(between(c[0], c[1], u.x()), between(c[4], c[5], u.x()), u.z());
  const Vector3d north = between(between(c[2], c[3], u.x()), between(c[6], c[7], u.x()), u.z());
  return between(south, north, u.y());
}

Vector3d LayerFrame::to_world(const Vector3d& point_in_layer) const {
  if (impl_->world) return point_in_layer;
  if (!impl_->system) return impl_->enu_from_world.inverse() * point_in_layer;
  constexpr int kMostSteps = 20;  // each gains three digits or more within 100 km
  constexpr double kNearM = 1e-5;
  Vector3d point =
      impl_->origin_in_world + impl_->world_from_layer * (point_in_layer - impl_->origin_in_layer);
  for (int i = 0; i < kMostSteps; ++i) {
    const Vector3d step = impl_->world_from_layer * (point_in_layer - from_world(point));
    point += step;
    if (!(step.norm() > kNearM)) break;
  }
  return point;
}

double LayerFrame::units_per_metre() const {
  if (!impl_->system) return 1.0;
  const double unit = impl_->system->plane_unit_m();
  return unit > 0.0 ? 1.0 / unit : 1.0 / kMetresPerDegree;
}

Vector3d LayerFrame::resolution() const {
  constexpr double kMillimetre = 0.001;
  if (!impl_->system || !impl_->system->is_geographic()) return Vector3d::Constant(kMillimetre);
  constexpr double kDegrees = 1e-8;  // 1.1 mm of a meridian
  return {kDegrees, kDegrees, kMillimetre};
}

Vector3d LayerFrame::offset() const {
  if (!impl_->system) {
    constexpr double kLargeM = 1e5;
    const Vector3d& shift = impl_->enu_from_world.translation();
    if (!(shift.head<2>().norm() > kLargeM)) return Vector3d::Zero();
    return (shift / 1000.0).array().round() * 1000.0;
  }
  const double round = impl_->system->is_geographic() ? 1.0 : 1000.0;
  return {std::round(impl_->origin_in_layer.x() / round) * round,
          std::round(impl_->origin_in_layer.y() / round) * round, 0.0};
}

double LayerFrame::north_deg() const {
  if (!impl_->system || impl_->system->is_geographic()) return 0.0;
  const Pose world_from_enu = impl_->enu_from_world.inverse();
  return direction_deg(impl_->exact(world_from_enu * Vector3d(0.0, 100.0, 0.0)) -
                       impl_->origin_in_layer);
}

double LayerFrame::scale() const {
  if (!impl_->system || impl_->system->is_geographic()) return 1.0;
  const Pose world_from_enu = impl_->enu_from_world.inverse();
  constexpr double kStepM = 100.0;
  const Vector3d step =
      impl_->exact(world_from_enu * Vector3d(0.0, kStepM, 0.0)) - impl_->origin_in_layer;
  return step.head<2>().norm() * impl_->system->plane_unit_m() / kStepM;
}

}  // namespace understory
