#include "understory/georeference/satellites/receiver_filters.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector4d;
using Eigen::VectorXd;

const Vector4d kSd(0.7, 0.7, 1000.0, 1000.0);

// All kinds are the one of the medians, and no pair lies off.
ReceiverFilterConfig one_kind() {
  ReceiverFilterConfig config;
  config.prior.overconfidence_log = 0.0;
  config.prior.correlation_log = 0.0;
  config.prior.fast_share_log = 0.0;
  config.prior.fast_correlation_log = 0.0;
  config.prior.steady_share_log = 0.0;
  config.prior.follows_sd = 0.0;
  config.steady_correlation_log = 0.0;
  config.outlier_share = 1e-100;
  config.kinds = 2;
  return config;
}

Vector2d antenna_at(int k) {
  return {30.0 * std::sin(0.05 * k), 0.4 * k};
}

FilterPair<4, 2> pair_at(int k, double stated_sd_m, const Vector2d& error) {
  FilterPair<4, 2> pair;
  const Vector2d p = antenna_at(k);
  const double turn = 0.8;
  pair.dt_s = k == 0 ? 0.0 : 1.0;
  pair.stated_sd_m = stated_sd_m;
  pair.jacobian << p.x(), -p.y(), 1.0, 0.0, p.y(), p.x(), 0.0, 1.0;
  pair.value = pair.jacobian * Vector4d(std::cos(turn), std::sin(turn), 12.0, -7.0) + error;
  return pair;
}

// Errors of a receiver with one slow error of `sd_m` and a fast one of a tenth.
class SlowReceiver {
 public:
  SlowReceiver(std::uint64_t seed, double sd_m, double correlation_s)
      : random_(seed), sd_m_(sd_m), kept_(std::exp(-1.0 / correlation_s)) {
    slow_ = normal();
  }
  Vector2d next() {
    slow_ = kept_ * slow_ + std::sqrt(1.0 - kept_ * kept_) * normal();
    return sd_m_ * (slow_ + 0.1 * normal());
  }

 private:
  Vector2d normal() {
    const double x = random_.normal();
    return {x, random_.normal()};
  }
  Random random_;
  double sd_m_;
  double kept_;
  Vector2d slow_;
};

// The same problem by generalised least squares, with the covariance of all errors written out.
TEST(ReceiverFilters, OneKindIsGeneralisedLeastSquares) {
  const ReceiverFilterConfig config = one_kind();
  const int pairs = 40;
  PlaneFilters filters(config, kSd);
  SlowReceiver receiver(3, 2.0, 50.0);
  MatrixXd jacobian(2 * pairs, 4);
  VectorXd value(2 * pairs);
  for (int k = 0; k < pairs; ++k) {
    const FilterPair<4, 2> pair = pair_at(k, 1.5, receiver.next());
    filters.update(pair);
    for (int axis = 0; axis < 2; ++axis) {
      jacobian.row(axis * pairs + k) = pair.jacobian.row(axis);
      value(axis * pairs + k) = pair.value(axis);
    }
  }
  const double slow_m = 1.5 * config.prior.overconfidence;
  const double fast_m = slow_m * config.prior.fast_share;
  const double steady_m = slow_m * config.prior.steady_share;
  MatrixXd covariance = MatrixXd::Zero(2 * pairs, 2 * pairs);
  for (int i = 0; i < pairs; ++i) {
    for (int j = 0; j < pairs; ++j) {
      const double dt_s = std::abs(i - j);
      double both = slow_m * slow_m * std::exp(-dt_s / config.prior.correlation_s) +
                    steady_m * steady_m * std::exp(-dt_s / config.steady_correlation_s) +
                    fast_m * fast_m * std::exp(-dt_s / config.prior.fast_correlation_s);
      if (i == j) both += std::pow(0.1 * fast_m + 0.003, 2.0);
      covariance(i, j) = covariance(pairs + i, pairs + j) = both;
    }
  }
  const MatrixXd weighted = covariance.llt().solve(jacobian);
  Eigen::Matrix4d information = jacobian.transpose() * weighted;
  information.diagonal() += kSd.cwiseAbs2().cwiseInverse();
  const Vector4d expected = information.llt().solve(weighted.transpose() * value);
  const auto told = filters.parameters();
  EXPECT_LT((told.mean - expected).norm(), 1e-6);
  EXPECT_LT((told.covariance - information.inverse()).norm() / told.covariance.norm(), 1e-6);
}

TEST(ReceiverFilters, TheSizeOfTheErrorsIsFound) {
  for (const double sd_m : {1.0, 8.0}) {
    PlaneFilters filters({}, kSd);
    SlowReceiver receiver(5, sd_m, 30.0);
    for (int k = 0; k < 600; ++k)
      filters.update(pair_at(k, 1.0, receiver.next()));
    EXPECT_GT(filters.slow_sd_m(), 0.6 * sd_m);
    EXPECT_LT(filters.slow_sd_m(), 2.5 * sd_m);
  }
}

// Receivers under trees take another set of satellites for minutes.
TEST(ReceiverFilters, AJumpOfTheReceiverMovesNothing) {
  PlaneFilters filters({}, kSd);
  SlowReceiver receiver(7, 0.5, 30.0);
  for (int k = 0; k < 300; ++k)
    filters.update(pair_at(k, 0.5, receiver.next()));
  const Vector2d before = pair_at(300, 0.5, Vector2d::Zero()).jacobian * filters.parameters().mean;
  for (int k = 300; k < 420; ++k)
    filters.update(pair_at(k, 0.5, receiver.next() + Vector2d(10.0, -4.0)));
  const Vector2d after = pair_at(300, 0.5, Vector2d::Zero()).jacobian * filters.parameters().mean;
  EXPECT_LT((after - before).norm(), 1.5);
}

TEST(ReceiverFilters, SingleWildPairsHardlyCount) {
  PlaneFilters clean({}, kSd);
  PlaneFilters wild({}, kSd);
  SlowReceiver receiver(9, 0.5, 30.0);
  for (int k = 0; k < 300; ++k) {
    const Vector2d error = receiver.next();
    clean.update(pair_at(k, 0.5, error));
    wild.update(pair_at(k, 0.5, error + (k % 25 == 24 ? Vector2d(60.0, 0.0) : Vector2d::Zero())));
  }
  const auto row = pair_at(300, 0.5, Vector2d::Zero()).jacobian;
  EXPECT_LT((row * (clean.parameters().mean - wild.parameters().mean)).norm(), 0.6);
}

TEST(ReceiverFilters, ErrorsOfTheUsualSizeAreNoOutliersAndWildOnesAre) {
  PlaneFilters filters({}, kSd);
  SlowReceiver receiver(13, 2.0, 5.0);
  int outliers = 0;
  for (int k = 0; k < 4000; ++k) {
    filters.update(pair_at(k, 2.0, receiver.next()));
    if (k >= 100) outliers += filters.last_was_outlier() ? 1 : 0;
  }
  EXPECT_LE(outliers, 4) << "of 3,900 pairs without any";
  filters.update(pair_at(4000, 2.0, receiver.next() + Vector2d(40.0, 0.0)));
  EXPECT_TRUE(filters.last_was_outlier());
}

TEST(ReceiverFilters, TheStateIsKeptToTheBit) {
  PlaneFilters filters({}, kSd);
  SlowReceiver receiver(11, 3.0, 60.0);
  for (int k = 0; k < 90; ++k)
    filters.update(pair_at(k, 1.0, receiver.next()));
  BinaryWriter saved;
  filters.save(saved);
  PlaneFilters again({}, kSd);
  BinaryReader reader(saved.bytes(), "state");
  again.load(reader);
  EXPECT_TRUE(reader.at_end());
  for (int k = 90; k < 200; ++k) {
    const FilterPair<4, 2> pair = pair_at(k, 1.0, receiver.next());
    filters.update(pair);
    again.update(pair);
  }
  BinaryWriter one;
  BinaryWriter other;
  filters.save(one);
  again.save(other);
  EXPECT_EQ(one.bytes(), other.bytes());
  EXPECT_EQ(one.bytes().size(), saved.bytes().size());  // and does not grow
}

}  // namespace
}  // namespace understory
