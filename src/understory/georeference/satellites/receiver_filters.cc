#include "understory/georeference/satellites/receiver_filters.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace georeference_constants::receiver_filters;

using Eigen::Vector3d;
using Place = Eigen::Matrix<double, 7, 1>;
using PlaceSpread = Eigen::Matrix<double, 7, 7>;

// The errors of a receiver whose fixes state one metre in the mean.
struct RelativeNoise {
  ReceiverNoise noise;
  double steady_correlation_s = 600.0;
};

RelativeNoise noise_at(const Place& wanted, const ReceiverFilterConfig& config) {
  const ReceiverPriorConfig& prior = config.prior;
  const Place at = wanted.cwiseMax(-kFarthest).cwiseMin(kFarthest);
  RelativeNoise kind;
  ReceiverNoise& noise = kind.noise;
  noise.slow_sd_m = prior.overconfidence * std::exp(prior.overconfidence_log * at(0));
  noise.correlation_s = prior.correlation_s * std::exp(prior.correlation_log * at(1));
  noise.fast_sd_m = noise.slow_sd_m * prior.fast_share * std::exp(prior.fast_share_log * at(2));
  noise.steady_sd_m =
      noise.slow_sd_m * prior.steady_share * std::exp(prior.steady_share_log * at(3));
  noise.follows = std::clamp(prior.follows + prior.follows_sd * at(4), 0.0, kMostFollows);
  noise.fast_correlation_s =
      prior.fast_correlation_s * std::exp(prior.fast_correlation_log * at(5));
  kind.steady_correlation_s =
      config.steady_correlation_s * std::exp(config.steady_correlation_log * at(6));
  return kind;
}

// What one pair tells of one kind of receiver.
struct SeenErrors {
  Vector3d kept;   // of the slow, the steady and the fast error since the pair before
  Vector3d sd_m;   // of each at this pair
  double white_m;  // independent from pair to pair
};

SeenErrors seen_errors(const RelativeNoise& kind, double dt_s, double mean_stated_m,
                       double stated_m) {
  const ReceiverNoise& noise = kind.noise;
  SeenErrors seen;
  seen.kept << std::exp(-dt_s / noise.correlation_s), std::exp(-dt_s / kind.steady_correlation_s),
      std::exp(-dt_s / noise.fast_correlation_s);
  const double scale =
      mean_stated_m *
      std::pow(std::clamp(stated_m / mean_stated_m, 1.0 / kMostScale, kMostScale), noise.follows);
  seen.sd_m << scale * noise.slow_sd_m, mean_stated_m * noise.steady_sd_m, scale * noise.fast_sd_m;
  seen.white_m = kWhiteShare * seen.sd_m.z() + kLeastErrorM;
  return seen;
}

template <int Parameters, int Axes>
void predict(const SeenErrors& seen, ReceiverKind<Parameters, Axes>& kind) {
  using Kind = ReceiverKind<Parameters, Axes>;
  Eigen::Matrix<double, Kind::kStates, 1> kept;
  kept.template head<Parameters>().setOnes();
  for (int axis = 0; axis < Axes; ++axis)
    kept.template segment<3>(Parameters + 3 * axis) = seen.kept;
  kind.mean = kept.cwiseProduct(kind.mean);
  // Products of two numbers do not depend on their order: the covariance stays symmetric to the
  // bit.
  kind.covariance = kind.covariance.cwiseProduct((kept * kept.transpose()).eval());
  for (int axis = 0; axis < Axes; ++axis)
    kind.covariance.diagonal().template segment<3>(Parameters + 3 * axis).array() +=
        1.0 - seen.kept.array().square();
}

// The row of one axis over all states.
template <int Parameters, int Axes>
Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, 1> row_of(
    const FilterPair<Parameters, Axes>& pair, const SeenErrors& seen, int axis) {
  Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, 1> row;
  row.setZero();
  row.template head<Parameters>() = pair.jacobian.row(axis).transpose();
  row.template segment<3>(Parameters + 3 * axis) = seen.sd_m;
  return row;
}

// Variance of an independent error that a pair gets because it lies off; 0 where it does not. The
// logarithm of how improbable that is goes to `log_share`.
template <int Parameters, int Axes>
double extra_variance(const ReceiverKind<Parameters, Axes>& kind,
                      const FilterPair<Parameters, Axes>& pair, const SeenErrors& seen,
                      double outlier_share, double& log_share) {
  Eigen::Matrix<double, Axes, 1> off;
  Eigen::Matrix<double, Axes, Axes> spread;
  Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, Axes> rows;
  for (int axis = 0; axis < Axes; ++axis)
    rows.col(axis) = row_of(pair, seen, axis);
  off = pair.value - rows.transpose() * kind.mean;
  spread = rows.transpose() * kind.covariance * rows;
  spread.diagonal().array() += seen.white_m * seen.white_m;
  const auto log_density = [&](const Eigen::Matrix<double, Axes, Axes>& covariance) {
    return -0.5 * (off.dot(covariance.inverse() * off) + std::log(covariance.determinant()));
  };
  const double extra = off.squaredNorm() / Axes;
  const double regular = log_density(spread) + std::log1p(-outlier_share);
  spread.diagonal().array() += extra;
  const double runaway = log_density(spread) + std::log(outlier_share);
  if (runaway <= regular) {
    log_share = std::log1p(-outlier_share);
    return 0.0;
  }
  log_share = std::log(outlier_share);
  return extra;
}

// The steady error is another one from here on.
template <int Parameters, int Axes>
void jump(double variance, const SeenErrors& seen, ReceiverKind<Parameters, Axes>& kind) {
  for (int axis = 0; axis < Axes; ++axis)
    kind.covariance(Parameters + 3 * axis + 1, Parameters + 3 * axis + 1) +=
        variance / (seen.sd_m.y() * seen.sd_m.y());
}

template <int Parameters, int Axes>
void take(const FilterPair<Parameters, Axes>& pair, const SeenErrors& seen, double extra,
          ReceiverKind<Parameters, Axes>& kind) {
  for (int axis = 0; axis < Axes; ++axis) {
    const auto row = row_of(pair, seen, axis);
    const Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, 1> spread =
        kind.covariance * row;
    const double total = row.dot(spread) + seen.white_m * seen.white_m + extra;
    const double off = pair.value(axis) - row.dot(kind.mean);
    kind.log_weight -= 0.5 * (off * off / total + std::log(total));
    kind.mean += spread * (off / total);
    const Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, 1> gain =
        spread / std::sqrt(total);
    kind.covariance -= gain * gain.transpose();
  }
}

Place normal_place(Random& random) {
  Place place;
  for (double& value : place)
    value = random.normal();
  return place;
}

// A kind with other sizes of errors. The errors in metres stay.
template <int Parameters, int Axes>
void move_to(const Place& place, const ReceiverFilterConfig& config,
             ReceiverKind<Parameters, Axes>& kind) {
  const ReceiverNoise before = noise_at(kind.place, config).noise;
  kind.place = place;
  const ReceiverNoise after = noise_at(kind.place, config).noise;
  Eigen::Matrix<double, ReceiverKind<Parameters, Axes>::kStates, 1> scale;
  scale.template head<Parameters>().setOnes();
  for (int axis = 0; axis < Axes; ++axis)
    scale.template segment<3>(Parameters + 3 * axis) << before.slow_sd_m / after.slow_sd_m,
        before.steady_sd_m / after.steady_sd_m, before.fast_sd_m / after.fast_sd_m;
  kind.mean = scale.cwiseProduct(kind.mean);
  kind.covariance = kind.covariance.cwiseProduct((scale * scale.transpose()).eval());
}

template <typename Kind>
void level_weights(std::vector<Kind>& kinds) {
  double best = kinds.front().log_weight;
  for (const Kind& kind : kinds)
    best = std::max(best, kind.log_weight);
  for (Kind& kind : kinds)
    kind.log_weight -= best;
}

// Probabilities that add up to one.
template <typename Kind>
std::vector<double> weights_of(const std::vector<Kind>& kinds) {
  std::vector<double> weights;
  double best = kinds.front().log_weight;
  for (const Kind& kind : kinds)
    best = std::max(best, kind.log_weight);
  double total = 0.0;
  for (const Kind& kind : kinds) {
    weights.push_back(std::exp(kind.log_weight - best));
    total += weights.back();
  }
  for (double& weight : weights)
    weight /= total;
  return weights;
}

}  // namespace

template <int Parameters, int Axes>
ReceiverFilters<Parameters, Axes>::ReceiverFilters(const ReceiverFilterConfig& config,
                                                   const ParameterVector& sd)
    : config_(config) {
  Random random(kSeed);
  for (std::size_t i = 0; i < config.kinds; ++i) {
    Kind& kind = kinds_.emplace_back();
    kind.place = normal_place(random);
    kind.jumps = i % 2 == 0;
    kind.mean.setZero();
    kind.covariance.setIdentity();
    kind.covariance.diagonal().template head<Parameters>() = sd.cwiseAbs2();
  }
}

template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::add_walk(const ParameterMatrix& covariance) {
  for (Kind& kind : kinds_)
    kind.covariance.template topLeftCorner<Parameters, Parameters>() += covariance;
}

template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::forget_parameters(const ParameterVector& sd) {
  for (Kind& kind : kinds_) {
    kind.mean.template head<Parameters>().setZero();
    kind.covariance.template topRows<Parameters>().setZero();
    kind.covariance.template leftCols<Parameters>().setZero();
    kind.covariance.diagonal().template head<Parameters>() = sd.cwiseAbs2();
  }
}

template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::update(const FilterPair<Parameters, Axes>& pair) {
  ++pairs_;
  last_stated_ = pair.stated_sd_m;
  log_stated_ += (std::log(pair.stated_sd_m) - log_stated_) / static_cast<double>(pairs_);
  double best = -std::numeric_limits<double>::infinity();
  for (Kind& kind : kinds_) {
    const RelativeNoise noise = noise_at(kind.place, config_);
    const SeenErrors seen = seen_errors(noise, pair.dt_s, std::exp(log_stated_), pair.stated_sd_m);
    predict(seen, kind);
    double log_share = 0.0;
    double extra = extra_variance(kind, pair, seen, config_.outlier_share, log_share);
    const bool outlier = extra > 0.0;
    if (outlier && kind.jumps) {
      jump(extra, seen, kind);
      extra = 0.0;
    }
    take(pair, seen, extra, kind);
    kind.log_weight += log_share;
    if (kind.log_weight > best) {
      best = kind.log_weight;
      last_was_outlier_ = outlier;
    }
  }
  level_weights(kinds_);
  if (effective_kinds() < kRenewShare * static_cast<double>(kinds_.size())) renew();
}

template <int Parameters, int Axes>
typename ReceiverFilters<Parameters, Axes>::Told ReceiverFilters<Parameters, Axes>::parameters()
    const {
  const std::vector<double> weights = weights_of(kinds_);
  Told told{ParameterVector::Zero(), ParameterMatrix::Zero()};
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    told.mean += weights[i] * kinds_[i].mean.template head<Parameters>();
  for (std::size_t i = 0; i < kinds_.size(); ++i) {
    const ParameterVector off = kinds_[i].mean.template head<Parameters>() - told.mean;
    told.covariance +=
        weights[i] * (kinds_[i].covariance.template topLeftCorner<Parameters, Parameters>() +
                      off * off.transpose());
  }
  return told;
}

template <int Parameters, int Axes>
double ReceiverFilters<Parameters, Axes>::effective_kinds() const {
  double squares = 0.0;
  for (const double weight : weights_of(kinds_))
    squares += weight * weight;
  return 1.0 / squares;
}

template <int Parameters, int Axes>
double ReceiverFilters<Parameters, Axes>::slow_sd_m() const {
  const std::vector<double> weights = weights_of(kinds_);
  double variance = 0.0;
  for (std::size_t i = 0; i < kinds_.size(); ++i) {
    const SeenErrors seen =
        seen_errors(noise_at(kinds_[i].place, config_), 0.0, std::exp(log_stated_), last_stated_);
    variance += weights[i] * seen.sd_m.head<2>().squaredNorm();
  }
  return std::sqrt(variance);
}

// As many kinds as before, drawn by their weights. Each is moved a little towards the mean and then
// at random, so that mean and spread of all stay as they are.
template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::renew() {
  const std::vector<double> weights = weights_of(kinds_);
  Place mean = Place::Zero();
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    mean += weights[i] * kinds_[i].place;
  PlaceSpread spread = kLeastSpread * PlaceSpread::Identity();
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    spread += weights[i] * (kinds_[i].place - mean) * (kinds_[i].place - mean).transpose();
  const PlaceSpread root = spread.llt().matrixL();
  Random random(kSeed, pairs_);
  std::vector<Kind> drawn;
  drawn.reserve(kinds_.size());
  const double step = 1.0 / static_cast<double>(kinds_.size());
  double pointer = step * random.uniform();
  double sum = weights.front();
  std::size_t from = 0;
  for (std::size_t i = 0; i < kinds_.size(); ++i, pointer += step) {
    while (sum < pointer && from + 1 < kinds_.size())
      sum += weights[++from];
    Kind& kind = drawn.emplace_back(kinds_[from]);
    kind.log_weight = 0.0;
    kind.jumps = i % 2 == 0;
    const Place place = std::sqrt(1.0 - kKernel * kKernel) * (kind.place - mean) + mean +
                        kKernel * root * normal_place(random);
    move_to(place, config_, kind);
  }
  kinds_ = std::move(drawn);
}

template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::save(BinaryWriter& writer) const {
  writer.put(pairs_);
  writer.put(log_stated_);
  writer.put(last_stated_);
  writer.put(last_was_outlier_);
  for (const Kind& kind : kinds_) {
    writer.put_doubles(kind.place.data(), 7);
    writer.put(kind.log_weight);
    writer.put_doubles(kind.mean.data(), static_cast<std::size_t>(kind.mean.size()));
    for (int column = 0; column < Kind::kStates; ++column)
      writer.put_doubles(&kind.covariance(column, column),
                         static_cast<std::size_t>(Kind::kStates - column));
  }
}

template <int Parameters, int Axes>
void ReceiverFilters<Parameters, Axes>::load(BinaryReader& reader) {
  pairs_ = reader.get<std::uint64_t>();
  log_stated_ = reader.get<double>();
  last_stated_ = reader.get<double>();
  last_was_outlier_ = reader.get<bool>();
  for (Kind& kind : kinds_) {
    reader.get_doubles(kind.place.data(), 7);
    kind.log_weight = reader.get<double>();
    reader.get_doubles(kind.mean.data(), static_cast<std::size_t>(kind.mean.size()));
    for (int column = 0; column < Kind::kStates; ++column) {
      reader.get_doubles(&kind.covariance(column, column),
                         static_cast<std::size_t>(Kind::kStates - column));
      for (int row = column + 1; row < Kind::kStates; ++row)
        kind.covariance(column, row) = kind.covariance(row, column);
    }
  }
}

template class ReceiverFilters<4, 2>;
template class ReceiverFilters<3, 1>;

}  // namespace understory
