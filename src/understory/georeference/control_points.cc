#include "understory/georeference/control_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "understory/geometry/symmetric_solver.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::control_points;

using Eigen::Vector2d;
using Eigen::Vector3d;

bool has_height(const ControlPoint& point) {
  return std::isfinite(point.place_in_target.z());
}

Vector3d residual(const ControlPoint& point, const Pose& motion) {
  return point.place_in_target - motion * point.place_in_world;
}

// Length of a residual; in the plane where there is no height.
double length(const Vector3d& residual) {
  return std::isfinite(residual.z()) ? residual.norm() : residual.head<2>().norm();
}

// Turn about up and shift that lay the middle of two points and their direction on the others'.
std::optional<Pose> motion_of_pair(const ControlPoint& a, const ControlPoint& b) {
  const Vector2d source = (b.place_in_world - a.place_in_world).head<2>();
  const Vector2d target = (b.place_in_target - a.place_in_target).head<2>();
  if (source.norm() < kLeastApartM || target.norm() < kLeastApartM) return std::nullopt;
  const double yaw = std::atan2(target.y(), target.x()) - std::atan2(source.y(), source.x());
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw, Vector3d::UnitZ()));
  Vector3d shift = 0.5 * (a.place_in_target + b.place_in_target) -
                   turn * (0.5 * (a.place_in_world + b.place_in_world));
  if (!std::isfinite(shift.z())) {
    const ControlPoint& high = has_height(a) ? a : b;
    shift.z() = has_height(high) ? high.place_in_target.z() - high.place_in_world.z() : 0.0;
  }
  return Pose(turn, shift);
}

double median_residual_m(const std::vector<ControlPoint>& points, const Pose& motion) {
  std::vector<double> lengths;
  for (const ControlPoint& point : points)
    lengths.push_back(length(residual(point, motion)));
  return upper_median(lengths);
}

// The motion of the pair that most others agree with.
std::optional<Pose> best_pair(const std::vector<ControlPoint>& points) {
  std::optional<Pose> best;
  double least = std::numeric_limits<double>::infinity();
  double least_apart = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const auto motion = motion_of_pair(points[i], points[j]);
      if (!motion) continue;
      const double median = median_residual_m(points, *motion);
      // Of pairs that agree alike the one that is farther apart tells the heading better.
      const double apart = (points[i].place_in_world - points[j].place_in_world).norm();
      if (median < least || (median == least && apart > least_apart)) {
        best = motion;
        least = median;
        least_apart = apart;
      }
    }
  }
  return best;
}

struct ControlNormal {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double squares = 0.0;
  int coordinates = 0;
};

// Over a turn about the target's axes through `middle` and a shift.
ControlNormal normal_of(const std::vector<ControlPoint>& points, const std::vector<char>& used,
                        const Pose& motion, const Vector3d& middle) {
  ControlNormal normal;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!used[k]) continue;
    const Vector3d r = residual(points[k], motion);
    Eigen::Matrix<double, 3, 6> j;
    j << -skew(motion * points[k].place_in_world - middle), Eigen::Matrix3d::Identity();
    for (int axis = 0; axis < (has_height(points[k]) ? 3 : 2); ++axis) {
      normal.hessian += j.row(axis).transpose() * j.row(axis);
      normal.gradient += j.row(axis).transpose() * r(axis);
      normal.squares += r(axis) * r(axis);
      ++normal.coordinates;
    }
  }
  return normal;
}

Vector3d middle_of(const std::vector<ControlPoint>& points, const std::vector<char>& used,
                   const Pose& motion) {
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!used[k]) continue;
    sum += motion * points[k].place_in_world;
    count += 1.0;
  }
  return sum / count;
}

// Least squares over the used points, from `fit.target_from_world` on.
void refine(const std::vector<ControlPoint>& points, const ControlFitConfig& config,
            ControlFit& fit) {
  const double tilt_sd = std::max(1e-6, config.tilt_sd_deg * M_PI / 180.0);
  Vector3d tilt = Vector3d::Zero();  // found so far, about the target's axes
  fit.sd_m = config.sd_m;
  for (int step = 0; step < kSteps; ++step) {
    const Vector3d middle = middle_of(points, fit.used, fit.target_from_world);
    const ControlNormal normal = normal_of(points, fit.used, fit.target_from_world, middle);
    Matrix6d prior = Matrix6d::Zero();
    prior(0, 0) = prior(1, 1) = std::pow(fit.sd_m / tilt_sd, 2.0);
    Vector6d pull = Vector6d::Zero();
    pull.head<2>() = -prior(0, 0) * tilt.head<2>();
    const SymmetricSolver<6> solver(normal.hessian + prior);
    const Vector6d xi = solver.solve(normal.gradient + pull);
    const Pose to(Eigen::Quaterniond::Identity(), middle);
    fit.target_from_world =
        to * Pose(so3_exp(xi.head<3>()), xi.tail<3>()) * to.inverse() * fit.target_from_world;
    tilt += xi.head<3>();
    fit.redundant = normal.coordinates - 4;
    const ControlNormal after = normal_of(points, fit.used, fit.target_from_world, middle);
    // What is known before counts as much as some coordinates do.
    fit.sd_m = std::sqrt((kPriorCoordinates * config.sd_m * config.sd_m + after.squares) /
                         (kPriorCoordinates + std::max(0, fit.redundant)));
    fit.covariance =
        right_from_spread(fit.sd_m * fit.sd_m * solver.inverse(), fit.target_from_world, middle);
  }
}

}  // namespace

ControlFit fit_control_points(const std::vector<ControlPoint>& points,
                              const ControlFitConfig& config) {
  ControlFit fit;
  if (points.size() < 2) {
    fit.reason = "expected two control points at least";
    return fit;
  }
  if (std::none_of(points.begin(), points.end(), has_height)) {
    fit.reason = "expected a height of one control point at least";
    return fit;
  }
  const auto start = best_pair(points);
  if (!start) {
    fit.reason = "expected control points that are a metre apart at least";
    return fit;
  }
  const double limit_m =
      std::max(config.least_blunder_m, kBlunder * median_residual_m(points, *start));
  fit.target_from_world = *start;
  for (const ControlPoint& point : points)
    fit.used.push_back(points.size() < kFewestForBlunders ||
                       length(residual(point, *start)) <= limit_m);
  refine(points, config, fit);
  for (const ControlPoint& point : points)
    fit.residuals.push_back(residual(point, fit.target_from_world));
  if (points.size() < kFewestForBlunders)
    fit.disagree = std::any_of(fit.residuals.begin(), fit.residuals.end(), [&](const Vector3d& r) {
      return length(r) > config.least_blunder_m;
    });
  fit.found = true;
  return fit;
}

}  // namespace understory
