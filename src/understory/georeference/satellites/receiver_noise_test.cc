#include "understory/georeference/satellites/receiver_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

NoisyTimes times_of(int count, double step_s) {
  NoisyTimes times;
  for (int k = 0; k < count; ++k)
    times.time_s.push_back(step_s * k + (k > count / 2 ? 30.0 : 0.0));  // an outage in the middle
  times.scale = VectorXd::Ones(count);
  times.extra_sd_m = VectorXd::Zero(count);
  return times;
}

// Errors of one axis, drawn step by step.
VectorXd drawn(const NoisyTimes& times, const ReceiverNoise& noise, Random& random) {
  VectorXd errors(static_cast<Eigen::Index>(times.time_s.size()));
  double slow = random.normal();
  double steady = random.normal();
  double fast = random.normal();
  for (Eigen::Index k = 0; k < errors.size(); ++k) {
    if (k > 0) {
      const auto i = static_cast<std::size_t>(k);
      const double kept = std::exp(-(times.time_s[i] - times.time_s[i - 1]) / noise.correlation_s);
      slow = kept * slow + std::sqrt(1.0 - kept * kept) * random.normal();
      const double stays =
          std::exp(-(times.time_s[i] - times.time_s[i - 1]) / noise.steady_correlation_s);
      steady = stays * steady + std::sqrt(1.0 - stays * stays) * random.normal();
      const double left =
          std::exp(-(times.time_s[i] - times.time_s[i - 1]) / noise.fast_correlation_s);
      fast = left * fast + std::sqrt(1.0 - left * left) * random.normal();
    }
    errors(k) = std::pow(times.scale(k), noise.follows) *
                    (noise.slow_sd_m * slow + noise.fast_sd_m * fast) +
                noise.steady_sd_m * steady;
  }
  return errors;
}

// The filter divides by the root of the same covariance that stands in closed form.
TEST(ReceiverNoise, WhiteningIsTheInverseOfTheCovariance) {
  NoisyTimes times = times_of(40, 3.0);
  Random random(2);
  MatrixXd columns(40, 2);
  for (Eigen::Index k = 0; k < 40; ++k) {
    times.scale(k) = random.uniform(0.5, 2.0);
    times.extra_sd_m(k) = k % 7 == 0 ? 3.0 : 0.0;
    columns.row(k) << random.normal(), random.normal();
  }
  const ReceiverNoise noise{2.0, 25.0, 0.7, 2.0, 0.5, 0.8, 90.0};
  const MatrixXd covariance = noise_covariance(times, {{noise}});
  EXPECT_NEAR(covariance(3, 1),
              std::sqrt(times.scale(3) * times.scale(1)) *
                      (4.0 * std::exp(-6.0 / 25.0) + 0.49 * std::exp(-6.0 / 2.0)) +
                  0.64 * std::exp(-6.0 / 90.0),
              1e-9);
  const MatrixXd expected = columns.transpose() * covariance.ldlt().solve(columns);
  MatrixXd white = columns;
  const double logs = whiten(times, noise, white);
  EXPECT_LT((white.transpose() * white - expected).norm(), 2e-2 * expected.norm());
  EXPECT_NEAR(logs, std::log(covariance.determinant()), 2e-2);
}

// A mean under slow errors: what is stated of its error holds over many receivers, though each
// shows only a few independent errors.
TEST(ReceiverNoise, TheStatedErrorOfAMeanHoldsOverManyReceivers) {
  NoisyTimes times = times_of(300, 2.0);
  double squared = 0.0;
  double naive = 0.0;
  constexpr int kReceivers = 80;
  for (int receiver = 0; receiver < kReceivers; ++receiver) {
    Random random(static_cast<std::uint64_t>(100 + receiver));
    for (Eigen::Index k = 0; k < 300; ++k)
      times.scale(k) = std::exp(1.2 * std::sin(0.11 * static_cast<double>(k)));
    ReceiverPriorConfig prior;
    ReceiverNoise noise;
    noise.slow_sd_m = prior.overconfidence * std::exp(0.5 * random.normal());
    noise.correlation_s = 100.0 * std::exp(0.5 * random.normal());
    noise.fast_sd_m = 0.3 * noise.slow_sd_m;
    noise.follows = random.uniform(0.4, 1.2);
    noise.steady_sd_m = 0.25 * noise.slow_sd_m * std::exp(0.5 * random.normal());
    const VectorXd errors = drawn(times, noise, random);
    const NoisyEstimate estimate = estimate_under_noise(times, {{errors, MatrixXd::Ones(300, 1)}},
                                                        MatrixXd::Zero(1, 1), prior);
    squared += estimate.mean(0) * estimate.mean(0) / estimate.covariance(0, 0) / kReceivers;
    const double variance = (errors.array() - errors.mean()).square().mean() / 300.0;
    naive += errors.mean() * errors.mean() / variance / kReceivers;
  }
  EXPECT_GT(squared, 0.4);
  EXPECT_LT(squared, 1.4);
  EXPECT_GT(naive, 10.0);  // errors taken as independent promise far too much
}

// A receiver that changes its satellites steps aside and stays there, on a clearing too. The fit
// once gave such an error the correlation time of the slow one, and promised too much.
TEST(ReceiverNoise, AnErrorThatStaysOnAClearingIsPartOfWhatIsStated) {
  NoisyTimes times = times_of(250, 4.0);
  for (Eigen::Index k = 0; k < 250; ++k)
    times.scale(k) = std::exp(1.2 * std::sin(0.11 * static_cast<double>(k)));
  ReceiverPriorConfig brief;
  brief.steady_correlation_s = 40.0;
  brief.steady_correlation_log = 0.01;
  double squared = 0.0;
  double squared_brief = 0.0;
  constexpr int kReceivers = 60;
  for (int receiver = 0; receiver < kReceivers; ++receiver) {
    Random random(static_cast<std::uint64_t>(300 + receiver));
    VectorXd errors = drawn(times, {3.0, 60.0, 0.7, 3.0, 1.0, 0.0}, random);
    double step = random.normal();
    for (Eigen::Index k = 0; k < 250; ++k) {
      if (random.chance(4.0 / 800.0)) step = random.normal();
      errors(k) += step;
    }
    const std::vector<NoisySeries> series = {{errors, MatrixXd::Ones(250, 1)}};
    const auto normalised = [&](const ReceiverPriorConfig& prior) {
      const NoisyEstimate found = estimate_under_noise(times, series, MatrixXd::Zero(1, 1), prior);
      return found.mean(0) * found.mean(0) / found.covariance(0, 0) / kReceivers;
    };
    squared += normalised({});
    squared_brief += normalised(brief);
  }
  EXPECT_GT(squared, 0.4);
  EXPECT_LT(squared, 1.5);
  EXPECT_GT(squared_brief, 1.5 * squared);
}

TEST(ReceiverNoise, ASearchNearTheMostProbableNoiseStaysThere) {
  const NoisyTimes times = times_of(200, 2.0);
  Random random(11);
  const VectorXd errors = drawn(times, {2.0, 60.0, 0.4, 2.0}, random);
  const std::vector<NoisySeries> series = {{errors, MatrixXd::Ones(200, 1)}};
  const NoisyEstimate first =
      estimate_under_noise(times, series, MatrixXd::Zero(1, 1), {}, {std::nullopt, false});
  const NoisyEstimate again =
      estimate_under_noise(times, series, MatrixXd::Zero(1, 1), {}, {first.likeliest, false});
  EXPECT_NEAR(again.mean(0), first.mean(0), 0.1 * std::sqrt(first.covariance(0, 0)));
  EXPECT_EQ(again.noise.noise.size(), 1U);
}

TEST(ReceiverNoise, LearnsHowSlowTheErrorsAre) {
  const NoisyTimes times = times_of(400, 2.0);
  double before = 0.0;
  for (const double correlation_s : {15.0, 80.0}) {
    Random random(7);
    const VectorXd errors = drawn(times, {1.5, correlation_s, 0.1, 1.0}, random);
    const NoisyEstimate estimate =
        estimate_under_noise(times, {{errors, MatrixXd::Ones(400, 1)}}, MatrixXd::Zero(1, 1), {});
    EXPECT_NEAR(std::log(estimate.noise.correlation_s() / correlation_s), 0.0, 1.2);
    EXPECT_NEAR(estimate.noise.slow_sd_m(), 1.5, 1.1);
    EXPECT_GT(estimate.noise.correlation_s(), 2.0 * before);
    before = estimate.noise.correlation_s();
  }
}

// A receiver whose errors go with what it states, and one that states anything.
TEST(ReceiverNoise, LearnsWhetherErrorsGoWithWhatIsStated) {
  NoisyTimes times = times_of(400, 2.0);
  for (Eigen::Index k = 0; k < 400; ++k)
    times.scale(k) = std::exp(1.2 * std::sin(0.11 * static_cast<double>(k)));
  for (const double follows : {0.0, 1.0}) {
    Random random(8);
    const VectorXd errors = drawn(times, {2.0, 60.0, 0.4, 2.0, follows, 0.2}, random);
    const NoisyEstimate estimate =
        estimate_under_noise(times, {{errors, MatrixXd::Ones(400, 1)}}, MatrixXd::Zero(1, 1), {});
    EXPECT_NEAR(estimate.likeliest.follows, follows, 0.2);
  }
}

// Far below what any receiver states: the prior ends somewhere, the estimate does not fail.
TEST(ReceiverNoise, ResidualsOfNothingAreNoFailure) {
  const NoisyTimes times = times_of(100, 1.0);
  const NoisyEstimate estimate = estimate_under_noise(
      times, {{VectorXd::Zero(100), MatrixXd::Ones(100, 1)}}, MatrixXd::Zero(1, 1), {});
  EXPECT_EQ(estimate.mean(0), 0.0);
  EXPECT_LT(estimate.covariance(0, 0), 0.01);
}

TEST(ReceiverNoise, ARunawayIsNoSlowError) {
  const NoisyTimes times = times_of(200, 2.0);
  Random random(5);
  const ReceiverNoise noise{2.0, 100.0, 0.3, 2.0};
  VectorXd errors = drawn(times, noise, random);
  EXPECT_EQ((outliers_m(times, noise, errors).array() > 0.0).count(), 0);
  errors.segment(60, 5).array() += 20.0;
  const VectorXd found = outliers_m(times, noise, errors);
  EXPECT_GT(found.segment(60, 5).minCoeff(), 1.0);
  EXPECT_GT(found.segment(60, 5).maxCoeff(), 4.0);
  EXPECT_EQ(found.head(55).maxCoeff(), 0.0);
  EXPECT_EQ(found.tail(130).maxCoeff(), 0.0);
}

TEST(ReceiverNoise, APriorHoldsWhatTheSeriesDoNotTell) {
  const NoisyTimes times = times_of(30, 5.0);
  Random random(9);
  MatrixXd jacobian = MatrixXd::Zero(30, 2);
  jacobian.col(0).setOnes();
  MatrixXd information = MatrixXd::Zero(2, 2);
  information(1, 1) = 4.0;
  const NoisyEstimate estimate = estimate_under_noise(
      times, {{drawn(times, {1.0, 20.0, 0.2, 1.0}, random), jacobian}}, information, {});
  EXPECT_NEAR(estimate.mean(1), 0.0, 1e-9);
  EXPECT_NEAR(estimate.covariance(1, 1), 0.25, 1e-9);
}

}  // namespace
}  // namespace understory
