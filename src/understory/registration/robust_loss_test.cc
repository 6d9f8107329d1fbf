#include "understory/registration/robust_loss.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr std::array kAll = {LossKind::kNone,    LossKind::kHuber,        LossKind::kTukey,
                             LossKind::kCauchy,  LossKind::kGemanMcClure, LossKind::kWelsch,
                             LossKind::kTrimmed, LossKind::kVarTrimmed};

// The weight is the derivative of the loss by the squared residual.
TEST(RobustLoss, WeightsAreTheDerivativesOfTheLoss) {
  for (const LossKind kind : kAll) {
    const RobustLoss loss(kind, 0.49);
    for (const double squared : {0.01, 0.2, 0.48, 0.6, 3.0, 40.0}) {
      const double h = 1e-6;
      const double slope = (loss.at(squared + h).loss - loss.at(squared - h).loss) / (2.0 * h);
      EXPECT_NEAR(loss.at(squared).weight, slope, 1e-6) << static_cast<int>(kind) << " " << squared;
    }
    EXPECT_EQ(loss.at(0.0).loss, 0.0);
    EXPECT_EQ(loss.at(0.0).weight, 1.0);
    EXPECT_GE(loss.of_unmatched(100.0), loss.at(99.0).loss - 1e-12);
  }
}

// The weights as the literature prints them, by the residual r and the scale c.
TEST(RobustLoss, WeightsAreThoseOfTheLiterature) {
  const double c = 0.7;
  for (const double r : {0.1, 0.69, 0.71, 2.0}) {
    const auto weight = [&](LossKind kind) { return RobustLoss(kind, c * c).at(r * r).weight; };
    EXPECT_NEAR(weight(LossKind::kHuber), r <= c ? 1.0 : c / r, 1e-12);
    EXPECT_NEAR(weight(LossKind::kTukey), r <= c ? std::pow(1.0 - std::pow(r / c, 2), 2) : 0.0,
                1e-12);
    EXPECT_NEAR(weight(LossKind::kCauchy), 1.0 / (1.0 + std::pow(r / c, 2)), 1e-12);
    EXPECT_NEAR(weight(LossKind::kGemanMcClure), std::pow(1.0 + std::pow(r / c, 2), -2), 1e-12);
    EXPECT_NEAR(weight(LossKind::kWelsch), std::exp(-std::pow(r / c, 2)), 1e-12);
    EXPECT_EQ(weight(LossKind::kTrimmed), r <= c ? 1.0 : 0.0);
  }
}

std::vector<float> normal_squares(double sigma, std::size_t n, std::uint64_t seed) {
  Random random(seed);
  std::vector<float> squared(n);
  for (float& value : squared)
    value = static_cast<float>(std::pow(random.normal() * sigma, 2));
  return squared;
}

// Of normal residuals the scale is their standard deviation times the constant of the loss, also
// with a third of them far astray. Without the estimate it is the setting.
TEST(RobustLoss, TheScaleFollowsTheResiduals) {
  std::vector<float> squared = normal_squares(0.05, 20000, 1);
  const auto huber = [&](bool estimate) {
    // Far out the weight is scale / residual.
    return 1e3 * fitted_loss(squared, 0.3, {LossKind::kHuber, estimate, 0.8}).at(1e6).weight;
  };
  EXPECT_NEAR(huber(true), 1.345 * 0.05, 0.002);
  EXPECT_NEAR(huber(false), 0.3, 1e-12);
  squared.resize(30000, 4.0F);
  EXPECT_LT(huber(true), 2.0 * 1.345 * 0.05);
  EXPECT_NEAR(fitted_loss({}, 0.3, {LossKind::kHuber, true, 0.8}).at(1e6).weight, 0.3e-3, 1e-12);
}

TEST(RobustLoss, TheConstantsGive95PercentEfficiency) {
  // Asymptotic efficiency (E psi')^2 / E psi^2, by sums over the normal density.
  const auto efficiency = [](const RobustLoss& loss) {
    double slope = 0.0;
    double square = 0.0;
    for (double x = -9.0; x < 9.0; x += 1e-3) {
      const double density = std::exp(-0.5 * x * x);
      const auto psi = [&](double at) { return at * loss.at(at * at).weight; };
      slope += density * (psi(x + 1e-4) - psi(x - 1e-4)) / 2e-4;
      square += density * psi(x) * psi(x);
    }
    return slope * slope / (square * std::sqrt(2.0 * 3.14159265358979) * 1000.0);
  };
  for (const LossKind kind : {LossKind::kHuber, LossKind::kTukey, LossKind::kCauchy,
                              LossKind::kGemanMcClure, LossKind::kWelsch}) {
    // One residual of the median of unit normal ones gives the width itself.
    const float median = static_cast<float>(std::pow(1.0 / 1.4826, 2));
    const RobustLoss loss = fitted_loss({median}, 1.0, {kind, true, 0.8});
    EXPECT_NEAR(efficiency(loss), 0.95, 0.003) << static_cast<int>(kind);
  }
}

TEST(RobustLoss, TrimmedSetsKeepTheSmallest) {
  std::vector<float> squared;
  for (int i = 1; i <= 100; ++i)
    squared.push_back(static_cast<float>(i));
  EXPECT_NEAR(fitted_loss(squared, 1.0, {LossKind::kTrimmed, false, 0.6}).of_unmatched(0.0), 60.0,
              1.01);
  // Three quarters fit and a quarter is far off: the share finds the gap.
  std::vector<float> mixed = normal_squares(0.02, 3000, 2);
  mixed.resize(4000, 1.0F);
  const double limit =
      fitted_loss(mixed, 1.0, {LossKind::kVarTrimmed, false, 0.8}).of_unmatched(0.0);
  EXPECT_LT(limit, 0.9);
  EXPECT_GT(limit, 0.02 * 0.02);
}

}  // namespace
}  // namespace understory
