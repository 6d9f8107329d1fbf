#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace understory {

// Errors of a receiver along one axis over time. The receiver says that some fixes are better than
// others (`NoisyTimes::scale`). An error is scale^follows * (slow + fast) + steady. All three are
// exponentially correlated (first-order Gauss-Markov processes). The steady error stands for the
// set of satellites: a receiver that changes it steps aside and stays there for minutes.
struct ReceiverNoise {
  double slow_sd_m = 1.0;       // of a pair with scale 1
  double correlation_s = 60.0;  // correlations fall to 1/e within this
  double fast_sd_m = 0.1;       // of a pair with scale 1
  double fast_correlation_s = 2.0;
  double follows = 1.0;      // 1: errors go with what the receiver states; 0: not at all
  double steady_sd_m = 0.0;  // error whose size is the same at all pairs
  double steady_correlation_s = 600.0;
};

// The prior of a receiver before its fixes are compared with a path: medians, and the
// standard deviation of the natural logarithm.
struct ReceiverPriorConfig {
  double overconfidence = 4.0;  // slow_sd_m over what the receiver states
  double overconfidence_log = 0.75;
  double correlation_s = 250.0;
  double correlation_log = 0.9;
  double fast_share = 0.25;  // fast_sd_m over slow_sd_m
  double fast_share_log = 0.4;
  double fast_correlation_s = 4.0;
  double fast_correlation_log = 0.35;
  double steady_share = 0.35;  // steady_sd_m over slow_sd_m
  double steady_share_log = 0.6;
  // That share goes with this power of the overconfidence over its median: a receiver that
  // understates its errors most does not notice wrong satellites either.
  double steady_power = 0.8;
  double steady_correlation_s = 600.0;
  double steady_correlation_log = 0.7;
  double follows = 0.9;  // mean, and standard deviation
  double follows_sd = 0.3;
};

// Noises that are equally probable.
struct NoiseBelief {
  std::vector<ReceiverNoise> noise;

  // Roots of the expected variances at a pair of scale 1, the exponential of the expected
  // logarithm, and a mean.
  [[nodiscard]] double slow_sd_m() const;  // with the steady part
  [[nodiscard]] double fast_sd_m() const;
  // Of an error that is independent from pair to pair, with pairs `step_s` apart. It tells as
  // little of a mean as the fast error does.
  [[nodiscard]] double white_fast_sd_m(double step_s) const;
  [[nodiscard]] double correlation_s() const;
  // Standard deviation of the slow and steady error of a pair with that scale, over slow_sd_m().
  [[nodiscard]] double relative_slow(double scale) const;
};

// One axis of a linear problem: residual = jacobian * parameters + noise, one row a pair.
struct NoisySeries {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
};

// When and how the pairs of all series were measured.
struct NoisyTimes {
  std::vector<double> time_s;  // in order
  Eigen::VectorXd scale;       // what the receiver states of each pair; 1 in the median
  Eigen::VectorXd extra_sd_m;  // independent errors of pairs that lie far off; 0 for the others
  double stated_sd_m = 1.0;    // what the receiver states in the median
};

// Parameters of a linear problem under noise that is estimated with them.
struct NoisyEstimate {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  // with what is not known of the noise
  NoiseBelief noise;
  ReceiverNoise likeliest;  // of those drawn
};

// Divides the columns by the square root of the noise's covariance, in place, in one pass (the
// innovations of a Kalman filter). Returns the logarithm of the covariance's determinant.
double whiten(const NoisyTimes& times, const ReceiverNoise& noise, Eigen::MatrixXd& columns);

// The covariance of the noise of all pairs, m^2, expected over the belief.
[[nodiscard]] Eigen::MatrixXd noise_covariance(const NoisyTimes& times, const NoiseBelief& belief);

// Of each pair the length of its residual (a column an axis) beside the slow and the steady errors
// that the residuals make probable. It is 0 where it is not over four standard deviations of the
// fast error. Pairs in time; metres.
[[nodiscard]] Eigen::VectorXd outliers_m(const NoisyTimes& times, const ReceiverNoise& noise,
                                         const Eigen::MatrixXd& residuals);

// How the noise is looked for.
struct NoiseSearch {
  // The search begins there, else at usual noises.
  std::optional<ReceiverNoise> near;
  // Integrates over the noises that are probable; else the most probable one counts alone.
  bool integrate = true;
};

// Generalised least squares over series that share one kind of noise. The noise is integrated out:
// restricted likelihood times prior, importance sampling around the most probable one. So few fixes
// with independent errors give a wide covariance. `information` of a Gaussian prior about zero; it
// may be singular where the series tell. Deterministic; thread-safe.
[[nodiscard]] NoisyEstimate estimate_under_noise(const NoisyTimes& times,
                                                 const std::vector<NoisySeries>& series,
                                                 const Eigen::MatrixXd& information,
                                                 const ReceiverPriorConfig& prior,
                                                 const NoiseSearch& search = {});

}  // namespace understory
