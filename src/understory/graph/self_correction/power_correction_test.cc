#include "understory/graph/self_correction/power_correction.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <random>

namespace understory {
namespace {

Vector6d random_twist(std::mt19937& random, double angle, double shift) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vector6d xi;
  for (int k = 0; k < 3; ++k) {
    xi[k] = angle * unit(random);
    xi[k + 3] = shift * unit(random);
  }
  return xi;
}

std::vector<Pose> random_walk(int views, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Pose> poses = {Pose::exp(random_twist(random, 1.0, 20.0))};
  Vector6d forward = Vector6d::Zero();
  forward[3] = 1.0;
  for (int k = 1; k < views; ++k)
    poses.push_back(poses.back() * Pose::exp(forward + random_twist(random, 0.2, 0.5)));
  return poses;
}

void expect_same(const Pose& a, const Pose& b) {
  EXPECT_LT((a.matrix() - b.matrix()).cwiseAbs().maxCoeff(), 1e-9);
}

constexpr PowerCoefficient kAll[] = {PowerCoefficient::kIndex, PowerCoefficient::kPathLength,
                                     PowerCoefficient::kMatchError, PowerCoefficient::kMetric,
                                     PowerCoefficient::kScrew};

TEST(PowerCoefficients, FollowTheirEquations) {
  const std::vector<Pose> poses = random_walk(12, 3);
  std::vector<double> errors;
  for (int k = 0; k < 12; ++k)
    errors.push_back(0.1 + 0.03 * k);
  const int j = 2;
  const int i = 9;
  PowerConfig config;
  const auto u = [&](PowerCoefficient which) {
    config.coefficient = which;
    return power_coefficients(poses, errors, j, i, config);
  };
  const auto index = u(PowerCoefficient::kIndex);
  const auto path = u(PowerCoefficient::kPathLength);
  const auto error = u(PowerCoefficient::kMatchError);
  const auto metric = u(PowerCoefficient::kMetric);
  const auto way = [&](int from, int to) {
    double sum = 0.0;
    for (int k = from; k < to; ++k)
      sum += (poses[static_cast<std::size_t>(k) + 1].translation() -
              poses[static_cast<std::size_t>(k)].translation())
                 .norm();
    return sum;
  };
  for (int l = j; l <= i; ++l) {
    const auto at = static_cast<std::size_t>(l - j);
    EXPECT_NEAR(index[at], (l - 2) / 7.0, 1e-12);
    EXPECT_NEAR(path[at], way(j, l) / way(j, i), 1e-12);
    // e_3 .. e_l over e_3 .. e_9, with e_k = 0.1 + 0.03 k.
    const double part = (l - 2) * 0.1 + 0.03 * (l * (l + 1) / 2 - 3);
    EXPECT_NEAR(error[at], part / (7 * 0.1 + 0.03 * 42), 1e-12);
    const auto d = [&](int to) {
      const Eigen::Matrix4d m =
          poses[2].matrix().inverse() * poses[static_cast<std::size_t>(to)].matrix();
      const double theta =
          std::acos(std::clamp(0.5 * (m.topLeftCorner<3, 3>().trace() - 1.0), -1.0, 1.0));
      return std::sqrt(400.0 * theta * theta + m.block<3, 1>(0, 3).squaredNorm());
    };
    EXPECT_NEAR(metric[at], l == i ? 1.0 : d(l) / d(i), 1e-6);
  }
}

TEST(PowerCoefficients, TheScrewFindsItsOwnPoints) {
  std::mt19937 random(8);
  const Pose from = Pose::exp(random_twist(random, 1.0, 5.0));
  const Pose to = from * Pose::exp(random_twist(random, 1.0, 5.0));
  std::vector<Pose> poses;
  const std::vector<double> shares = {0.0, 0.13, 0.5, 0.42, 0.9, 1.0};
  for (const double u : shares)
    poses.push_back(interpolate(from, to, u));
  PowerConfig config;
  config.coefficient = PowerCoefficient::kScrew;
  const auto u = power_coefficients(poses, std::vector<double>(6, 0.0), 0, 5, config);
  for (std::size_t k = 0; k < u.size(); ++k)
    EXPECT_NEAR(u[k], shares[k], 1e-5);
}

TEST(PowerCoefficients, AStandstillFallsBackToTheIndex) {
  const std::vector<Pose> poses(5);
  for (const PowerCoefficient which : kAll) {
    PowerConfig config;
    config.coefficient = which;
    const auto u = power_coefficients(poses, std::vector<double>(5, 0.0), 0, 4, config);
    EXPECT_NEAR(u[2], 0.5, 1e-12);
  }
}

TEST(PowerCorrection, EndsWhereTheMatchSaysAndCarriesTheRest) {
  std::mt19937 random(4);
  for (const PowerForm form : {PowerForm::kPrinted, PowerForm::kCorrected}) {
    for (const PowerCoefficient which : kAll) {
      const std::vector<Pose> before = random_walk(15, 6);
      std::vector<Pose> after = before;
      PowerConfig config;
      config.form = form;
      config.coefficient = which;
      const Pose match =
          before[3].inverse() * before[10] * Pose::exp(random_twist(random, 0.1, 0.5));
      apply_power_correction(after, std::vector<double>(15, 0.2), 3, 10, match, config);
      for (std::size_t k = 0; k <= 3; ++k)
        expect_same(after[k], before[k]);
      expect_same(after[3].inverse() * after[10], match);
      for (std::size_t k = 11; k < 15; ++k)
        expect_same(after[10].inverse() * after[k], before[10].inverse() * before[k]);
    }
  }
}

TEST(PowerCorrection, FormsAreTheirEquations) {
  const std::vector<Pose> before = random_walk(9, 2);
  std::mt19937 random(12);
  const Pose ij = before[0].inverse() * before[8];
  const Pose match = ij * Pose::exp(random_twist(random, 0.2, 0.4));
  PowerConfig config;
  config.coefficient = PowerCoefficient::kIndex;
  for (std::size_t l = 1; l < 8; ++l) {
    const double u = static_cast<double>(l) / 8.0;
    const Pose lj = before[0].inverse() * before[l];
    config.form = PowerForm::kPrinted;
    std::vector<Pose> after = before;
    apply_power_correction(after, std::vector<double>(9, 0.0), 0, 8, match, config);
    expect_same(before[0].inverse() * after[l], lj * Pose::exp(u * (ij.inverse() * match).log()));
    config.form = PowerForm::kCorrected;
    after = before;
    apply_power_correction(after, std::vector<double>(9, 0.0), 0, 8, match, config);
    expect_same(before[0].inverse() * after[l], Pose::exp(u * (match * ij.inverse()).log()) * lj);
  }
}

// P0 section 2.2, the contractive property: angle(D^u) = u theta, |p_u| <= |p|, growing with u.
TEST(PowerCorrection, PowersContract) {
  std::mt19937 random(21);
  std::uniform_real_distribution<double> angle(0.0, M_PI);
  for (int trial = 0; trial < 300; ++trial) {
    const Pose whole =
        Pose(so3_exp(angle(random) * random_twist(random, 1.0, 1.0).head<3>().normalized()),
             random_twist(random, 1.0, 1.0).tail<3>());
    double last = 0.0;
    for (int k = 1; k <= 20; ++k) {
      const double u = k / 20.0;
      const Pose part = whole.power(u);
      EXPECT_NEAR(part.angle(), u * whole.angle(), 1e-9);
      EXPECT_LE(part.translation().norm(), whole.translation().norm() + 1e-12);
      EXPECT_GE(part.translation().norm(), last - 1e-12);
      last = part.translation().norm();
    }
  }
}

// A cabin that swings: the later view must be moved 0.3 m east. Views between look every way; the
// form as printed moves each along its own axes.
TEST(PowerCorrection, AsCorrectedItMovesSwingingViewsTheWayTheLastOneIsMoved) {
  std::vector<Pose> before;
  for (int k = 0; k <= 20; ++k)
    before.emplace_back(
        Eigen::Quaterniond(Eigen::AngleAxisd(k % 2 == 0 ? 0.0 : M_PI, Eigen::Vector3d::UnitZ())),
        Eigen::Vector3d(0.0, 0.5 * k, 0.0));
  const Pose match = Pose(Eigen::Quaterniond::Identity(), {0.3, 0.0, 0.0}) * before[20];
  PowerConfig config;
  config.coefficient = PowerCoefficient::kIndex;
  for (const PowerForm form : {PowerForm::kCorrected, PowerForm::kPrinted}) {
    config.form = form;
    std::vector<Pose> after = before;
    apply_power_correction(after, std::vector<double>(21, 0.0), 0, 20, match, config);
    for (std::size_t k = 1; k < 20; k += 2) {
      const double right = 0.3 * static_cast<double>(k) / 20.0;
      const double wrong = form == PowerForm::kPrinted ? -right : right;
      EXPECT_NEAR(after[k].translation().x(), wrong, 1e-9);
    }
  }
}

}  // namespace
}  // namespace understory
