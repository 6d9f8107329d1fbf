#include "understory/calibration/imu_noise/noise_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/calibration/calibration_constants.h"
#include "understory/util/error.h"

namespace understory {

using namespace calibration_constants::noise_fit;

namespace {

constexpr double kPi = std::numbers::pi;

// What is fitted: variances at averaging times, and how many degrees of freedom each has.
struct Variances {
  Eigen::VectorXd times;
  Eigen::VectorXd measured;
  Eigen::VectorXd freedoms;
  Eigen::Matrix<double, Eigen::Dynamic, 3> by_square;  // by the squares of the figures
};

Variances variances_of(const std::vector<AllanPoint>& curve, double duration_s) {
  std::vector<AllanPoint> used;
  for (const AllanPoint& point : curve) {
    if (point.time_s >= kShortestTimeS && point.deviation > 0.0) used.push_back(point);
  }
  UNDERSTORY_CHECK(used.size() >= 3);
  const auto count = static_cast<Eigen::Index>(used.size());
  Variances all{Eigen::VectorXd(count), Eigen::VectorXd(count), Eigen::VectorXd(count),
                Eigen::Matrix<double, Eigen::Dynamic, 3>(count, 3)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const AllanPoint& point = used[static_cast<std::size_t>(i)];
    all.times[i] = point.time_s;
    all.measured[i] = point.deviation * point.deviation;
    all.freedoms[i] = std::max(1.0, duration_s / point.time_s - 1.0);
    all.by_square.row(i) = allan_variances_of_unit_noise(point.time_s);
  }
  return all;
}

// The squares of the figures. Each round multiplies them by a root: how much the likelihood asks
// for more, over how much it asks for less. The likelihood grows, and none becomes negative.
Eigen::Vector3d likeliest_squares(const Variances& all) {
  Eigen::Vector3d squares;
  for (int k = 0; k < 3; ++k)
    squares[k] = (all.measured.array() / all.by_square.col(k).array()).minCoeff();
  for (int round = 0; round < kMostRounds; ++round) {
    const Eigen::ArrayXd model = (all.by_square * squares).array();
    const Eigen::ArrayXd less = all.freedoms.array() / model;
    const Eigen::ArrayXd more = less * all.measured.array() / model;
    const Eigen::Array3d factor = ((all.by_square.transpose() * more.matrix()).array() /
                                   (all.by_square.transpose() * less.matrix()).array())
                                      .sqrt();
    const Eigen::Vector3d next = squares.array() * factor;
    // A part that dies away changes for ever by its share, but not the curve.
    const double change = ((all.by_square * (next - squares)).array().abs() / model).maxCoeff();
    squares = next;
    if (change < kConverged) break;
  }
  return squares;
}

// Share of a signal's power at frequency f that passes into the difference of two means, halved.
double passed(double frequency, double time_s) {
  const double x = kPi * frequency * time_s;
  return 2.0 * std::pow(std::sin(x), 4.0) / (x * x);
}

// Covariance of the measured variances where the squares are the true ones. They are means of
// products of Gaussian signals, so it is the integral over the product of their spectra.
Eigen::MatrixXd covariance_of(const Variances& all, const Eigen::Vector3d& squares,
                              double duration_s) {
  const Eigen::Index count = all.times.size();
  const double low = std::log(0.01 / duration_s);
  const double step = (std::log(20.0 / all.times[0]) - low) / kFrequencies;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd share(count);
  for (int k = 0; k < kFrequencies; ++k) {
    const double f = std::exp(low + (k + 0.5) * step);
    const double omega = 2.0 * kPi * f;
    const double power = squares[0] + squares[1] / omega + squares[2] / (omega * omega);
    for (Eigen::Index i = 0; i < count; ++i)
      share[i] = passed(f, all.times[i]);
    sum += share * share.transpose() * (power * power * f * step);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      const double longest = std::max(all.times[i], all.times[j]);
      sum(i, j) *= 4.0 / std::max(longest, duration_s - 2.0 * longest);
    }
  }
  return sum;
}

NoiseFigure figure_of(double square, double square_sd) {
  NoiseFigure figure;
  figure.value = std::sqrt(square);
  figure.sd = square > 0.0 ? 0.5 * square_sd / figure.value : 0.0;
  figure.found = square > kFoundSigmas * square_sd;
  figure.limit = std::sqrt(square + kFoundSigmas * square_sd);
  return figure;
}

}  // namespace

Eigen::RowVector3d allan_variances_of_unit_noise(double time_s) {
  return {1.0 / time_s, 2.0 * std::numbers::ln2 / kPi, time_s / 3.0};
}

double fitted_deviation(const AxisNoise& noise, double time_s) {
  const Eigen::Vector3d figures(noise.white.value, noise.instability.value, noise.walk.value);
  return std::sqrt(allan_variances_of_unit_noise(time_s).dot(figures.cwiseAbs2()));
}

AxisNoise fit_noise(const std::vector<AllanPoint>& curve, double duration_s) {
  const Variances all = variances_of(curve, duration_s);
  const Eigen::Vector3d squares = likeliest_squares(all);
  // The fit is where weighted residuals are orthogonal to the parts: errors of the variances go
  // into the squares by that.
  const Eigen::VectorXd model = all.by_square * squares;
  const Eigen::VectorXd weights = all.freedoms.array() / model.array().square();
  const Eigen::Matrix<double, 3, Eigen::Dynamic> weighted =
      all.by_square.transpose() * weights.asDiagonal();
  // Parts differ by powers of the time: scaled to their sizes, the matrix has an inverse.
  const Eigen::Vector3d scale = (weighted * all.by_square).diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix3d normal =
      scale.asDiagonal() * (weighted * all.by_square).eval() * scale.asDiagonal();
  const Eigen::Matrix<double, 3, Eigen::Dynamic> into =
      scale.asDiagonal() * normal.inverse() * scale.asDiagonal() * weighted;
  const Eigen::Matrix3d covariance =
      into * covariance_of(all, squares, duration_s) * into.transpose();
  const Eigen::Vector3d sd = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return {figure_of(squares[0], sd[0]), figure_of(squares[1], sd[1]), figure_of(squares[2], sd[2])};
}

}  // namespace understory
