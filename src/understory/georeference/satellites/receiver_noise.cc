#include "understory/georeference/satellites/receiver_noise.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/geometry/large_solvers.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace georeference_constants::receiver_noise;

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

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
  const double left = squares - right.dot(LargeSymmetricSolver(normal).solve(right));
  return std::sqrt(std::max(1e-12, left / rows));
}

struct Solution {
  double log_likelihood = 0.0;
  VectorXd mean;
  MatrixXd covariance;
};

// Columns of numbers, a row a pair, made white together; unused ones are zero.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, kMostColumns, Eigen::RowMajor>;
using Row = Eigen::Array<double, 1, kMostColumns>;

// What is left of the slow, the steady and the fast error after a time.
Vector3d kept_after(const ReceiverNoise& noise, double step_s) {
  const double slow = std::exp(-step_s / noise.correlation_s);
  const double steady = std::exp(-step_s / noise.steady_correlation_s);
  return {slow, steady, std::exp(-step_s / noise.fast_correlation_s)};
}

// From each time to the next. Steps are far fewer than pairs of times.
std::vector<Vector3d> kept_over_steps(const NoisyTimes& times, const ReceiverNoise& noise) {
  std::vector<Vector3d> kept;
  for (std::size_t k = 1; k < times.time_s.size(); ++k)
    kept.push_back(kept_after(noise, times.time_s[k] - times.time_s[k - 1]));
  return kept;
}

// `scale` to the power `follows`.
VectorXd followed_scale(const NoisyTimes& times, double follows) {
  return (follows * times.scale.array().log()).exp();
}

// The states are the slow, the steady and the fast error, each in units of its standard deviation.
double whiten_rows(const NoisyTimes& times, const ReceiverNoise& noise, Rows& rows) {
  std::array<Row, 3> state = {Row::Zero(), Row::Zero(), Row::Zero()};
  const VectorXd scale = followed_scale(times, noise.follows);
  Vector3d kept = Vector3d::Zero();
  Matrix3d variance = Matrix3d::Identity();
  double last_step_s = -1.0;
  double logs = 0.0;
  for (Eigen::Index k = 0; k < rows.rows(); ++k) {
    if (k > 0) {
      const auto now = static_cast<std::size_t>(k);
      const double step_s = times.time_s[now] - times.time_s[now - 1];
      if (std::abs(step_s - last_step_s) > kSameStepS) kept = kept_after(noise, step_s);
      last_step_s = step_s;
      variance = kept.asDiagonal() * variance * kept.asDiagonal();
      variance.diagonal().array() += 1.0 - kept.array().square();
    }
    const Vector3d seen(scale(k) * noise.slow_sd_m, noise.steady_sd_m, scale(k) * noise.fast_sd_m);
    const Vector3d spread = variance * seen;
    const double white = kWhiteShare * seen.z();
    const double extra = times.extra_sd_m(k);
    const double total = seen.dot(spread) + white * white + extra * extra;
    const Vector3d gain = spread / total;
    Row innovation = rows.row(k).array();
    for (int i = 0; i < 3; ++i) {
      state[static_cast<std::size_t>(i)] *= kept(i);
      innovation -= seen(i) * state[static_cast<std::size_t>(i)];
    }
    for (int i = 0; i < 3; ++i)
      state[static_cast<std::size_t>(i)] += gain(i) * innovation;
    rows.row(k) = innovation / std::sqrt(total);
    variance -= gain * spread.transpose();
    logs += std::log(total);
  }
  return logs;
}

// Jacobian and residual of each series side by side.
Rows side_by_side(const std::vector<NoisySeries>& series) {
  Rows rows = Rows::Zero(series.front().residual.size(), kMostColumns);
  Eigen::Index at = 0;
  for (const NoisySeries& one : series) {
    const Eigen::Index n = one.jacobian.cols();
    UNDERSTORY_CHECK(at + n + 1 <= kMostColumns);
    rows.middleCols(at, n) = one.jacobian;
    rows.col(at + n) = one.residual;
    at += n + 1;
  }
  return rows;
}

// `rows` are the series side by side.
Solution solve_with(const NoisyTimes& times, Rows rows, const MatrixXd& information,
                    const ReceiverNoise& noise, std::size_t series) {
  const Eigen::Index n = information.cols();
  const double logs = static_cast<double>(series) * whiten_rows(times, noise, rows);
  const Eigen::Matrix<double, kMostColumns, kMostColumns> products = rows.transpose() * rows;
  MatrixXd normal = MatrixXd::Zero(n + 1, n + 1);
  for (std::size_t k = 0; k < series; ++k) {
    const Eigen::Index at = static_cast<Eigen::Index>(k) * (n + 1);
    normal += products.block(at, at, n + 1, n + 1);
  }
  Solution solution;
  const MatrixXd hessian = normal.topLeftCorner(n, n) + information;
  const LargeSymmetricSolver solver(hessian);
  solution.covariance = solver.inverse();
  solution.mean = solver.solve(normal.topRightCorner(n, 1));
  const double cost = normal(n, n) - normal.topRightCorner(n, 1).col(0).dot(solution.mean);
  const double log_hessian =
      solver.diagonal().cwiseMax(std::numeric_limits<double>::min()).array().log().sum();
  solution.log_likelihood = -0.5 * (logs + log_hessian + cost);
  return solution;
}

// The logarithms (and `follows`) of a noise in units of its prior: that is a standard normal one.
constexpr int kUnknowns = 7;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Curvature = Eigen::Matrix<double, kUnknowns, kUnknowns>;

class Posterior {
 public:
  Posterior(const NoisyTimes& times, const std::vector<NoisySeries>& series,
            const MatrixXd& information, const ReceiverPriorConfig& prior)
      : times_(times),
        series_(series),
        rows_(side_by_side(series)),
        information_(information),
        prior_(prior) {}

  // Bounded: residuals of nothing would make ever smaller errors more probable.
  [[nodiscard]] ReceiverNoise noise(const Unknowns& wanted) const {
    const Unknowns u = wanted.cwiseMax(-kFarthest).cwiseMin(kFarthest);
    ReceiverNoise noise;
    noise.slow_sd_m =
        times_.stated_sd_m * prior_.overconfidence * std::exp(prior_.overconfidence_log * u(0));
    noise.correlation_s = prior_.correlation_s * std::exp(prior_.correlation_log * u(1));
    noise.fast_sd_m = noise.slow_sd_m * prior_.fast_share * std::exp(prior_.fast_share_log * u(2));
    noise.steady_sd_m = usual_steady_m(noise.slow_sd_m) * std::exp(prior_.steady_share_log * u(3));
    noise.fast_correlation_s =
        prior_.fast_correlation_s * std::exp(prior_.fast_correlation_log * u(5));
    noise.steady_correlation_s =
        prior_.steady_correlation_s * std::exp(prior_.steady_correlation_log * u(6));
    noise.follows = std::clamp(prior_.follows + prior_.follows_sd * u(4), 0.0, kMostFollows);
    return noise;
  }
  [[nodiscard]] Unknowns unknowns(const ReceiverNoise& noise) const {
    const auto over = [](double value, double usual, double log_sd) {
      return log_sd > 0.0 ? std::log(value / usual) / log_sd : 0.0;
    };
    Unknowns u;
    u << over(noise.slow_sd_m, times_.stated_sd_m * prior_.overconfidence,
              prior_.overconfidence_log),
        over(noise.correlation_s, prior_.correlation_s, prior_.correlation_log),
        over(noise.fast_sd_m, noise.slow_sd_m * prior_.fast_share, prior_.fast_share_log),
        over(noise.steady_sd_m, usual_steady_m(noise.slow_sd_m), prior_.steady_share_log),
        prior_.follows_sd > 0.0 ? (noise.follows - prior_.follows) / prior_.follows_sd : 0.0,
        over(noise.fast_correlation_s, prior_.fast_correlation_s, prior_.fast_correlation_log),
        over(noise.steady_correlation_s, prior_.steady_correlation_s,
             prior_.steady_correlation_log);
    return u.cwiseMax(-kFarthest).cwiseMin(kFarthest);
  }
  [[nodiscard]] Solution solve(const Unknowns& u) const {
    return solve_with(times_, rows_, information_, noise(u), series_.size());
  }
  [[nodiscard]] double log_density(const Unknowns& u) const {
    return solve(u).log_likelihood - 0.5 * u.squaredNorm();
  }
  // Where slow errors alone explain the residuals of plain least squares.
  [[nodiscard]] Unknowns start() const {
    const double ratio = plain_sd_m(times_, series_, information_) / times_.stated_sd_m;
    Unknowns u = Unknowns::Zero();
    u(0) = std::clamp(std::log(ratio / prior_.overconfidence) / prior_.overconfidence_log,
                      -kFarthest, kFarthest);
    return u;
  }

 private:
  // The median of the steady error beside a slow one.
  [[nodiscard]] double usual_steady_m(double slow_sd_m) const {
    const double over = slow_sd_m / (times_.stated_sd_m * prior_.overconfidence);
    return slow_sd_m * prior_.steady_share * std::pow(over, prior_.steady_power);
  }

  const NoisyTimes& times_;
  const std::vector<NoisySeries>& series_;
  const Rows rows_;
  const MatrixXd& information_;
  const ReceiverPriorConfig& prior_;
};

// The most probable noise and the curvature of the logarithm of the density there.
struct Mode {
  Unknowns at = Unknowns::Zero();
  double log_density = 0.0;
  Curvature covariance = Curvature::Identity();
};

// One unknown after the other, to the vertex of a parabola. Steps shorten where they do not help.
void search_along_axes(const Posterior& posterior, Mode& mode) {
  double step = 1.0;
  for (int round = 0; round < kSearchRounds && step > kShortestStep; ++round) {
    const double began = mode.log_density;
    for (int axis = 0; axis < kUnknowns; ++axis) {
      const Unknowns along = step * Unknowns::Unit(axis);
      const double before = posterior.log_density(mode.at - along);
      const double after = posterior.log_density(mode.at + along);
      const double bend = before - 2.0 * mode.log_density + after;
      const double side = after > before ? kLongestStep : -kLongestStep;
      const double vertex = bend < 0.0 ? 0.5 * (before - after) / bend : side;
      Unknowns to = mode.at + std::clamp(vertex, -kLongestStep, kLongestStep) * along;
      to(axis) = std::clamp(to(axis), -kFarthest, kFarthest);
      const double there = posterior.log_density(to);
      if (there > mode.log_density) {
        mode.at = to;
        mode.log_density = there;
      }
    }
    if (mode.log_density < began + kLittle) step *= 0.5;
  }
}

// The inverse of the negative curvature. The prior bends by 1 at least; where the likelihood bends
// the other way, half of that stands.
void measure_curvature(const Posterior& posterior, Mode& mode, Unknowns* slope) {
  const double h = kCurvatureStep;
  Unknowns forward;
  Unknowns backward;
  for (int i = 0; i < kUnknowns; ++i) {
    forward(i) = posterior.log_density(mode.at + h * Unknowns::Unit(i));
    backward(i) = posterior.log_density(mode.at - h * Unknowns::Unit(i));
  }
  Curvature bend;
  for (int i = 0; i < kUnknowns; ++i) {
    bend(i, i) = -(forward(i) - 2.0 * mode.log_density + backward(i)) / (h * h);
    for (int j = 0; j < i; ++j) {
      const double both =
          posterior.log_density(mode.at + h * (Unknowns::Unit(i) + Unknowns::Unit(j)));
      bend(i, j) = bend(j, i) = -(both - forward(i) - forward(j) + mode.log_density) / (h * h);
    }
  }
  const SymmetricEigen7 axes = symmetric_eigen(bend);
  const Unknowns widths = axes.values.cwiseMax(kLeastCurvature).cwiseInverse();
  mode.covariance = axes.vectors * widths.asDiagonal() * axes.vectors.transpose();
  if (slope) *slope = (forward - backward) / (2.0 * h);
}

Mode climb(const Posterior& posterior, const Unknowns& from) {
  Mode mode;
  mode.at = from;
  mode.log_density = posterior.log_density(from);
  search_along_axes(posterior, mode);
  return mode;
}

Mode find_mode(const Posterior& posterior, const std::optional<ReceiverNoise>& near) {
  if (near) return climb(posterior, posterior.unknowns(*near));
  Mode mode;
  mode.log_density = -std::numeric_limits<double>::infinity();
  // A short slow error and a long fast one look alike: the search begins on both sides.
  for (const double correlation : kStarts) {
    Unknowns from = posterior.start();
    from(1) = correlation;
    const Mode one = climb(posterior, from);
    if (one.log_density > mode.log_density) mode = one;
  }
  return mode;
}

// The curvature at the mode, or at the top of the paraboloid there if that is higher.
void tell_curvature(const Posterior& posterior, Mode& mode) {
  Unknowns slope;
  measure_curvature(posterior, mode, &slope);
  const Unknowns to = mode.at + mode.covariance * slope;
  const double there = posterior.log_density(to);
  if (there <= mode.log_density) return;
  mode.at = to;
  mode.log_density = there;
  measure_curvature(posterior, mode, nullptr);
}

// Draws of the noise, weighted by how probable they are over how probably they are drawn.
struct Draws {
  std::vector<ReceiverNoise> noise;
  std::vector<Solution> solution;
  std::vector<double> weight;  // add up to one
};

// The mode, and draws from Student's distribution around it in pairs on both sides.
Draws draw(const Posterior& posterior, const Mode& mode) {
  const Curvature root = mode.covariance.llt().matrixL();
  Random random(kSeed);
  Draws draws;
  std::vector<double> logs;
  const auto take = [&](const Unknowns& u, double log_drawn) {
    const Solution solution = posterior.solve(u);
    const double log = solution.log_likelihood - 0.5 * u.squaredNorm() - log_drawn;
    if (!std::isfinite(log)) return;
    draws.noise.push_back(posterior.noise(u));
    draws.solution.push_back(solution);
    logs.push_back(log);
  };
  take(mode.at, 0.0);
  for (std::size_t pair = 0; pair < kDraws / 2; ++pair) {
    Unknowns z;
    double chi = 0.0;
    for (int i = 0; i < kUnknowns; ++i)
      z(i) = random.normal();
    for (int i = 0; i < kFreedom; ++i)
      chi += std::pow(random.normal(), 2.0);
    z *= std::sqrt(kFreedom / chi);
    const double log_drawn = -0.5 * (kFreedom + kUnknowns) * std::log1p(z.squaredNorm() / kFreedom);
    for (const double side : {1.0, -1.0})
      take(mode.at + side * root * z, log_drawn);
  }
  UNDERSTORY_CHECK(!logs.empty());
  const double best = *std::max_element(logs.begin(), logs.end());
  double total = 0.0;
  for (const double log : logs)
    total += std::exp(log - best);
  for (const double log : logs)
    draws.weight.push_back(std::exp(log - best) / total);
  return draws;
}

// So many draws that each stands for the same probability.
NoiseBelief resampled(const Draws& draws) {
  NoiseBelief belief;
  double until = 0.0;
  for (std::size_t k = 0; k < draws.noise.size(); ++k) {
    until += draws.weight[k] * kAveragedNoises;
    while (static_cast<double>(belief.noise.size()) + 0.5 < until)
      belief.noise.push_back(draws.noise[k]);
  }
  return belief;
}

}  // namespace

double NoiseBelief::slow_sd_m() const {
  double sum = 0.0;
  for (const ReceiverNoise& one : noise)
    sum += one.slow_sd_m * one.slow_sd_m + one.steady_sd_m * one.steady_sd_m;
  return std::sqrt(sum / static_cast<double>(noise.size()));
}

double NoiseBelief::fast_sd_m() const {
  double sum = 0.0;
  for (const ReceiverNoise& one : noise)
    sum += one.fast_sd_m * one.fast_sd_m;
  return std::sqrt(sum / static_cast<double>(noise.size()));
}

double NoiseBelief::white_fast_sd_m(double step_s) const {
  double sum = 0.0;
  for (const ReceiverNoise& one : noise) {
    const double kept = std::exp(-step_s / one.fast_correlation_s);
    sum += one.fast_sd_m * one.fast_sd_m * (1.0 + kept) / (1.0 - kept);
  }
  return std::sqrt(sum / static_cast<double>(noise.size()));
}

double NoiseBelief::correlation_s() const {
  double sum = 0.0;
  for (const ReceiverNoise& one : noise)
    sum += std::log(one.correlation_s);
  return std::exp(sum / static_cast<double>(noise.size()));
}

double NoiseBelief::relative_slow(double scale) const {
  double sum = 0.0;
  for (const ReceiverNoise& one : noise)
    sum += std::pow(std::pow(scale, one.follows) * one.slow_sd_m, 2.0) +
           one.steady_sd_m * one.steady_sd_m;
  return std::sqrt(sum / static_cast<double>(noise.size())) / slow_sd_m();
}

double whiten(const NoisyTimes& times, const ReceiverNoise& noise, MatrixXd& columns) {
  UNDERSTORY_CHECK(columns.cols() <= kMostColumns);
  Rows rows = Rows::Zero(columns.rows(), kMostColumns);
  rows.leftCols(columns.cols()) = columns;
  const double logs = whiten_rows(times, noise, rows);
  columns = rows.leftCols(columns.cols());
  return logs;
}

MatrixXd noise_covariance(const NoisyTimes& times, const NoiseBelief& belief) {
  const auto n = static_cast<Eigen::Index>(times.time_s.size());
  MatrixXd covariance = MatrixXd::Zero(n, n);
  for (const ReceiverNoise& noise : belief.noise) {
    const VectorXd scale = followed_scale(times, noise.follows);
    const VectorXd slow = noise.slow_sd_m * scale;
    const VectorXd fast = noise.fast_sd_m * scale;
    const double steady = noise.steady_sd_m * noise.steady_sd_m;
    const std::vector<Vector3d> step = kept_over_steps(times, noise);
    for (Eigen::Index i = 0; i < n; ++i) {
      covariance(i, i) +=
          slow(i) * slow(i) + steady + (1.0 + kWhiteShare * kWhiteShare) * fast(i) * fast(i);
      Vector3d kept = Vector3d::Ones();  // along a column a product of steps
      for (Eigen::Index j = i; j-- > 0;) {
        kept = kept.cwiseProduct(step[static_cast<std::size_t>(j)]);
        if (kept.maxCoeff() < kLeastCorrelation) break;
        covariance(j, i) +=
            kept.x() * slow(i) * slow(j) + kept.y() * steady + kept.z() * fast(i) * fast(j);
      }
    }
  }
  covariance /= static_cast<double>(belief.noise.size());
  covariance = covariance.selfadjointView<Eigen::Upper>();
  covariance.diagonal() += times.extra_sd_m.cwiseAbs2();
  return covariance;
}

VectorXd outliers_m(const NoisyTimes& times, const ReceiverNoise& noise,
                    const MatrixXd& residuals) {
  NoisyTimes regular = times;
  regular.extra_sd_m.setZero();
  ReceiverNoise slow = noise;
  slow.fast_sd_m = 0.0;
  const MatrixXd left = residuals - noise_covariance(regular, {{slow}}) *
                                        noise_covariance(times, {{noise}}).llt().solve(residuals);
  VectorXd extra = left.rowwise().norm();
  for (Eigen::Index k = 0; k < extra.size(); ++k) {
    const double sd_m = std::pow(times.scale(k), noise.follows) * noise.fast_sd_m;
    if (extra(k) <= kFarOff * sd_m) extra(k) = 0.0;
  }
  return extra;
}

NoisyEstimate estimate_under_noise(const NoisyTimes& times, const std::vector<NoisySeries>& series,
                                   const MatrixXd& information, const ReceiverPriorConfig& prior,
                                   const NoiseSearch& search) {
  UNDERSTORY_CHECK(!series.empty() && !times.time_s.empty());
  const Posterior posterior(times, series, information, prior);
  Mode mode = find_mode(posterior, search.near);
  NoisyEstimate estimate;
  if (!search.integrate) {
    const Solution solution = posterior.solve(mode.at);
    estimate.likeliest = posterior.noise(mode.at);
    estimate.noise = {{estimate.likeliest}};
    estimate.mean = solution.mean;
    estimate.covariance = solution.covariance;
    return estimate;
  }
  tell_curvature(posterior, mode);
  const Draws draws = draw(posterior, mode);
  estimate.noise = resampled(draws);
  const auto most = std::max_element(draws.weight.begin(), draws.weight.end());
  estimate.likeliest = draws.noise[static_cast<std::size_t>(most - draws.weight.begin())];
  estimate.mean = VectorXd::Zero(information.cols());
  for (std::size_t k = 0; k < draws.weight.size(); ++k)
    estimate.mean += draws.weight[k] * draws.solution[k].mean;
  estimate.covariance = MatrixXd::Zero(information.cols(), information.cols());
  for (std::size_t k = 0; k < draws.weight.size(); ++k) {
    const VectorXd off = draws.solution[k].mean - estimate.mean;
    estimate.covariance += draws.weight[k] * (draws.solution[k].covariance + off * off.transpose());
  }
  return estimate;
}

}  // namespace understory
