#include "understory/pipeline/inventory/stand_cloud.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "understory/forest/cloud_shape.h"
#include "understory/geometry/rotation_between.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::stand_cloud;

// Three numbers; nothing if it is none of a direction.
std::optional<Eigen::Vector3d> direction_of(const std::string& text) {
  std::istringstream stream(text);
  Eigen::Vector3d direction;
  char comma = ',';
  for (int i = 0; i < 3; ++i) {
    if ((i > 0 && (!(stream >> comma) || comma != ',')) || !(stream >> direction[i]))
      return std::nullopt;
  }
  const bool whole = stream.peek() == std::istringstream::traits_type::eof();
  if (!whole || !direction.allFinite() || direction.norm() < 1e-6) return std::nullopt;
  return direction.normalized();
}

// The rotation that makes this direction of the cloud's frame z; nothing if it names none.
std::optional<Eigen::Matrix3d> upright_from(const std::string& up) {
  for (const UpAxis axis : kUpAxes) {
    if (to_string(axis) == up) return upright_from_cloud(axis);
  }
  const auto direction = direction_of(up);
  if (!direction) return std::nullopt;
  return rotation_between(*direction, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

std::string text_of(const Eigen::Vector3d& direction) {
  return fmt::format("{:.3f},{:.3f},{:.3f}", direction.x(), direction.y(), direction.z());
}

// As the user gives unit and direction; nothing: as it is.
std::optional<CloudMove> upright_move(const CloudFrame& frame) {
  const double unit = frame.unit_m > 0.0 ? frame.unit_m : 1.0;
  const Eigen::Matrix3d turn =
      frame.up.empty() ? Eigen::Matrix3d::Identity() : upright_from(frame.up).value();
  if (unit == 1.0 && turn.isIdentity()) return std::nullopt;
  const Eigen::Matrix3d change = unit * turn;
  return CloudMove{
      [change](const Eigen::Vector3d& origin) -> Eigen::Vector3d { return change * origin; },
      [change](const Eigen::Vector3d&, const Eigen::Vector3f& point) -> Eigen::Vector3f {
        return (change * point.cast<double>()).cast<float>();
      }};
}

// From the frame of the layers of a run to the places that its map has in the world frame; none for
// another cloud.
PlaceChange into_world(const LayerFrame* layers) {
  if (layers == nullptr) return {};
  return [layers](const Eigen::Vector3d& place) { return on_map_grid(layers->to_world(place)); };
}

void move_cloud(const CloudMove& move, PointCloudFile& cloud) {
  for (Eigen::Vector3f& point : cloud.points)
    point = move.point(cloud.origin, point);
  cloud.origin = move.origin(cloud.origin);
}

void drop_system(const std::string& name, PointCloudFile& cloud, Log& log) {
  if (cloud.coordinate_system.empty()) return;
  log.warn("inventory.frame", name +
                                  ": its coordinate system does not hold for coordinates that "
                                  "were turned or scaled; the results have none");
  cloud.coordinate_system.clear();
}

// What the file itself says of its unit.
std::string system_complaint(const std::string& system) {
  const double unit = metres_per_unit(system);
  if (unit == 0.0)
    return "its coordinate system is in degrees: project it first, for instance to UTM";
  const auto known = CoordinateSystem::find(system);
  if (known && !known->vertical_name().empty() &&
      std::abs(known->height_unit_m() - unit) > kSameUnit * unit)
    return fmt::format(
        "its coordinate system counts in units of {:.7g} m in the plane and of {:.7g} m in height: "
        "bring both to metres first",
        unit, known->height_unit_m());
  if (std::abs(unit - 1.0) < 1e-9 || !std::isfinite(unit)) return {};
  return fmt::format("its coordinate system counts in units of {:.7g} m ({}): give --unit-m {:.7g}",
                     unit, std::abs(unit - 0.3048) < 1e-5 ? "feet" : "not metres", unit);
}

// How to turn the cloud upright, as far as it is known.
std::string up_advice(const CloudShape& shape) {
  if (const auto axis = other_up_axis(shape)) return "give --up " + to_string(*axis);
  if (const auto axis = leaning_axis(shape)) return "give --up=" + text_of(*axis);
  return "level the cloud first";
}

std::string doubt_of(const CloudShape& shape, const std::string& system, const CloudFrame& frame) {
  if (frame.unit_m == 0.0) {
    if (std::string complaint = system_complaint(system); !complaint.empty()) return complaint;
  }
  const std::string standing = frame.up.empty() ? up_complaint(shape) : "";
  if (!standing.empty())
    return standing + "; " + up_advice(shape) + " (--up z if it is right as it is)";
  const std::string unit = frame.unit_m == 0.0 ? unit_complaint(shape) : "";
  if (unit.empty()) return {};
  return unit +
         "; give --unit-m with the metres per unit (0.001 for millimetres, 0.01 for "
         "centimetres, 1 if it is right as it is)";
}

std::string suspicion_of(const CloudShape& shape, const std::string& system,
                         const CloudFrame& frame) {
  if (frame.unit_m > 0.0 || std::isfinite(metres_per_unit(system))) return {};
  const std::string feet = feet_suspicion(shape);
  return feet.empty() ? "" : feet + "; give --unit-m 0.3048 for feet, 1 if it is in metres";
}

}  // namespace

bool is_direction(const std::string& up) {
  return upright_from(up).has_value();
}

PointBlocks blocks_of(const PointCloudFile& cloud) {
  return [&cloud](const PointVisitor& visit) {
    constexpr std::size_t kBlock = 65'536;
    std::vector<Eigen::Vector3d> block;
    block.reserve(kBlock);
    for (const Eigen::Vector3f& point : cloud.points) {
      block.push_back(cloud.origin + point.cast<double>());
      if (block.size() == kBlock) {
        visit(block);
        block.clear();
      }
    }
    if (!block.empty()) visit(block);
  };
}

namespace {

// Coordinates of a system do not fit into single precision.
void refuse_rounded(const PointCloudFile& cloud, const std::string& name, const CloudFrame& frame) {
  const double step_m = cloud.step * (frame.unit_m > 0.0 ? frame.unit_m : 1.0);
  if (step_m <= kCoarsestStepM) return;
  throw InputError(
      name, "",
      fmt::format("expected coordinates to a centimetre: the file holds them in single "
                  "precision, so places are rounded to {:.2f} m. Export the cloud as "
                  "LAS or LAZ, or with a local origin",
                  step_m));
}

// Warns of places that are rounded, and keeps the words. A cloud from the air may do with such
// steps: its trees are found by their crowns.
void warn_of_steps(const std::string& name, const CloudFrame& frame, Log& log, StandCloud& stand) {
  const double step_m = stand.cloud.las_step * (frame.unit_m > 0.0 ? frame.unit_m : 1.0);
  if (step_m <= kRounding * kCoarsestStepM) return;
  stand.coarse = fmt::format(
      "places come in steps of {:.3g} m, so diameters are not to be trusted. Export the cloud with "
      "a scale factor of 0.001",
      step_m);
  log.warn("inventory.coarse_places", name + ": " + stand.coarse);
}

void warn_of_lost(const PointCloudFile& cloud, std::uint64_t kept, const std::string& name,
                  Log& log) {
  if (cloud.not_finite == 0) return;
  log.warn("inventory.not_numbers",
           fmt::format("{}: {} of {} points have no usable coordinates; left out", name,
                       cloud.not_finite, cloud.not_finite + kept));
}

// Reads the cloud in one piece or into tiles, moved. `layers`: of a run, null for another cloud.
StandCloud moved_stand(const std::string& name, const CloudFrame& frame, const LayerFrame* layers,
                       Log& log, const ProgressSink& progress, const CloudTiling* tiling) {
  const PlaceChange change = into_world(layers);
  std::vector<CloudMove> moves;
  if (auto move = upright_move(frame)) moves.push_back(*std::move(move));
  StandCloud stand;
  if (tiling != nullptr) stand.streamed = stream_cloud(name, *tiling, change, moves, log, progress);
  if (stand.streamed) {
    stand.cloud = stand.streamed->about;
    refuse_rounded(stand.cloud, name, frame);
    warn_of_steps(name, frame, log, stand);
    warn_of_lost(stand.cloud, stand.streamed->tiles->points(), name, log);
    return stand;
  }
  stand.cloud = read_cloud(name, log, progress, change);
  refuse_rounded(stand.cloud, name, frame);
  warn_of_steps(name, frame, log, stand);
  warn_of_lost(stand.cloud, stand.cloud.points.size(), name, log);
  for (const CloudMove& move : moves)
    move_cloud(move, stand.cloud);
  return stand;
}

CloudShape shape_of_stand(const StandCloud& stand, const ProgressSink& progress) {
  if (stand.streamed) return shape_of_sample(stand.streamed->sample, stand.streamed->sample_step);
  const PointBlocks blocks = blocks_of(stand.cloud);
  return shape_of(polled(blocks, progress));
}

StandCloud checked_stand(const std::string& name, const CloudFrame& frame, const LayerFrame* layers,
                         Log& log, const ProgressSink& progress, const CloudTiling* tiling) {
  StandCloud stand = moved_stand(name, frame, layers, log, progress, tiling);
  std::string& own = stand.cloud.coordinate_system;
  if (layers != nullptr && !layers->is_world()) own.clear();
  const std::string system = own.empty() ? frame.coordinate_system : own;
  if (upright_move(frame)) drop_system(name, stand.cloud, log);
  if (frame.unit_m > 0.0 && !frame.up.empty()) return stand;
  const CloudShape shape = shape_of_stand(stand, progress);
  stand.doubt = doubt_of(shape, system, frame);
  stand.suspicion = suspicion_of(shape, system, frame);
  if (stand.streamed) stand.streamed->sample = {};
  return stand;
}

}  // namespace

StandCloud read_stand(const std::filesystem::path& path, const CloudFrame& frame, Log& log,
                      const ProgressSink& progress, const CloudTiling* tiling) {
  return checked_stand(path.string(), frame, nullptr, log, progress, tiling);
}

StandCloud read_run_map(const std::filesystem::path& path, const LayerFrame& layers,
                        const CloudFrame& frame, Log& log, const ProgressSink& progress,
                        const CloudTiling* tiling) {
  return checked_stand(path.string(), frame, &layers, log, progress, tiling);
}

}  // namespace understory
