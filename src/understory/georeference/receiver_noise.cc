#include "understory/georeference/receiver_noise.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace georeference_constants::receiver_noise;

using Eigen::MatrixXd;
using Eigen::VectorXd;

double normal_log(double value, double median, double log_sd) {
  return -0.5 * std::pow(std::log(value / median) / log_sd, 2.0);
}

// Standard deviation of the residuals after plain least squares.
double plain_sd_m(const NoisyTimes& times, const std::vector<NoisySeries>& series,
                  const MatrixXd& information) {
  const Eigen::Index parameters = information.cols();
  MatrixXd normal = 1e-9 * MatrixXd::Identity(parameters, parameters);
  VectorXd right = VectorXd::Zero(parameters);
  double squares = 0.0;
  double rows = 0.0;
  for (const NoisySeries& one : series) {
    VectorXd weight = times.scale.cwiseInverse();
    for (Eigen::Index k = 0; k < weight.size(); ++k) {
      if (times.extra_sd_m(k) > 0.0) weight(k) = 0.0;
      rows += weight(k) > 0.0 ? 1.0 : 0.0;
    }
    const MatrixXd j = weight.asDiagonal() * one.jacobian;
    const VectorXd r = weight.asDiagonal() * one.residual;
    normal += j.transpose() * j;
    right += j.transpose() * r;
    squares += r.squaredNorm();
  }
  // What the prior forbids must not explain residuals.
  const double variance = std::max(1e-12, squares / rows);
  normal += variance * information;
  const double left = squares - right.dot(normal.ldlt().solve(right));
  return std::sqrt(std::max(1e-12, left / rows));
}

struct GridPoint {
  double log_weight = 0.0;
  VectorXd mean;
  MatrixXd covariance;
};

GridPoint solve_with(const NoisyTimes& times, const std::vector<NoisySeries>& series,
                     const MatrixXd& information, const ReceiverNoise& noise) {
  const Eigen::Index n = information.cols();
  MatrixXd normal = MatrixXd::Zero(n + 1, n + 1);
  GridPoint point;
  double logs = 0.0;
  for (const NoisySeries& one : series) {
    MatrixXd columns(one.residual.size(), n + 1);
    columns << one.jacobian, one.residual;
    logs += whiten(times, noise, columns);
    normal += columns.transpose() * columns;
  }
  const MatrixXd hessian = normal.topLeftCorner(n, n) + information;
  const Eigen::LDLT<MatrixXd> solver(hessian);
  point.covariance = solver.solve(MatrixXd::Identity(n, n));
  point.mean = solver.solve(normal.topRightCorner(n, 1));
  const double cost = normal(n, n) - normal.topRightCorner(n, 1).col(0).dot(point.mean);
  const double log_hessian =
      solver.vectorD().cwiseMax(std::numeric_limits<double>::min()).array().log().sum();
  point.log_weight = -0.5 * (logs + log_hessian + cost);
  return point;
}

}  // namespace

double NoiseBelief::slow_sd_m() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < noise.size(); ++k)
    sum += weight[k] * noise[k].slow_sd_m * noise[k].slow_sd_m;
  return std::sqrt(sum);
}

double NoiseBelief::fast_sd_m() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < noise.size(); ++k)
    sum += weight[k] * noise[k].fast_sd_m * noise[k].fast_sd_m;
  return std::sqrt(sum);
}

double NoiseBelief::correlation_s() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < noise.size(); ++k)
    sum += weight[k] * std::log(noise[k].correlation_s);
  return std::exp(sum);
}

double whiten(const NoisyTimes& times, const ReceiverNoise& noise, MatrixXd& columns) {
  UNDERSTORY_CHECK(columns.cols() <= kMostColumns);
  const double slow = noise.slow_sd_m * noise.slow_sd_m;
  const double fast = noise.fast_sd_m * noise.fast_sd_m;
  std::array<double, kMostColumns> state{};
  double variance = slow;
  double logs = 0.0;
  for (Eigen::Index k = 0; k < columns.rows(); ++k) {
    double kept = 1.0;
    if (k > 0) {
      const auto now = static_cast<std::size_t>(k);
      kept = std::exp(-(times.time_s[now] - times.time_s[now - 1]) / noise.correlation_s);
      variance = kept * kept * variance + (1.0 - kept * kept) * slow;
    }
    const double scale = times.scale(k);
    const double extra = times.extra_sd_m(k) / scale;
    const double total = variance + fast + extra * extra;
    const double gain = variance / total;
    const double root = 1.0 / std::sqrt(total);
    for (Eigen::Index column = 0; column < columns.cols(); ++column) {
      double& now = state[static_cast<std::size_t>(column)];
      now *= kept;
      const double innovation = columns(k, column) / scale - now;
      columns(k, column) = innovation * root;
      now += gain * innovation;
    }
    variance *= 1.0 - gain;
    logs += std::log(total * scale * scale);
  }
  return logs;
}

MatrixXd noise_covariance(const NoisyTimes& times, const NoiseBelief& belief) {
  const auto n = static_cast<Eigen::Index>(times.time_s.size());
  MatrixXd covariance = MatrixXd::Zero(n, n);
  for (std::size_t g = 0; g < belief.noise.size(); ++g) {
    if (belief.weight[g] < kLeastWeight) continue;
    const ReceiverNoise& noise = belief.noise[g];
    const double slow = belief.weight[g] * noise.slow_sd_m * noise.slow_sd_m;
    for (Eigen::Index i = 0; i < n; ++i) {
      covariance(i, i) += slow + belief.weight[g] * noise.fast_sd_m * noise.fast_sd_m;
      // Along a row the correlation is a product of steps.
      double kept = slow;
      for (Eigen::Index j = i; j-- > 0;) {
        const auto k = static_cast<std::size_t>(j);
        kept *= std::exp(-(times.time_s[k + 1] - times.time_s[k]) / noise.correlation_s);
        if (kept < kLeastWeight * slow) break;
        covariance(i, j) += kept;
      }
    }
  }
  covariance = covariance.selfadjointView<Eigen::Lower>();
  covariance = times.scale.asDiagonal() * covariance * times.scale.asDiagonal();
  covariance.diagonal() += times.extra_sd_m.cwiseAbs2();
  return covariance;
}

NoisyEstimate estimate_under_noise(const NoisyTimes& times, const std::vector<NoisySeries>& series,
                                   const MatrixXd& information, const ReceiverPriorConfig& prior) {
  UNDERSTORY_CHECK(!series.empty() && !times.time_s.empty());
  const double plain = plain_sd_m(times, series, information);
  std::vector<GridPoint> points;
  NoisyEstimate estimate;
  double best = -std::numeric_limits<double>::infinity();
  for (const double larger : kLarger) {
    for (const double correlation_s : kCorrelationsS) {
      for (const double share : kFastShares) {
        ReceiverNoise noise;
        noise.slow_sd_m = larger * plain;
        noise.correlation_s = correlation_s;
        noise.fast_sd_m = share * noise.slow_sd_m;
        GridPoint point = solve_with(times, series, information, noise);
        point.log_weight += normal_log(noise.slow_sd_m / times.stated_sd_m, prior.overconfidence,
                                       prior.overconfidence_log) +
                            normal_log(correlation_s, prior.correlation_s, prior.correlation_log) +
                            normal_log(share, prior.fast_share, prior.fast_share_log);
        best = std::max(best, point.log_weight);
        estimate.noise.noise.push_back(noise);
        points.push_back(std::move(point));
      }
    }
  }
  double total = 0.0;
  for (const GridPoint& point : points)
    total += std::exp(point.log_weight - best);
  estimate.mean = VectorXd::Zero(information.cols());
  for (const GridPoint& point : points) {
    estimate.noise.weight.push_back(std::exp(point.log_weight - best) / total);
    estimate.mean += estimate.noise.weight.back() * point.mean;
  }
  estimate.covariance = MatrixXd::Zero(information.cols(), information.cols());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const VectorXd off = points[k].mean - estimate.mean;
    estimate.covariance +=
        estimate.noise.weight[k] * (points[k].covariance + off * off.transpose());
  }
  return estimate;
}

}  // namespace understory
