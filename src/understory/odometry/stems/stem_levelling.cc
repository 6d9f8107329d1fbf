#include "understory/odometry/stems/stem_levelling.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/rotation_between.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::stem_levelling;

constexpr int kIterations = 20;

}  // namespace

StemUp stem_up(const StemView& view) {
  std::vector<Eigen::Vector3d> axes;
  for (const Stem& stem : view.stems) {
    Eigen::Vector3d axis = stem.axis.cast<double>();
    if (!axis.allFinite()) continue;
    axes.push_back(axis.z() < 0.0 ? Eigen::Vector3d(-axis) : axis);
  }
  StemUp result;
  if (axes.size() < 3) return result;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& axis : axes)
    up += axis;
  up.normalize();
  // Student's t with 3 degrees of freedom; the spread is found along.
  double variance = 0.01;
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double squares = 0.0;
    for (Eigen::Vector3d axis : axes) {
      if (axis.dot(up) < 0.0) axis = -axis;
      const double lean = std::atan2(axis.cross(up).norm(), axis.dot(up));
      const double weight = (kFreedom + 2.0) / (kFreedom + lean * lean / variance);
      sum += weight * axis;
      squares += weight * lean * lean;
    }
    up = sum.normalized();
    variance = std::max(squares / (2.0 * static_cast<double>(axes.size())), 1e-8);
  }
  result.up_in_body = up;
  result.spread_rad = std::sqrt(variance);
  result.stems = static_cast<int>(axes.size());
  return result;
}

Eigen::Quaterniond level_from_body(const StemUp& up) {
  return rotation_between(up.up_in_body, Eigen::Vector3d::UnitZ());
}

std::vector<double> height_sds(const StemView& view) {
  std::vector<double> sds;
  sds.reserve(view.stems.size());
  for (const Stem& stem : view.stems) {
    if (!(stem.zz > 0.0F)) return {};
    sds.push_back(std::sqrt(static_cast<double>(stem.zz)));
  }
  return sds;
}

SparsePoints stem_points(const StemView& view, const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d matrix = rotation.toRotationMatrix();
  SparsePoints points;
  points.reserve(view.stems.size());
  for (const Stem& stem : view.stems)
    points.emplace_back(matrix * stem.point.cast<double>());
  return points;
}

}  // namespace understory
