#pragma once

#include <Eigen/Core>
#include <vector>

namespace understory {

// Errors of a receiver along one axis over time: a slow part, exponentially correlated, and a part
// that is independent from pair to pair. Times a scale of each pair, where the receiver says that
// one is better than another.
struct ReceiverNoise {
  double slow_sd_m = 1.0;
  double correlation_s = 60.0;  // the slow part's correlation falls to 1/e within this
  double fast_sd_m = 0.1;
};

// The prior of a receiver before its fixes are compared with a path: medians, and the
// standard deviation of the natural logarithm.
struct ReceiverPriorConfig {
  double overconfidence = 2.2;  // slow_sd_m over what the receiver states
  double overconfidence_log = 1.0;
  double correlation_s = 150.0;
  double correlation_log = 0.9;
  double fast_share = 0.25;  // fast_sd_m over slow_sd_m
  double fast_share_log = 0.9;
};

// Possible noises and how probable each is; the weights add up to one.
struct NoiseBelief {
  std::vector<ReceiverNoise> noise;
  std::vector<double> weight;

  // Root of the expected variances, and the expected logarithm's exponential.
  [[nodiscard]] double slow_sd_m() const;
  [[nodiscard]] double fast_sd_m() const;
  [[nodiscard]] double correlation_s() const;
};

// One axis of a linear problem: residual = jacobian * parameters + noise, one row a pair.
struct NoisySeries {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
};

// When and how the pairs of all series were measured.
struct NoisyTimes {
  std::vector<double> time_s;  // in order
  Eigen::VectorXd scale;       // of the noise of each pair; 1 in the median
  Eigen::VectorXd extra_sd_m;  // independent errors of pairs that lie far off; 0 for the others
  double stated_sd_m = 1.0;    // what the receiver states in the median
};

// Parameters of a linear problem under noise that is estimated with them.
struct NoisyEstimate {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  // with what is not known of the noise
  NoiseBelief noise;
};

// Divides the columns by the square root of the noise's covariance, in place, in one pass (the
// innovations of a Kalman filter). Returns the logarithm of the covariance's determinant.
double whiten(const NoisyTimes& times, const ReceiverNoise& noise, Eigen::MatrixXd& columns);

// The covariance of the noise of all pairs, m^2, expected over the belief.
[[nodiscard]] Eigen::MatrixXd noise_covariance(const NoisyTimes& times, const NoiseBelief& belief);

// Generalised least squares over series that share one kind of noise. The noise is integrated out
// over a grid around what the residuals show (restricted likelihood times prior), so few fixes with
// independent errors give a wide covariance. `information` of a Gaussian prior about zero; it may
// be singular where the series tell. Deterministic; thread-safe.
[[nodiscard]] NoisyEstimate estimate_under_noise(const NoisyTimes& times,
                                                 const std::vector<NoisySeries>& series,
                                                 const Eigen::MatrixXd& information,
                                                 const ReceiverPriorConfig& prior);

}  // namespace understory
