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

Eigen::Vector3d up_of_axes(const StemView& view) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double axes = 0.0;
  for (const Stem& stem : view.stems) {
    const Eigen::Vector3d axis = stem.axis.cast<double>();
    if (!axis.allFinite()) continue;
    sum += axis;
    axes += 1.0;
  }
  return sum.norm() > kOneSided * axes ? Eigen::Vector3d(sum.normalized())
                                       : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
}

StemUp stem_up(const StemView& view, const Eigen::Vector3d& about_up) {
  std::vector<Eigen::Vector3d> axes;
  for (const Stem& stem : view.stems) {
    Eigen::Vector3d axis = stem.axis.cast<double>();
    if (!axis.allFinite()) continue;
    axes.push_back(axis.dot(about_up) < 0.0 ? Eigen::Vector3d(-axis) : axis);
  }
  StemUp result;
  result.up_in_body = about_up;
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
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  if (up.up_in_body.z() > kFarOver) return rotation_between(up.up_in_body, z);
  const Eigen::Quaterniond over(0.0, 1.0, 0.0, 0.0);  // half a turn about x
  return rotation_between(over * up.up_in_body, z) * over;
}

Eigen::Index upright_axis(const Eigen::Vector3d& up_in_body) {
  Eigen::Index axis = 2;
  up_in_body.cwiseAbs().maxCoeff(&axis);
  return axis;
}

double plane_range_m(const Stem& stem, const Eigen::Vector3d& up_in_body) {
  const Eigen::Index upright = upright_axis(up_in_body);
  return static_cast<double>(
      Eigen::Vector2f(stem.point[upright == 0 ? 1 : 0], stem.point[upright == 2 ? 1 : 2]).norm());
}

std::vector<double> height_sds(const StemView& view, const Eigen::Vector3d& up_in_body) {
  const Eigen::Index upright = upright_axis(up_in_body);
  std::vector<double> sds;
  sds.reserve(view.stems.size());
  for (const Stem& stem : view.stems) {
    const float variance = upright == 0 ? stem.xx : upright == 1 ? stem.yy : stem.zz;
    if (!(variance > 0.0F)) return {};
    sds.push_back(std::sqrt(static_cast<double>(variance)));
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
