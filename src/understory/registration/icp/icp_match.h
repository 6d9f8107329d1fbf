#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "understory/registration/icp/icp.h"
#include "understory/registration/icp/surface.h"
#include "understory/registration/judged_match.h"
#include "understory/registration/match_sums.h"
#include "understory/util/parallel.h"

// What all targets of ICP share, whatever they find nearest points by. A target T has
//   std::size_t size() const;
//   struct Known;  what it knows of a source point from the search before
//   bool nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair, Known&) const;
namespace understory::internal {

// Adds what one source point says at a pose. `surfaces`: of the source, for the symmetric metric
// only.
template <typename Target>
class IcpAccumulator {
 public:
  IcpAccumulator(const Target& target, const Points& source, const Pose& pose,
                 const IcpConfig& config, const std::vector<SurfacePatch>& surfaces,
                 std::vector<typename Target::Known>& known)
      : target_(target),
        source_(source),
        surfaces_(surfaces),
        known_(known),
        pose_(pose),
        rotation_(pose.rotation_matrix()),
        max_distance_m_(config.max_distance_m),
        precision_(1.0 / (config.sigma_m * config.sigma_m)),
        loss_(loss_of_step(source.size(), config.kernel_m, config.loss,
                           [this](std::size_t i) { return squared_of(i); })),
        unmatched_(0.5 * loss_.of_unmatched(max_distance_m_ * max_distance_m_) * precision_) {}

  void operator()(MatchSums& sums, std::size_t i) const {
    const Eigen::Vector3d point = source_[i].cast<double>();
    IcpPair pair;
    if (!target_.nearest(pose_ * point, max_distance_m_, pair, known_[i])) {
      sums.cost += unmatched_;
      return;
    }
    ++sums.matched;
    sums.nearest_squared += static_cast<double>(pair.squared_m2);
    if (pair.patch.surface == SurfaceKind::kNothing) return;
    const Eigen::Vector3d direction = pair.patch.direction.cast<double>();
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -rotation_ * skew(point), rotation_;
    if (pair.patch.surface == SurfaceKind::kPlane) {
      if (is_symmetric(i)) return add_symmetric(direction, pair.offset, jacobian, i, sums);
      add<1>(direction.transpose() * jacobian,
             Eigen::Matrix<double, 1, 1>(direction.dot(pair.offset)), sums);
    } else if (pair.patch.surface == SurfaceKind::kPole) {
      const Eigen::Matrix3d across =
          Eigen::Matrix3d::Identity() - direction * direction.transpose();
      add<3>(across * jacobian, across * pair.offset, sums);
    } else {
      add<3>(jacobian, pair.offset, sums);
    }
  }

 private:
  [[nodiscard]] bool is_symmetric(std::size_t i) const {
    return !surfaces_.empty() && surfaces_[i].surface == SurfaceKind::kPlane;
  }
  // The source's normal in the axes of the target, on the side of the target's.
  [[nodiscard]] Eigen::Vector3d turned_normal(const Eigen::Vector3d& target_normal,
                                              std::size_t i) const {
    const Eigen::Vector3d normal = rotation_ * surfaces_[i].direction.cast<double>();
    return normal.dot(target_normal) < 0.0 ? Eigen::Vector3d(-normal) : normal;
  }
  // Rusinkiewicz 2019 (9): the residual lies along the mean of both normals. The source's turns
  // along.
  void add_symmetric(const Eigen::Vector3d& target_normal, const Eigen::Vector3d& offset,
                     const Eigen::Matrix<double, 3, 6>& jacobian, std::size_t i,
                     MatchSums& sums) const {
    const Eigen::Vector3d source_normal = turned_normal(target_normal, i);
    const Eigen::Vector3d mean = 0.5 * (target_normal + source_normal);
    Eigen::Matrix<double, 1, 6> row = mean.transpose() * jacobian;
    row.head<3>() += 0.5 * (rotation_.transpose() * source_normal.cross(offset)).transpose();
    add<1>(row, Eigen::Matrix<double, 1, 1>(mean.dot(offset)), sums);
  }
  // Squared residual of a point, m^2; NaN if it has none.
  [[nodiscard]] double squared_of(std::size_t i) const {
    IcpPair pair;
    if (!target_.nearest(pose_ * source_[i].cast<double>(), max_distance_m_, pair, known_[i]))
      return std::nan("");
    const Eigen::Vector3d direction = pair.patch.direction.cast<double>();
    switch (pair.patch.surface) {
      case SurfaceKind::kPlane: {
        const Eigen::Vector3d normal =
            is_symmetric(i) ? Eigen::Vector3d(0.5 * (direction + turned_normal(direction, i)))
                            : direction;
        return std::pow(normal.dot(pair.offset), 2);
      }
      case SurfaceKind::kPole:
        return (pair.offset - direction * direction.dot(pair.offset)).squaredNorm();
      case SurfaceKind::kPoint:
        return pair.offset.squaredNorm();
      case SurfaceKind::kNothing:
        break;
    }
    return std::nan("");
  }
  template <int Rows>
  void add(const Eigen::Matrix<double, Rows, 6>& jacobian,
           const Eigen::Matrix<double, Rows, 1>& residual, MatchSums& sums) const {
    const double squared = residual.squaredNorm();
    const auto [loss, weight] = loss_.at(squared);
    sums.cost += 0.5 * loss * precision_;
    sums.hessian += (weight * precision_) * jacobian.transpose() * jacobian;
    sums.gradient += (weight * precision_) * jacobian.transpose() * residual;
    sums.weight += weight;
    sums.weighted_residual += weight * squared * precision_;
    sums.weighted_rows += weight * Rows;
    sums.surface_squared += weight * squared;
  }

  const Target& target_;
  const Points& source_;
  const std::vector<SurfacePatch>& surfaces_;
  std::vector<typename Target::Known>& known_;  // each element belongs to one point
  const Pose& pose_;
  Eigen::Matrix3d rotation_;
  double max_distance_m_;
  double precision_;
  RobustLoss loss_;   // asks what stands above it
  double unmatched_;  // cost of a point without a match
};

// The surfaces of a source as the metric needs them; none else.
[[nodiscard]] inline std::vector<SurfacePatch> icp_source_surfaces(const Points& source,
                                                                   const IcpConfig& config) {
  if (config.metric != IcpConfig::Metric::kSymmetric) return {};
  return surfaces_of(source, config.source_neighbours, config.max_planarity);
}

// Normal equations of all matches at a pose. `surfaces`: see icp_source_surfaces; `known` holds the
// partners of the pose before, by point.
template <typename Target>
[[nodiscard]] MatchSums icp_sums(const Target& target, const Points& source, const Pose& pose,
                                 const IcpConfig& config, const std::vector<SurfacePatch>& surfaces,
                                 std::vector<typename Target::Known>& known) {
  const IcpAccumulator<Target> accumulator(target, source, pose, config, surfaces, known);
  return ordered_sum(source.size(), 64, MatchSums{}, accumulator);
}

// The cost in the scale in which Gaussian terms can be added.
[[nodiscard]] inline PoseCost icp_cost(const MatchSums& at, const IcpConfig& config) {
  const double share = config.independent_share;
  return {share * at.cost, share * at.gradient, share * at.hessian};
}

// Matches a source to a target, Gauss-Newton steps from a guess. The result tells why it ended.
template <typename Target>
[[nodiscard]] RegistrationResult icp_match(const Target& target, const Points& source,
                                           const Pose& guess, const PoseTerms& terms,
                                           const IcpConfig& config) {
  const auto least = static_cast<std::size_t>(config.min_matches);
  if (target.size() < least || source.size() < least) {
    return refused(RegistrationStatus::kTooFewPoints,
                   "only " + std::to_string(source.size()) + " source and " +
                       std::to_string(target.size()) + " target points",
                   guess);
  }
  const std::vector<SurfacePatch> surfaces = icp_source_surfaces(source, config);
  std::vector<typename Target::Known> known(source.size());
  MatchSums at;
  const auto evaluate = [&](const Pose& pose) {
    at = icp_sums(target, source, pose, config, surfaces, known);
    PoseCost sum = icp_cost(at, config);
    add_terms(terms, pose, config.independent_share * static_cast<double>(at.matched), sum);
    return sum;
  };
  const double range = mean_range(source);
  const Minimum minimum = minimise(evaluate, guess,
                                   {config.max_iterations, config.step_translation_m,
                                    config.step_rotation_rad, config.max_step_m, range});
  at = icp_sums(target, source, minimum.pose, config, surfaces, known);
  return judged_match(minimum, at, source, range, guess, Judgement(config));
}

}  // namespace understory::internal
