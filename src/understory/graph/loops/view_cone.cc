#include "understory/graph/loops/view_cone.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/graph/graph_constants.h"

namespace understory {
namespace {

using namespace graph_constants::view_cone;

double quantile(std::vector<double>& values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// The angle less full turns, from -pi to pi.
double within_a_turn(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * M_PI);
}

// The narrowest arc that holds kAngleShare of the directions.
struct Arc {
  double middle_rad = 0.0;
  double half_rad = M_PI;
};

Arc narrowest_arc(std::vector<double> angles) {
  std::sort(angles.begin(), angles.end());
  const std::size_t n = angles.size();
  const auto held = static_cast<std::size_t>(kAngleShare * static_cast<double>(n - 1));
  Arc best;
  for (std::size_t first = 0; first < n; ++first) {
    const std::size_t last = first + held;
    const double end = last < n ? angles[last] : angles[last - n] + 2.0 * M_PI;
    const double half = 0.5 * (end - angles[first]);
    if (half < best.half_rad) best = {within_a_turn(angles[first] + half), half};
  }
  return best;
}

double widened(double half_rad) {
  return std::min(M_PI, half_rad / kAngleShare);
}

}  // namespace

ViewCone estimate_view_cone(const std::vector<SparsePoints>& level_views) {
  std::vector<double> ranges;
  std::vector<double> angles;
  std::vector<double> off_axis;
  for (const SparsePoints& view : level_views) {
    for (const Eigen::Vector3d& point : view) {
      ranges.push_back(point.head<2>().norm());
      angles.push_back(std::atan2(point.y(), point.x()));
      off_axis.push_back(std::abs(angles.back()));
    }
  }
  if (ranges.empty()) return {};
  ViewCone cone;
  cone.range_m = quantile(ranges, kRangeShare);
  cone.half_angle_rad = widened(quantile(off_axis, kAngleShare));
  if (angles.size() < kFewestDirections) return cone;
  const Arc arc = narrowest_arc(std::move(angles));
  if (widened(arc.half_rad) < cone.half_angle_rad - kClearlyNarrowerRad) {
    cone.half_angle_rad = widened(arc.half_rad);
    cone.middle_rad = arc.middle_rad;
  }
  return cone;
}

ConeOverlap::ConeOverlap(const ViewCone& cone) : cone_(cone) {
  // Radii by equal areas, angles by the golden ratio: an even spread without a pattern.
  constexpr double kGolden = 0.6180339887498949;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(kSamples);
    const double turn = std::fmod(static_cast<double>(i) * kGolden, 1.0);
    const double angle = (2.0 * turn - 1.0) * cone.half_angle_rad;
    const double radius = cone.range_m * std::sqrt(share);
    samples_.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
}

bool ConeOverlap::holds(const Eigen::Vector3d& point_in_view) const {
  const Eigen::Vector2d p = point_in_view.head<2>();
  if (p.squaredNorm() > cone_.range_m * cone_.range_m) return false;
  const double off = within_a_turn(std::atan2(p.y(), p.x()) - cone_.middle_rad);
  return cone_.half_angle_rad >= M_PI || std::abs(off) <= cone_.half_angle_rad;
}

double ConeOverlap::operator()(const Pose& world_from_a, const Pose& world_from_b) const {
  const Eigen::Vector3d apart = world_from_b.translation() - world_from_a.translation();
  if (apart.head<2>().norm() >= 2.0 * cone_.range_m) return 0.0;
  const Pose b_from_a = world_from_b.inverse() * world_from_a;
  const Eigen::Vector3d x = b_from_a.rotation() * Eigen::Vector3d::UnitX();
  const Eigen::Rotation2Dd turn(std::atan2(x.y(), x.x()));
  // Both sectors lie alike in their views: all is turned so that their middle is the x axis.
  const Eigen::Vector2d shift =
      Eigen::Rotation2Dd(-cone_.middle_rad) * b_from_a.translation().head<2>();
  const double squared = cone_.range_m * cone_.range_m;
  // Beyond the edge of the sector means below the cosine of its half angle.
  const double least = std::cos(cone_.half_angle_rad);
  std::size_t inside = 0;
  for (const Eigen::Vector2d& sample : samples_) {
    const Eigen::Vector2d p = turn * sample + shift;
    const double reach = p.squaredNorm();
    if (reach > squared) continue;
    inside += cone_.half_angle_rad >= M_PI || p.x() >= least * std::sqrt(reach) ? 1 : 0;
  }
  return static_cast<double>(inside) / static_cast<double>(samples_.size());
}

}  // namespace understory
