#include "understory/pipeline/georeferencing/methods/placement_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/georeference/satellites/split_fit.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr const char* kTurns[] = {"sd_turn_east_deg", "sd_turn_north_deg", "sd_heading_deg"};
constexpr const char* kShifts[] = {"sd_east_m", "sd_north_m", "sd_up_m"};

double figure(const Placement& placement, const char* name) {
  return std::get<double>(placement.figures.at(name));
}

}  // namespace

void tell_placement(const Trajectory& trajectory, Placement& placement) {
  placement.figures["method"] = placement.method;
  const Pose& motion = placement.target_from_world;
  placement.figures["motion_x_m"] = motion.translation().x();
  placement.figures["motion_y_m"] = motion.translation().y();
  placement.figures["motion_z_m"] = motion.translation().z();
  const char* names[] = {"motion_qx", "motion_qy", "motion_qz", "motion_qw"};
  for (int k = 0; k < 4; ++k)
    placement.figures[names[k]] = motion.rotation().coeffs()(k);
  if (!placement.covariance.allFinite() || trajectory.empty()) return;
  std::vector<Vector3d> places;
  Vector3d middle = Vector3d::Zero();
  for (const StampedPose& pose : trajectory) {
    places.emplace_back(motion * pose.world_from_body.translation());
    middle += places.back() / static_cast<double>(trajectory.size());
  }
  const Matrix6d spread = spread_from_right(placement.covariance, motion, middle);
  for (int k = 0; k < 3; ++k) {
    placement.figures[kTurns[k]] = std::sqrt(std::max(0.0, spread(k, k))) * 180.0 / M_PI;
    placement.figures[kShifts[k]] = std::sqrt(std::max(0.0, spread(k + 3, k + 3)));
  }
  if (!std::isfinite(placement.expected_error_m))
    placement.expected_error_m = expected_error_m(spread, middle, places);
  placement.figures["expected_error_m"] = placement.expected_error_m;
}

std::string precision_of(const Placement& placement) {
  if (!placement.figures.contains("sd_east_m")) return "";
  const double tilt = std::max(figure(placement, kTurns[0]), figure(placement, kTurns[1]));
  return fmt::format(
      "{:.2f} m east, {:.2f} m north, {:.2f} m up, heading {:.2f} degrees, tilt {:.2f} degrees",
      figure(placement, kShifts[0]), figure(placement, kShifts[1]), figure(placement, kShifts[2]),
      figure(placement, kTurns[2]), tilt);
}

}  // namespace understory
