#include "understory/evaluation/alignment.h"

#include <Eigen/SVD>
#include <cmath>

#include "understory/util/error.h"

namespace understory {
namespace {

// Extents below this fraction of the largest are numerical noise, not geometry.
constexpr double kRankTolerance = 1e-9;

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
  const Moments m = moments(source, target);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();  // eq. 43
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) sign.z() = -1.0;
  const Eigen::Matrix3d rotation =
      svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();  // eq. 40
  AlignmentResult result;
  result.target_from_source = Pose(rotation, m.target_mean - rotation * m.source_mean);  // eq. 41
  const Eigen::Vector3d& extent = svd.singularValues();
  result.determined = extent(0) > 0.0 && extent(1) > kRankTolerance * extent(0);
  return result;
}

AlignmentResult align_points_yaw(const std::vector<Eigen::Vector3d>& source,
                                 const std::vector<Eigen::Vector3d>& target) {
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

}  // namespace understory
