#include "understory/georeference/receiver_noise.h"

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
  double slow = noise.slow_sd_m * random.normal();
  for (Eigen::Index k = 0; k < errors.size(); ++k) {
    if (k > 0) {
      const auto i = static_cast<std::size_t>(k);
      const double kept = std::exp(-(times.time_s[i] - times.time_s[i - 1]) / noise.correlation_s);
      slow = kept * slow + std::sqrt(1.0 - kept * kept) * noise.slow_sd_m * random.normal();
    }
    errors(k) = times.scale(k) * (slow + noise.fast_sd_m * random.normal());
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
  const ReceiverNoise noise{2.0, 25.0, 0.7};
  const MatrixXd covariance = noise_covariance(times, {{noise}, {1.0}});
  EXPECT_NEAR(covariance(3, 1), times.scale(3) * times.scale(1) * 4.0 * std::exp(-6.0 / 25.0),
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
  const NoisyTimes times = times_of(150, 4.0);
  double squared = 0.0;
  double naive = 0.0;
  constexpr int kReceivers = 80;
  for (int receiver = 0; receiver < kReceivers; ++receiver) {
    Random random(static_cast<std::uint64_t>(100 + receiver));
    ReceiverPriorConfig prior;
    ReceiverNoise noise;
    noise.slow_sd_m = prior.overconfidence * std::exp(0.5 * random.normal());
    noise.correlation_s = 100.0 * std::exp(0.5 * random.normal());
    noise.fast_sd_m = 0.3 * noise.slow_sd_m;
    const VectorXd errors = drawn(times, noise, random);
    const NoisyEstimate estimate = estimate_under_noise(times, {{errors, MatrixXd::Ones(150, 1)}},
                                                        MatrixXd::Zero(1, 1), prior);
    squared += estimate.mean(0) * estimate.mean(0) / estimate.covariance(0, 0) / kReceivers;
    const double variance = (errors.array() - errors.mean()).square().mean() / 150.0;
    naive += errors.mean() * errors.mean() / variance / kReceivers;
  }
  EXPECT_GT(squared, 0.5);
  EXPECT_LT(squared, 1.4);
  EXPECT_GT(naive, 10.0);  // errors taken as independent promise far too much
}

TEST(ReceiverNoise, LearnsHowSlowTheErrorsAre) {
  const NoisyTimes times = times_of(400, 2.0);
  for (const double correlation_s : {5.0, 80.0}) {
    Random random(7);
    const VectorXd errors = drawn(times, {1.5, correlation_s, 0.1}, random);
    const NoisyEstimate estimate =
        estimate_under_noise(times, {{errors, MatrixXd::Ones(400, 1)}}, MatrixXd::Zero(1, 1), {});
    EXPECT_NEAR(std::log(estimate.noise.correlation_s() / correlation_s), 0.0, 0.8);
    EXPECT_NEAR(estimate.noise.slow_sd_m(), 1.5, 0.6);
  }
}

TEST(ReceiverNoise, APriorHoldsWhatTheSeriesDoNotTell) {
  const NoisyTimes times = times_of(30, 5.0);
  Random random(9);
  MatrixXd jacobian = MatrixXd::Zero(30, 2);
  jacobian.col(0).setOnes();
  MatrixXd information = MatrixXd::Zero(2, 2);
  information(1, 1) = 4.0;
  const NoisyEstimate estimate = estimate_under_noise(
      times, {{drawn(times, {1.0, 20.0, 0.2}, random), jacobian}}, information, {});
  EXPECT_NEAR(estimate.mean(1), 0.0, 1e-9);
  EXPECT_NEAR(estimate.covariance(1, 1), 0.25, 1e-9);
}

}  // namespace
}  // namespace understory
