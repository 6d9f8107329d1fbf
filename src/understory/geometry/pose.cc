#include "understory/geometry/pose.h"

#include <cmath>
#include <numbers>

namespace understory {
namespace {

// Below this angle series are used; their first dropped terms are then below rounding (1e-18).
constexpr double kSeriesAngle = 2e-3;

// (1 - cos t) / t^2 and (t - sin t) / t^3: the coefficients of the left Jacobian of SO(3).
double cosine_coefficient(double t) {
  const double t2 = t * t;
  if (t < kSeriesAngle) return 0.5 - t2 / 24.0 + t2 * t2 / 720.0;
  const double s = std::sin(0.5 * t) / t;
  return 2.0 * s * s;
}

double sine_coefficient(double t) {
  const double t2 = t * t;
  // t - sin t loses digits early, so the series reaches further here, with more terms.
  if (t < 0.3) {
    return (1.0 / 6.0) -
           t2 * (1.0 / 120.0 -
                 t2 * (1.0 / 5040.0 -
                       t2 * (1.0 / 362880.0 - t2 * (1.0 / 39916800.0 - t2 / 6227020800.0))));
  }
  return (t - std::sin(t)) / (t2 * t);
}

Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& omega) {
  const double t = omega.norm();
  const Eigen::Matrix3d w = skew(omega);
  return Eigen::Matrix3d::Identity() + cosine_coefficient(t) * w + sine_coefficient(t) * w * w;
}

// 1/t^2 - cot(t/2) / (2t): the coefficient of the inverse Jacobian.
double inverse_coefficient(double t) {
  const double t2 = t * t;
  if (t < 0.3) {
    return 1.0 / 12.0 +
           t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 +
                                     t2 * (1.0 / 1209600.0 + t2 * (1.0 / 47900160.0 +
                                                                   t2 * 691.0 / 1307674368000.0))));
  }
  return (1.0 - 0.5 * t * std::cos(0.5 * t) / std::sin(0.5 * t)) / t2;
}

Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& omega) {
  const Eigen::Matrix3d w = skew(omega);
  return Eigen::Matrix3d::Identity() - 0.5 * w + inverse_coefficient(omega.norm()) * w * w;
}

// The block Q of the left Jacobian of SE(3) (Barfoot, State Estimation for Robotics, eq. 7.86).
Eigen::Matrix3d se3_jacobian_block(const Eigen::Vector3d& omega, const Eigen::Vector3d& v) {
  const double t = omega.norm();
  const double t2 = t * t;
  const Eigen::Matrix3d w = skew(omega);
  const Eigen::Matrix3d p = skew(v);
  const double a = sine_coefficient(t);
  double b = 0.0;  // (t^2 + 2 cos t - 2) / (2 t^4)
  double c = 0.0;  // (2 t - 3 sin t + t cos t) / (2 t^5)
  if (t < 0.5) {
    b = 1.0 / 24.0 -
        t2 * (1.0 / 720.0 - t2 * (1.0 / 40320.0 - t2 * (1.0 / 3628800.0 - t2 / 479001600.0)));
    c = 1.0 / 120.0 -
        t2 * (1.0 / 2520.0 - t2 * (1.0 / 120960.0 - t2 * (1.0 / 9979200.0 - t2 / 1245404160.0)));
  } else {
    b = (t2 + 2.0 * std::cos(t) - 2.0) / (2.0 * t2 * t2);
    c = (2.0 * t - 3.0 * std::sin(t) + t * std::cos(t)) / (2.0 * t2 * t2 * t);
  }
  return 0.5 * p + a * (w * p + p * w + w * p * w) + b * (w * w * p + p * w * w - 3.0 * w * p * w) +
         c * (w * p * w * w + w * w * p * w);
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& omega) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -omega.z(), omega.y(), omega.z(), 0.0, -omega.x(), -omega.y(), omega.x(), 0.0;
  return matrix;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega) {
  const double t = omega.norm();
  const double t2 = t * t;
  const double factor =
      t < kSeriesAngle ? 0.5 - t2 / 48.0 + t2 * t2 / 3840.0 : std::sin(0.5 * t) / t;
  const Eigen::Vector3d v = factor * omega;
  return {std::cos(0.5 * t), v.x(), v.y(), v.z()};
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  const Eigen::Vector3d v = rotation.w() < 0.0 ? Eigen::Vector3d(-rotation.vec()) : rotation.vec();
  const double w = std::abs(rotation.w());
  const double n = v.norm();
  // atan2 keeps full precision both near 0 (v small) and near pi (w small).
  const double factor =
      n < 1e-8 ? 2.0 / w - 2.0 * n * n / (3.0 * w * w * w) : 2.0 * std::atan2(n, w) / n;
  return factor * v;
}

Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& omega) {
  return so3_left_jacobian(-omega);
}

Eigen::Matrix3d so3_right_jacobian_inverse(const Eigen::Vector3d& omega) {
  return so3_left_jacobian_inverse(-omega);
}

Pose Pose::from_matrix(const Eigen::Matrix4d& matrix) {
  return {Eigen::Matrix3d(matrix.topLeftCorner<3, 3>()),
          Eigen::Vector3d(matrix.topRightCorner<3, 1>())};
}

Pose Pose::from_unit(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
  Pose pose;
  pose.rotation_ = rotation;
  pose.translation_ = translation;
  return pose;
}

Eigen::Matrix4d Pose::matrix() const {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = rotation_matrix();
  matrix.topRightCorner<3, 1>() = translation_;
  return matrix;
}

Pose Pose::inverse() const {
  const Eigen::Quaterniond inverse = rotation_.conjugate();
  return {inverse, Eigen::Vector3d(-(inverse * translation_))};
}

Pose Pose::operator*(const Pose& other) const {
  return {rotation_ * other.rotation_,
          Eigen::Vector3d(rotation_ * other.translation_ + translation_)};
}

double Pose::angle() const {
  return 2.0 * std::atan2(rotation_.vec().norm(), std::abs(rotation_.w()));
}

Pose Pose::exp(const Vector6d& xi) {
  const Eigen::Vector3d omega = xi.head<3>();
  return {so3_exp(omega), Eigen::Vector3d(so3_left_jacobian(omega) * xi.tail<3>())};
}

Vector6d Pose::log() const {
  const Eigen::Vector3d omega = so3_log(rotation_);
  Vector6d xi;
  xi << omega, so3_left_jacobian_inverse(omega) * translation_;
  return xi;
}

Pose Pose::power(double u) const {
  return exp(u * log());
}

Matrix6d Pose::adjoint() const {
  const Eigen::Matrix3d r = rotation_matrix();
  Matrix6d adjoint;
  adjoint << r, Eigen::Matrix3d::Zero(), skew(translation_) * r, r;
  return adjoint;
}

Matrix6d se3_right_jacobian(const Vector6d& xi) {
  const Eigen::Matrix3d j = so3_left_jacobian(-xi.head<3>());
  Matrix6d jacobian;
  jacobian << j, Eigen::Matrix3d::Zero(), se3_jacobian_block(-xi.head<3>(), -xi.tail<3>()), j;
  return jacobian;
}

Matrix6d se3_right_jacobian_inverse(const Vector6d& xi) {
  const Eigen::Matrix3d inverse = so3_left_jacobian_inverse(-xi.head<3>());
  const Eigen::Matrix3d q = se3_jacobian_block(-xi.head<3>(), -xi.tail<3>());
  Matrix6d jacobian;
  jacobian << inverse, Eigen::Matrix3d::Zero(), -inverse * q * inverse, inverse;
  return jacobian;
}

Pose interpolate(const Pose& from, const Pose& to, double u) {
  return from * (from.inverse() * to).power(u);
}

Vector6d right_difference(const Pose& to, const Pose& from) {
  return (from.inverse() * to).log();
}

Matrix6d compose_covariance(const Matrix6d& covariance_cb, const Pose& b_from_a,
                            const Matrix6d& covariance_ba) {
  const Matrix6d adjoint = b_from_a.inverse().adjoint();
  return adjoint * covariance_cb * adjoint.transpose() + covariance_ba;
}

Matrix6d inverse_covariance(const Pose& b_from_a, const Matrix6d& covariance_ba) {
  const Matrix6d adjoint = b_from_a.adjoint();
  return adjoint * covariance_ba * adjoint.transpose();
}

}  // namespace understory
