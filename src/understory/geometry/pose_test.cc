#include "understory/geometry/pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d random_direction(Random& random) {
  Eigen::Vector3d v;
  do {
    v = {random.normal(), random.normal(), random.normal()};
  } while (v.norm() < 0.1);
  return v.normalized();
}

// Tangents at zero, tiny, small (series), random and near pi.
std::vector<Vector6d> test_tangents() {
  Random random(7);
  std::vector<Vector6d> tangents = {Vector6d::Zero()};
  for (const double angle : {1e-12, 1e-8, 1e-4, 1.9e-3, 2.1e-3, 0.29, 0.31, 0.49, 0.51, 1.0, 2.0,
                             3.0, kPi - 1e-3, kPi - 1e-6, kPi - 1e-9}) {
    for (int i = 0; i < 5; ++i) {
      Vector6d xi;
      xi << angle * random_direction(random), 5.0 * random.normal(), 5.0 * random.normal(),
          random.normal();
      tangents.push_back(xi);
    }
  }
  return tangents;
}

Eigen::Matrix4d hat(const Vector6d& xi) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m.topLeftCorner<3, 3>() = skew(xi.head<3>());
  m.topRightCorner<3, 1>() = xi.tail<3>();
  return m;
}

TEST(Pose, ExponentialIsTheMatrixExponential) {  // P0 (9-12)
  for (const Vector6d& xi : test_tangents()) {
    const Eigen::Matrix4d expected = hat(xi).exp();
    EXPECT_LT((Pose::exp(xi).matrix() - expected).norm(), 1e-13 * (1.0 + expected.norm()))
        << xi.transpose();
  }
}

TEST(Pose, LogarithmInvertsTheExponential) {
  for (const Vector6d& xi : test_tangents()) {
    EXPECT_LT((Pose::exp(xi).log() - xi).norm(), 1e-12 * (1.0 + xi.norm())) << xi.transpose();
  }
}

TEST(Pose, LogarithmAtExactlyPiGivesTheSameMotion) {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0.6, 0, 0.8)}) {
    Eigen::Matrix3d rotation = 2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
    const Pose pose(rotation, Eigen::Vector3d(1, 2, 3));
    EXPECT_NEAR(pose.log().head<3>().norm(), kPi, 1e-12);
    EXPECT_LT((Pose::exp(pose.log()).matrix() - pose.matrix()).norm(), 1e-13);
  }
}

// P0 F3: the power and its inverse over 300 random motions. The paper loses digits; here the error
// is at rounding, divided by u because the 1/u-th power magnifies the rounding of the u-th.
TEST(Pose, PowerAndItsInverseAgreeOver300RandomMotions) {
  Random random(2026);
  double worst = 0.0;
  for (int i = 0; i < 300; ++i) {
    Vector6d xi;
    xi << random.uniform(0.0, kPi) * random_direction(random), random.uniform(-10, 10),
        random.uniform(-10, 10), random.uniform(-10, 10);
    const Pose pose = Pose::exp(xi);
    for (const double u : {1e-3, 3e-3, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0}) {
      const Eigen::Matrix4d there_and_back = pose.power(u).power(1.0 / u).matrix();
      worst = std::max(worst, (there_and_back - pose.matrix()).norm());
    }
  }
  EXPECT_LT(worst, 1e-11);
}

TEST(Pose, PowersAdd) {  // P0 (13-15): a one-parameter group
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    Vector6d xi;
    xi << random.uniform(0.0, 3.0) * random_direction(random), random.normal(), random.normal(),
        random.normal();
    const Pose pose = Pose::exp(xi);
    const double u = random.uniform(-1, 1);
    const double v = random.uniform(-1, 1);
    EXPECT_LT(((pose.power(u) * pose.power(v)).matrix() - pose.power(u + v).matrix()).norm(),
              1e-12);
  }
}

// Contraction of spread corrections, P0-3: angle(pose^u) = u angle, and the displacement of the
// origin grows monotonically with u for angles up to pi.
TEST(Pose, PowersContract) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    Vector6d xi;
    xi << random.uniform(0.0, kPi) * random_direction(random), random.normal(), random.normal(),
        random.normal();
    const Pose pose = Pose::exp(xi);
    double last = 0.0;
    for (int k = 1; k <= 20; ++k) {
      const Pose part = pose.power(k / 20.0);
      EXPECT_NEAR(part.angle(), k / 20.0 * pose.angle(), 1e-12);
      EXPECT_GE(part.translation().norm(), last - 1e-12);
      last = part.translation().norm();
    }
    EXPECT_LE(last, pose.translation().norm() + 1e-12);
  }
}

// Central differences of exp(xi + d) against exp(xi) exp(J_r d).
template <typename Function>
Matrix6d numeric_jacobian(const Function& f) {
  constexpr double kStep = 1e-6;
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    Vector6d d = Vector6d::Zero();
    d[i] = kStep;
    jacobian.col(i) = (f(d) - f(-d)) / (2.0 * kStep);
  }
  return jacobian;
}

TEST(Pose, RightJacobianAgreesWithDifferences) {
  for (const Vector6d& xi : test_tangents()) {
    const Pose at = Pose::exp(xi);
    const Matrix6d numeric = numeric_jacobian(
        [&](const Vector6d& d) -> Vector6d { return (at.inverse() * Pose::exp(xi + d)).log(); });
    EXPECT_LT((se3_right_jacobian(xi) - numeric).norm(), 1e-7) << xi.transpose();
  }
}

TEST(Pose, InverseJacobianInverts) {
  for (const Vector6d& xi : test_tangents()) {
    const Matrix6d product = se3_right_jacobian(xi) * se3_right_jacobian_inverse(xi);
    EXPECT_LT((product - Matrix6d::Identity()).norm(), 1e-10) << xi.transpose();
    const Eigen::Matrix3d so3 =
        so3_right_jacobian(xi.head<3>()) * so3_right_jacobian_inverse(xi.head<3>());
    EXPECT_LT((so3 - Eigen::Matrix3d::Identity()).norm(), 1e-12) << xi.transpose();
  }
}

TEST(Pose, InverseJacobianAgreesWithDifferencesOfTheLogarithm) {
  for (const Vector6d& xi : test_tangents()) {
    if (xi.head<3>().norm() > kPi - 1e-4) continue;  // the difference would cross the cut at pi
    const Pose at = Pose::exp(xi);
    const Matrix6d numeric =
        numeric_jacobian([&](const Vector6d& d) -> Vector6d { return (at * Pose::exp(d)).log(); });
    EXPECT_LT((se3_right_jacobian_inverse(xi) - numeric).norm(), 1e-6) << xi.transpose();
  }
}

TEST(Pose, AdjointMovesAPerturbationToTheOtherSide) {
  Random random(5);
  for (const Vector6d& xi : test_tangents()) {
    const Pose pose = Pose::exp(xi);
    Vector6d d;
    for (int i = 0; i < 6; ++i)
      d[i] = 0.3 * random.normal();
    const Pose right = pose * Pose::exp(d);
    const Pose left = Pose::exp(pose.adjoint() * d) * pose;
    EXPECT_LT((right.matrix() - left.matrix()).norm(), 1e-11);
  }
}

TEST(Pose, InterpolationRunsAlongTheScrew) {  // P0 (32) as corrected
  const Pose a = Pose::exp((Vector6d() << 0.1, 0.2, 0.3, 10, 20, 3).finished());
  const Pose b = Pose::exp((Vector6d() << -0.5, 0.2, 1.3, 12, 18, 4).finished());
  EXPECT_LT((interpolate(a, b, 0.0).matrix() - a.matrix()).norm(), 1e-13);
  EXPECT_LT((interpolate(a, b, 1.0).matrix() - b.matrix()).norm(), 1e-12);
  const Pose half = interpolate(a, b, 0.5);
  EXPECT_LT(((half * (a.inverse() * half)).matrix() - b.matrix()).norm(), 1e-11);
  EXPECT_LT((right_difference(half, a) - right_difference(b, half)).norm(), 1e-12);
}

// Monte Carlo check of the covariance transport; 40,000 samples give about 1 % of each sigma.
TEST(Pose, CovarianceTransportAgreesWithSampling) {
  Random random(6);
  const Pose c_from_b = Pose::exp((Vector6d() << 0.4, -0.2, 1.0, 3, 1, 2).finished());
  const Pose b_from_a = Pose::exp((Vector6d() << -0.3, 0.5, -0.8, 1, -4, 0.5).finished());
  Vector6d sigma_cb;
  sigma_cb << 0.001, 0.002, 0.003, 0.01, 0.02, 0.01;
  Vector6d sigma_ba;
  sigma_ba << 0.002, 0.001, 0.002, 0.02, 0.01, 0.03;
  const Matrix6d cov_cb = sigma_cb.array().square().matrix().asDiagonal();
  const Matrix6d cov_ba = sigma_ba.array().square().matrix().asDiagonal();
  Matrix6d sampled = Matrix6d::Zero();
  Matrix6d sampled_inverse = Matrix6d::Zero();
  constexpr int kSamples = 40'000;
  const Pose mean = c_from_b * b_from_a;
  for (int i = 0; i < kSamples; ++i) {
    Vector6d x;
    Vector6d y;
    for (int k = 0; k < 6; ++k) {
      x[k] = sigma_cb[k] * random.normal();
      y[k] = sigma_ba[k] * random.normal();
    }
    const Pose noisy_ba = b_from_a * Pose::exp(y);
    const Vector6d d = right_difference(c_from_b * Pose::exp(x) * noisy_ba, mean);
    sampled += d * d.transpose() / kSamples;
    const Vector6d e = right_difference(noisy_ba.inverse(), b_from_a.inverse());
    sampled_inverse += e * e.transpose() / kSamples;
  }
  const Matrix6d composed = compose_covariance(cov_cb, b_from_a, cov_ba);
  EXPECT_LT((sampled - composed).norm(), 0.03 * composed.norm());
  const Matrix6d inverted = inverse_covariance(b_from_a, cov_ba);
  EXPECT_LT((sampled_inverse - inverted).norm(), 0.03 * inverted.norm());
}

}  // namespace
}  // namespace understory
