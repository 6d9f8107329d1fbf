#include "understory/georeference/satellites/rigid_fits.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d normal3(Random& random, double sd) {
  return {random.normal(0.0, sd), random.normal(0.0, sd), random.normal(0.0, sd)};
}

Matrix3d some_covariance(Random& random) {
  Matrix3d root;
  for (int i = 0; i < 9; ++i)
    root(i) = random.normal();
  return root * root.transpose() + 0.1 * Matrix3d::Identity();
}

Pose some_motion() {
  return Pose(so3_exp({0.05, -0.1, 2.4}), Vector3d(120.0, -40.0, 6.0));
}

std::vector<PlacePair> places(double noise_m, std::uint64_t seed) {
  Random random(seed);
  std::vector<PlacePair> pairs;
  for (int k = 0; k < 60; ++k) {
    PlacePair pair;
    pair.source = Vector3d(30.0 * std::sin(0.1 * k), 0.7 * k, std::cos(0.3 * k));
    pair.target = some_motion() * pair.source + normal3(random, noise_m);
    pair.target_covariance = some_covariance(random);
    pair.source_covariance = some_covariance(random);
    pairs.push_back(pair);
  }
  return pairs;
}

std::vector<FullPair> poses(double noise, std::uint64_t seed) {
  Random random(seed);
  std::vector<FullPair> pairs;
  for (int k = 0; k < 40; ++k) {
    FullPair pair;
    pair.source_from_body = Pose(so3_exp({0.1 * random.normal(), 0.1 * random.normal(), 0.15 * k}),
                                 Vector3d(0.8 * k, 10.0 * std::sin(0.2 * k), 1.0));
    Vector6d error;
    error << normal3(random, noise), normal3(random, noise);
    pair.target_from_body = some_motion() * pair.source_from_body * Pose::exp(error);
    pair.target_covariance.topLeftCorner<3, 3>() = some_covariance(random);
    pair.target_covariance.bottomRightCorner<3, 3>() = some_covariance(random);
    pair.source_covariance.topLeftCorner<3, 3>() = some_covariance(random);
    pair.source_covariance.bottomRightCorner<3, 3>() = some_covariance(random);
    pairs.push_back(pair);
  }
  return pairs;
}

double turn_between(const Pose& a, const Pose& b) {
  return (a.inverse() * b).angle();
}

// Least value of a cost over small moves about a motion: none is below its own.
void expect_minimum(const std::function<double(const Pose&)>& cost, const Pose& motion) {
  const double least = cost(motion);
  for (int axis = 0; axis < 6; ++axis) {
    for (const double step : {-1e-3, 1e-3})
      EXPECT_GT(cost(motion * Pose::exp(step * Vector6d::Unit(axis))), least) << axis;
  }
}

// Horn's quaternion, by the eigenvector of his 4 x 4 matrix, is the same turn.
TEST(RigidFits, TheClosedFormIsHornsQuaternion) {
  std::vector<PlacePair> pairs = places(2.0, 4);
  Random random(5);
  for (PlacePair& pair : pairs)
    pair.weight = random.uniform(0.2, 2.0);
  const RigidFit fit = fit_closed(pairs);
  ASSERT_TRUE(fit.found);
  Vector3d source = Vector3d::Zero();
  Vector3d target = Vector3d::Zero();
  double total = 0.0;
  for (const PlacePair& pair : pairs) {
    source += pair.weight * pair.source;
    target += pair.weight * pair.target;
    total += pair.weight;
  }
  Matrix3d s = Matrix3d::Zero();
  for (const PlacePair& pair : pairs)
    s += pair.weight * (pair.source - source / total) * (pair.target - target / total).transpose();
  Eigen::Matrix4d n;
  n << s.trace(), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0),     //
      0.0, s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2),  //
      0.0, 0.0, s(1, 1) - s(0, 0) - s(2, 2), s(1, 2) + s(2, 1),                //
      0.0, 0.0, 0.0, s(2, 2) - s(0, 0) - s(1, 1);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(
      Eigen::Matrix4d(n.selfadjointView<Eigen::Upper>()));
  const Eigen::Vector4d q = solver.eigenvectors().col(3);
  const Pose horn(Eigen::Quaterniond(q(0), q(1), q(2), q(3)), Vector3d::Zero());
  EXPECT_LT(turn_between(Pose(fit.target_from_source.rotation(), Vector3d::Zero()), horn), 1e-9);
  EXPECT_LT((fit.target_from_source * Vector3d(source / total) - target / total).norm(), 1e-9);
}

TEST(RigidFits, TheClosedFormIsNoMirror) {
  std::vector<PlacePair> pairs;
  for (int k = 0; k < 20; ++k)  // in one plane, where a mirror fits as well
    pairs.push_back({Vector3d(k, k % 3, 0.0), some_motion() * Vector3d(k, k % 3, 0.0),
                     Matrix3d::Identity(), Matrix3d::Zero(), 1.0});
  const RigidFit fit = fit_closed(pairs);
  ASSERT_TRUE(fit.found);
  EXPECT_LT(turn_between(fit.target_from_source, some_motion()), 1e-9);
  EXPECT_FALSE(fit_closed({pairs[0], pairs[1]}).found);
  EXPECT_FALSE(fit_closed({pairs[0], pairs[0], pairs[0]}).found);
}

TEST(RigidFits, JacobiansAgreeWithDifferences) {
  for (const Pose& motion :
       {Pose(), some_motion(), some_motion() * Pose::exp(Vector6d::Constant(0.4))}) {
    for (const PlacePair& pair : {places(1.0, 2)[0], places(1.0, 2)[31]}) {
      const auto analytic = place_residual_jacobian(pair, motion);
      for (int axis = 0; axis < 6; ++axis) {
        const Vector6d step = 1e-6 * Vector6d::Unit(axis);
        const Vector3d numeric = (place_residual(pair, motion * Pose::exp(step)) -
                                  place_residual(pair, motion * Pose::exp(-step))) /
                                 2e-6;
        EXPECT_LT((analytic.col(axis) - numeric).norm(), 1e-6) << axis;
      }
    }
    for (const FullPair& pair : {poses(0.3, 2)[0], poses(0.3, 2)[21]}) {
      const auto analytic = pose_residual_jacobian(pair, motion);
      for (int axis = 0; axis < 6; ++axis) {
        const Vector6d step = 1e-6 * Vector6d::Unit(axis);
        const Vector6d numeric = (pose_residual(pair, motion * Pose::exp(step)) -
                                  pose_residual(pair, motion * Pose::exp(-step))) /
                                 2e-6;
        EXPECT_LT((analytic.col(axis) - numeric).norm(), 1e-4 * (1.0 + numeric.norm())) << axis;
      }
    }
  }
}

// P4 (44) as the Errata print it, with the derivative of the covariance by the turn left out: the
// minimum for the covariances at the solution.
TEST(RigidFits, PositionsEndAtTheMinimumOfEquation44) {
  const std::vector<PlacePair> pairs = places(0.5, 3);
  const RigidFit fit =
      fit_positions(pairs, fit_closed(pairs).target_from_source, {50, 1e-12, false});
  ASSERT_TRUE(fit.found) << fit.reason;
  const Matrix3d r = fit.target_from_source.rotation_matrix();
  expect_minimum(
      [&](const Pose& motion) {
        double sum = 0.0;
        for (const PlacePair& pair : pairs) {
          const Vector3d d = pair.target - motion * pair.source;
          sum += d.dot((pair.target_covariance + r * pair.source_covariance * r.transpose())
                           .ldlt()
                           .solve(d));
        }
        return sum;
      },
      fit.target_from_source);
}

// P4 (47) as printed belongs to left differences, the sum of covariances to right ones: both have
// the same minimum, and the fit ends there.
TEST(RigidFits, PosesEndAtTheMinimumOfEquation46InBothConventions) {
  const std::vector<FullPair> pairs = poses(0.01, 6);
  const RigidFit fit =
      fit_poses(pairs, some_motion() * Pose::exp(Vector6d::Constant(0.1)), {50, 1e-12, false});
  ASSERT_TRUE(fit.found) << fit.reason;
  EXPECT_LT(turn_between(fit.target_from_source, some_motion()), 0.02);
  expect_minimum(
      [&](const Pose& motion) {
        double sum = 0.0;
        for (const FullPair& pair : pairs) {
          const Vector6d d =
              ((motion * pair.source_from_body).inverse() * pair.target_from_body).log();
          sum += d.dot((pair.target_covariance + pair.source_covariance).ldlt().solve(d));
        }
        return sum;
      },
      fit.target_from_source);
  expect_minimum(
      [&](const Pose& motion) {
        double sum = 0.0;
        for (const FullPair& pair : pairs) {
          const Vector6d d =
              (pair.target_from_body * (motion * pair.source_from_body).inverse()).log();
          // Left covariances of both, by the adjoints; that of the moved pose is (47)'s second
          // term.
          const Matrix6d at = pair.target_from_body.adjoint();
          const Matrix6d as = motion.adjoint() * pair.source_from_body.adjoint();
          const Matrix6d sum6 = at * pair.target_covariance * at.transpose() +
                                as * pair.source_covariance * as.transpose();
          sum += d.dot(sum6.ldlt().solve(d));
        }
        return sum;
      },
      fit.target_from_source * Pose());
}

TEST(RigidFits, RunawaysHaveLittleSay) {
  std::vector<PlacePair> pairs = places(0.05, 8);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    pairs[k].target_covariance = pairs[k].source_covariance = 0.01 * Matrix3d::Identity();
    if (k % 6 == 0) pairs[k].target += Vector3d(15.0, 0.0, 25.0);
  }
  const Pose start = fit_closed(pairs).target_from_source;
  const auto error = [&](const RigidFit& fit) {
    double worst = 0.0;
    for (const PlacePair& pair : pairs)
      worst = std::max(worst,
                       (fit.target_from_source * pair.source - some_motion() * pair.source).norm());
    return worst;
  };
  EXPECT_LT(error(fit_positions(pairs, start, {})), 0.1);
  EXPECT_GT(error(fit_positions(pairs, start, {50, 1e-9, false})), 1.0);
}

// With independent errors of the stated size the stated covariance holds.
TEST(RigidFits, TheStatedCovarianceHoldsForIndependentErrors) {
  Vector6d squares = Vector6d::Zero();
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<PlacePair> pairs = places(0.3, static_cast<std::uint64_t>(20 + draw));
    for (PlacePair& pair : pairs) {
      pair.target_covariance = 0.06 * Matrix3d::Identity();
      pair.source_covariance = 0.03 * Matrix3d::Identity();
    }
    const RigidFit fit = fit_positions(pairs, some_motion(), {50, 1e-9, false});
    const Vector6d error = right_difference(some_motion(), fit.target_from_source);
    squares += error.cwiseAbs2().cwiseQuotient(fit.covariance.diagonal()) / kDraws;
  }
  for (int axis = 0; axis < 6; ++axis)
    EXPECT_NEAR(squares(axis), 1.0, 0.3) << axis;
}

}  // namespace
}  // namespace understory
