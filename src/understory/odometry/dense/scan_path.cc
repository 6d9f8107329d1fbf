#include "understory/odometry/dense/scan_path.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "understory/odometry/odometry_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::scan_path;

using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

struct Slice {
  FeaturePoints cloud;
  double share = 0.0;  // mean time of the points, of the scan's duration
};

std::vector<Slice> slices_of(const BodyCloud& source, TimeNs duration) {
  std::vector<Slice> slices(kSlices);
  const std::vector<std::uint8_t> lidars = lidars_of(source.ring);
  for (std::size_t i = 0; i < source.size(); ++i) {
    const double share = static_cast<double>(source.t_ns[i]) / static_cast<double>(duration);
    const auto at = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * kSlices);
    Slice& slice = slices[std::min(at, kSlices - 1)];
    slice.cloud.points.push_back(source.points[i]);
    if (!source.feature.empty()) slice.cloud.features.push_back(source.feature[i]);
    if (!lidars.empty()) slice.cloud.lidars.push_back(lidars[i]);
    slice.share += share;
  }
  std::erase_if(slices,
                [](const Slice& slice) { return slice.cloud.points.size() < kFewestPoints; });
  for (Slice& slice : slices)
    slice.share /= static_cast<double>(slice.cloud.points.size());
  return slices;
}

Vector6d correction_at(const ScanPathCorrection& correction, double share) {
  return (1.0 - share) * correction.at_start + share * correction.at_end;
}

// Information of the difference between the corrections at the end and at the start, by the same
// model as constant_velocity_interval.
Vector6d bend_information(TimeNs duration, const ScanPathConfig& config) {
  const double s = to_seconds(duration);
  const double grown = std::sqrt(s * s * s / 3.0);
  const double rotation = config.angular_accel_sigma_rad_s2 * grown;
  const double translation = config.accel_sigma_m_s2 * grown;
  Vector6d information;
  information << Eigen::Vector3d::Constant(1.0 / (rotation * rotation)),
      Eigen::Vector3d::Constant(1.0 / (translation * translation));
  return information;
}

struct Equations {
  Matrix12d hessian = Matrix12d::Zero();
  Vector12d gradient = Vector12d::Zero();

  // Adds what a correction that is `share` of the way from start to end says of both.
  void add(double share, const Matrix6d& h, const Vector6d& g) {
    const std::array<double, 2> weight = {1.0 - share, share};
    for (int a = 0; a < 2; ++a) {
      const double wa = weight[static_cast<std::size_t>(a)];
      gradient.segment<6>(6 * a) += wa * g;
      for (int b = 0; b < 2; ++b)
        hessian.block<6, 6>(6 * a, 6 * b) += wa * weight[static_cast<std::size_t>(b)] * h;
    }
  }
  void add_bend(const Vector6d& information, const Vector6d& bend) {
    const Matrix6d h = information.asDiagonal();
    const Vector6d g = h * bend;
    gradient.head<6>() -= g;
    gradient.tail<6>() += g;
    hessian.topLeftCorner<6, 6>() += h;
    hessian.bottomRightCorner<6, 6>() += h;
    hessian.topRightCorner<6, 6>() -= h;
    hessian.bottomLeftCorner<6, 6>() -= h;
  }
};

}  // namespace

ScanPathCorrection match_scan_path(const MatchTarget& target, const BodyCloud& source,
                                   TimeNs duration, const Pose& start,
                                   const ScanPathConfig& config) {
  UNDERSTORY_CHECK(duration > 0);
  ScanPathCorrection correction;
  const std::vector<Slice> slices = slices_of(source, duration);
  if (slices.size() < 2) return correction;
  std::vector<std::unique_ptr<const MatchCost>> costs;
  for (const Slice& slice : slices) {
    costs.push_back(target.cost_of_features(slice.cloud, MatchStart::kNear));
    if (costs.back() == nullptr) return correction;
  }
  const Vector6d information = bend_information(duration, config);
  while (correction.iterations < config.max_iterations) {
    ++correction.iterations;
    Equations sum;
    for (std::size_t i = 0; i < slices.size(); ++i) {
      const double share = slices[i].share;
      const PoseCost at = costs[i]->at(start * Pose::exp(correction_at(correction, share)));
      sum.add(share, at.hessian, at.gradient);
    }
    sum.add_bend(information, correction.at_end - correction.at_start);
    // What neither points nor bend say anything about stays where it is.
    sum.hessian.diagonal().array() += 1e-6 * sum.hessian.diagonal().maxCoeff();
    const Vector12d step = -sum.hessian.ldlt().solve(sum.gradient);
    if (!step.allFinite()) return {};
    correction.at_start += step.head<6>();
    correction.at_end += step.tail<6>();
    const double turned = std::max(step.head<3>().norm(), step.segment<3>(6).norm());
    const double moved = std::max(step.segment<3>(3).norm(), step.tail<3>().norm());
    if (turned < costs.front()->step_rotation_rad() && moved < costs.front()->step_translation_m())
      break;
  }
  const double limit = config.max_sigmas * config.max_sigmas;
  for (const Vector6d& end : {correction.at_start, correction.at_end}) {
    if (end.cwiseProduct(information).dot(end) > limit) return {};
  }
  return correction;
}

std::vector<StampedPose> corrected_path(std::span<const StampedPose> path, const Pose& start,
                                        TimeNs duration, const ScanPathCorrection& correction) {
  std::vector<StampedPose> corrected;
  if (path.empty()) return corrected;
  const Pose stamp_from_guess = path.front().world_from_body.inverse();
  for (const StampedPose& pose : path) {
    const double share =
        static_cast<double>(pose.stamp - path.front().stamp) / static_cast<double>(duration);
    corrected.push_back({pose.stamp, start * Pose::exp(correction_at(correction, share)) *
                                         (stamp_from_guess * pose.world_from_body)});
  }
  return corrected;
}

}  // namespace understory
