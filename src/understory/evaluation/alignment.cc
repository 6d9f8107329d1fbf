#include "understory/evaluation/alignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/geometry/best_rotation.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// Extents below this fraction of the largest are numerical noise, not geometry.
constexpr double kRankTolerance = 1e-9;
constexpr double kMostRotationSdDeg = 5.0;

struct Moments {
  Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // target rows, source columns, eq. 38
};

Moments moments(const std::vector<Eigen::Vector3d>& source,
                const std::vector<Eigen::Vector3d>& target) {
  UNDERSTORY_CHECK(!source.empty() && source.size() == target.size());
  const double n = static_cast<double>(source.size());
  Moments m;
  for (std::size_t i = 0; i < source.size(); ++i) {
    m.source_mean += source[i] / n;
    m.target_mean += target[i] / n;
  }
  for (std::size_t i = 0; i < source.size(); ++i) {
    m.covariance += (target[i] - m.target_mean) * (source[i] - m.source_mean).transpose() / n;
  }
  return m;
}

using Points = std::vector<Eigen::Vector3d>;

Points without(const Points& points, std::size_t from, std::size_t to) {
  Points rest(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(from));
  rest.insert(rest.end(), points.begin() + static_cast<std::ptrdiff_t>(to), points.end());
  return rest;
}

AlignmentResult fit_se3(const Points& source, const Points& target) {
  const Moments m = moments(source, target);
  const auto [rotation, extents] = best_rotation(m.covariance);
  AlignmentResult result;
  result.target_from_source = Pose(rotation, m.target_mean - rotation * m.source_mean);  // eq. 41
  result.determined = extents(0) > 0.0 && extents(1) > kRankTolerance * extents(0);
  return result;
}

AlignmentResult fit_yaw(const Points& source, const Points& target) {
  const Moments m = moments(source, target);
  // The sum of target . R(yaw) source is c cos(yaw) + s sin(yaw), largest at atan2(s, c).
  const double c = m.covariance(0, 0) + m.covariance(1, 1);
  const double s = m.covariance(1, 0) - m.covariance(0, 1);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(std::atan2(s, c), Eigen::Vector3d::UnitZ()));
  AlignmentResult result;
  result.target_from_source = Pose(rotation, m.target_mean - rotation * m.source_mean);
  result.determined = std::hypot(c, s) > 1e-12;
  return result;
}

// Errors along a path go together over many pairs, so parts are left out, not single pairs. The
// parts tell by how much the rotation would change with other errors of the same kind.
template <typename Fit>
AlignmentResult judged(const Points& source, const Points& target, const Fit& fit) {
  AlignmentResult result = fit(source, target);
  constexpr std::size_t kMostParts = 10;
  constexpr std::size_t kLeastParts = 3;
  const std::size_t parts = std::min(kMostParts, source.size() / 2);
  if (parts < kLeastParts) return result;
  double sum = 0.0;
  for (std::size_t k = 0; k < parts; ++k) {
    const std::size_t from = k * source.size() / parts;
    const std::size_t to = (k + 1) * source.size() / parts;
    const AlignmentResult rest = fit(without(source, from, to), without(target, from, to));
    const double turn = (result.target_from_source.inverse() * rest.target_from_source).angle();
    sum += turn * turn;
  }
  const auto n = static_cast<double>(parts);
  result.rotation_sd_deg = kDegPerRad * std::sqrt(sum * (n - 1.0) / n);
  result.determined = result.determined && result.rotation_sd_deg < kMostRotationSdDeg;
  return result;
}

}  // namespace

std::string to_string(Alignment alignment) {
  switch (alignment) {
    case Alignment::kNone:
      return "none";
    case Alignment::kFirst:
      return "first";
    case Alignment::kYaw:
      return "yaw";
    case Alignment::kSe3:
      return "se3";
  }
  return "none";
}

Alignment alignment_from_name(const std::string& name) {
  for (const Alignment a :
       {Alignment::kNone, Alignment::kFirst, Alignment::kYaw, Alignment::kSe3}) {
    if (to_string(a) == name) return a;
  }
  throw ConfigError({"alignment: expected none, first, yaw or se3, found '" + name + "'"});
}

AlignmentResult align_points_se3(const std::vector<Eigen::Vector3d>& source,
                                 const std::vector<Eigen::Vector3d>& target) {
  return judged(source, target, fit_se3);
}

AlignmentResult align_points_yaw(const std::vector<Eigen::Vector3d>& source,
                                 const std::vector<Eigen::Vector3d>& target) {
  return judged(source, target, fit_yaw);
}

double yaw_deg(const Pose& target_from_source) {
  const Eigen::Vector3d heading = target_from_source.rotation() * Eigen::Vector3d::UnitX();
  return kDegPerRad * std::atan2(heading.y(), heading.x());
}

std::string motion_text(const Pose& target_from_source) {
  const Eigen::Vector3d& t = target_from_source.translation();
  return fmt::format("x {}, y {}, z {} m, yaw {} deg, {:.3f} deg in all", signed_text(t.x(), 3),
                     signed_text(t.y(), 3), signed_text(t.z(), 3),
                     signed_text(yaw_deg(target_from_source), 3),
                     kDegPerRad * target_from_source.angle());
}

}  // namespace understory
