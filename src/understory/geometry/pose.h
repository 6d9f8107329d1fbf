#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace understory {

// Tangent vectors of SE(3) are ordered (rotation, translation): xi = (omega, v) with omega in
// radians and v in metres. Perturbations act on the right: pose * Pose::exp(xi). Both conventions
// hold everywhere in the project (docs/reference/frames.md).
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Rotation algebra, P0 (1-8). Exact to rounding for every angle, by series near 0 and by the
// quaternion near pi.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& omega);
[[nodiscard]] Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega);
// The rotation vector of smallest angle, in [0, pi]. At exactly pi one of the two axes is returned.
[[nodiscard]] Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);
// Right Jacobian of SO(3): exp(omega + d) = exp(omega) exp(J_r d) to first order; and its inverse
// (defined for angles below 2 pi).
[[nodiscard]] Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& omega);
[[nodiscard]] Eigen::Matrix3d so3_right_jacobian_inverse(const Eigen::Vector3d& omega);

// A rigid motion, an element of SE(3); maps points of a source frame into a target frame and is
// named `target_from_source`. The rotation is a unit quaternion, so that chains of products do not
// lose orthogonality. A value type without shared state.
class Pose {
 public:
  Pose() : rotation_(Eigen::Quaterniond::Identity()), translation_(Eigen::Vector3d::Zero()) {}
  Pose(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
      : rotation_(rotation.normalized()), translation_(translation) {}
  Pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : Pose(Eigen::Quaterniond(rotation), translation) {}
  [[nodiscard]] static Pose from_matrix(const Eigen::Matrix4d& matrix);
  // From a quaternion that is known to have unit length; its bits are kept.
  [[nodiscard]] static Pose from_unit(const Eigen::Quaterniond& rotation,
                                      const Eigen::Vector3d& translation);

  [[nodiscard]] const Eigen::Quaterniond& rotation() const { return rotation_; }
  [[nodiscard]] Eigen::Matrix3d rotation_matrix() const { return rotation_.toRotationMatrix(); }
  [[nodiscard]] const Eigen::Vector3d& translation() const { return translation_; }
  [[nodiscard]] Eigen::Matrix4d matrix() const;

  [[nodiscard]] Pose inverse() const;
  // c_from_a = c_from_b * b_from_a
  [[nodiscard]] Pose operator*(const Pose& other) const;
  // point_in_target = target_from_source * point_in_source
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation_ * point + translation_;
  }
  // Rotation angle in [0, pi], radians.
  [[nodiscard]] double angle() const;

  // Exponential and logarithm of SE(3), P0 (9-12). log has the rotation angle in [0, pi].
  [[nodiscard]] static Pose exp(const Vector6d& xi);
  [[nodiscard]] Vector6d log() const;
  // Real power of the motion, P0 (13-15): exp(u log(pose)), the same screw run to the fraction u.
  // Any real u; pose.power(u).power(1 / u) gives the pose back as long as |u| * angle < pi.
  [[nodiscard]] Pose power(double u) const;

  // 6 x 6 adjoint: pose * exp(xi) = exp(pose.adjoint() * xi) * pose.
  [[nodiscard]] Matrix6d adjoint() const;

 private:
  Eigen::Quaterniond rotation_;
  Eigen::Vector3d translation_;
};

// Right Jacobian of SE(3) and its inverse: exp(xi + d) = exp(xi) exp(J_r d) to first order.
[[nodiscard]] Matrix6d se3_right_jacobian(const Vector6d& xi);
[[nodiscard]] Matrix6d se3_right_jacobian_inverse(const Vector6d& xi);

// Along the screw from `from` (u = 0) to `to` (u = 1): from * (from^-1 to)^u, P0 (32) as corrected.
[[nodiscard]] Pose interpolate(const Pose& from, const Pose& to, double u);

// Right difference: the xi with from * exp(xi) = to.
[[nodiscard]] Vector6d right_difference(const Pose& to, const Pose& from);

// Covariance transport. Covariances are of right perturbations (body frame), rotation first.
// Of c_from_a = c_from_b * b_from_a with independent errors of both factors.
[[nodiscard]] Matrix6d compose_covariance(const Matrix6d& covariance_cb, const Pose& b_from_a,
                                          const Matrix6d& covariance_ba);
// Of b_from_a^-1 given that of b_from_a.
[[nodiscard]] Matrix6d inverse_covariance(const Pose& b_from_a, const Matrix6d& covariance_ba);

}  // namespace understory
