#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/georeference/satellites/receiver_noise.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// The prior of a receiver's errors for the filters below. It is ReceiverPriorConfig with the
// correlation time of the steady error [tuned: the four GNSS presets of
// docs/method/georeference.md, seeds up to 19].
struct ReceiverFilterConfig {
  ReceiverPriorConfig prior{.steady_share = 0.5, .steady_share_log = 0.9};
  double steady_correlation_s = 1500.0;
  double steady_correlation_log = 0.8;  // standard deviation of its natural logarithm
  double outlier_share = 0.01;          // of pairs that lie off for no reason of the model
  std::size_t kinds = 256;              // of receivers that are followed side by side
};

// One pair of antenna and fix: value = jacobian * parameters + error, one row an axis.
template <int Parameters, int Axes>
struct FilterPair {
  double dt_s = 0.0;         // since the pair before; 0 for the first
  double stated_sd_m = 1.0;  // of one axis, as the receiver says
  Eigen::Matrix<double, Axes, Parameters> jacobian;
  Eigen::Matrix<double, Axes, 1> value;
};

// One kind of receiver, and what the pairs say if it is of that kind. States: the parameters, then
// for each axis the slow, the steady and the fast error in units of their standard deviations.
template <int Parameters, int Axes>
struct ReceiverKind {
  static constexpr int kStates = Parameters + 3 * Axes;
  Eigen::Matrix<double, 7, 1> place;  // of its errors, in standard deviations of the prior
  bool jumps = false;  // a pair that lies far off shows another steady error; else it is alone
  double log_weight = 0.0;
  Eigen::Matrix<double, kStates, 1> mean;
  Eigen::Matrix<double, kStates, kStates> covariance;
};

// Kalman filters side by side, one for each kind of receiver that is thinkable before the first
// pair. The pairs tell the parameters of a linear problem and which kinds are probable. Kinds that
// are not make room for others that are like the probable ones. Memory and the work on a pair do
// not grow with the number of pairs. Deterministic; not thread-safe. Liu and West (2001), "Combined
// parameter and state estimation in simulation-based filtering".
template <int Parameters, int Axes>
class ReceiverFilters {
 public:
  using Kind = ReceiverKind<Parameters, Axes>;
  using ParameterVector = Eigen::Matrix<double, Parameters, 1>;
  using ParameterMatrix = Eigen::Matrix<double, Parameters, Parameters>;

  // `sd`: of the parameters, which are independent about zero, before the first pair.
  ReceiverFilters(const ReceiverFilterConfig& config, const ParameterVector& sd);

  // The parameters walk: their covariance grows.
  void add_walk(const ParameterMatrix& covariance);
  // Nothing is known any more of the parameters; what is known of the receiver stays.
  void forget_parameters(const ParameterVector& sd);
  void update(const FilterPair<Parameters, Axes>& pair);

  [[nodiscard]] const std::vector<Kind>& kinds() const { return kinds_; }
  // Mean and covariance of the parameters, over all kinds.
  struct Told {
    ParameterVector mean;
    ParameterMatrix covariance;
  };
  [[nodiscard]] Told parameters() const;
  // Of how many kinds one speaks in effect: the inverse of the sum of squared weights.
  [[nodiscard]] double effective_kinds() const;
  // Whether the last pair lay off by more than the most probable kind can explain.
  [[nodiscard]] bool last_was_outlier() const { return last_was_outlier_; }
  // Standard deviation of the slow and steady errors together, for what is stated of the last pair.
  [[nodiscard]] double slow_sd_m() const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  void renew();

  ReceiverFilterConfig config_;
  std::vector<Kind> kinds_;
  std::uint64_t pairs_ = 0;
  double log_stated_ = 0.0;  // mean of the logarithms of what was stated
  double last_stated_ = 1.0;
  bool last_was_outlier_ = false;
};

// Heading and place in the plane: cosine and sine of the turn, shift east and north.
using PlaneFilters = ReceiverFilters<4, 2>;
// Height: shift up, slope along x and along y.
using HeightFilters = ReceiverFilters<3, 1>;

}  // namespace understory
