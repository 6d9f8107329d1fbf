#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// A point of the run and where it lies in the target frame; metres.
struct PlacePair {
  Eigen::Vector3d source = Eigen::Vector3d::Zero();
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  Eigen::Matrix3d target_covariance = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d source_covariance = Eigen::Matrix3d::Zero();  // in the source frame
  double weight = 1.0;
};

// A pose of the run and the same pose in the target frame.
struct FullPair {
  Pose source_from_body;
  Pose target_from_body;
  // Right perturbations (body frame), rotation before translation.
  Matrix6d source_covariance = Matrix6d::Zero();
  Matrix6d target_covariance = Matrix6d::Identity();
  double weight = 1.0;
};

// When an iterated fit ends.
struct RigidFitConfig {
  int most_steps = 50;
  double least_step = 1e-9;  // norm of a step, radians and metres
  // Pairs count by Cauchy's weight of their Mahalanobis distance, whose scale comes from the pairs.
  bool robust = true;
};

// One rigid motion between pairs.
struct RigidFit {
  bool found = false;
  std::string reason;  // if not
  Pose target_from_source;
  // Of a right perturbation, rotation first, if the covariances of the pairs are right and their
  // errors are independent; zero for the closed form.
  Matrix6d covariance = Matrix6d::Zero();
  std::vector<double> weight;  // of each pair as used
  int steps = 0;
};

// Horn's and Umeyama's closed form: least sum of weighted squared distances over all rotations and
// shifts, no scale. T5 "closed" of P4. Not found for fewer than three pairs or pairs of one place;
// of pairs on one line the turn about it is the smallest.
[[nodiscard]] RigidFit fit_closed(const std::vector<PlacePair>& pairs);

// P4 (44) with the covariance of the Errata, Gauss-Newton with the analytic derivative, from
// `start`: the covariance of a pair is target_covariance + R source_covariance R^T.
[[nodiscard]] RigidFit fit_positions(const std::vector<PlacePair>& pairs, const Pose& start,
                                     const RigidFitConfig& config);

// P4 (45-52): the right difference of poses, whose covariances add (Errata to (47)), with the
// analytic derivative, from `start`.
[[nodiscard]] RigidFit fit_poses(const std::vector<FullPair>& pairs, const Pose& start,
                                 const RigidFitConfig& config);

// P4 (45): D of one pair at a motion.
[[nodiscard]] Vector6d pose_residual(const FullPair& pair, const Pose& target_from_source);
// P4 (51, 52): its derivative by a right perturbation of the motion.
[[nodiscard]] Matrix6d pose_residual_jacobian(const FullPair& pair, const Pose& target_from_source);
// Target minus moved source, and its derivative by a right perturbation of the motion.
[[nodiscard]] Eigen::Vector3d place_residual(const PlacePair& pair, const Pose& target_from_source);
[[nodiscard]] Eigen::Matrix<double, 3, 6> place_residual_jacobian(const PlacePair& pair,
                                                                  const Pose& target_from_source);

}  // namespace understory
