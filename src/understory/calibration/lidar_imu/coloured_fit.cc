#include "understory/calibration/lidar_imu/coloured_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "understory/calibration/calibration_constants.h"

namespace understory {

using namespace calibration_constants::coloured_fit;

namespace {

// Columns: the residual of each axis, then its derivatives; rows: cosine and sine part of each
// frequency from 0 to half the rate.
constexpr Eigen::Index kColumns = 1 + kLidarImuParameters;
using Waves = Eigen::Matrix<double, Eigen::Dynamic, kColumns>;

// Cosines and sines of each frequency at each of `count` times.
Eigen::MatrixXd trigonometric(Eigen::Index count) {
  const auto angle = [count](Eigen::Index turn) {
    return 2.0 * std::numbers::pi * static_cast<double>(turn) / static_cast<double>(count);
  };
  Eigen::VectorXd cosines(count);
  Eigen::VectorXd sines(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    cosines[i] = std::cos(angle(i));
    sines[i] = std::sin(angle(i));
  }
  const Eigen::Index frequencies = count / 2 + 1;
  Eigen::MatrixXd table(2 * frequencies, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index f = 0; f < frequencies; ++f) {
      table(2 * f, i) = cosines[(f * i) % count];
      table(2 * f + 1, i) = sines[(f * i) % count];
    }
  }
  return table;
}

Waves waves_of(const PathResiduals& residuals, Eigen::Index axis, const Eigen::MatrixXd& table) {
  const Eigen::Index axes = residuals.axes;
  const Eigen::Index count = residuals.values.size() / axes;
  Waves signal(count, kColumns);
  for (Eigen::Index i = 0; i < count; ++i) {
    signal(i, 0) = residuals.values[axes * i + axis];
    signal.block<1, kLidarImuParameters>(i, 1) = residuals.by_step.row(axes * i + axis);
  }
  return table * signal;
}

// Mean power of the residuals of the axes at each frequency.
Eigen::VectorXd power_of(const std::vector<Waves>& axes) {
  const Eigen::Index frequencies = axes.front().rows() / 2;
  const auto number = static_cast<double>(axes.size());
  Eigen::VectorXd power = Eigen::VectorXd::Zero(frequencies);
  for (const Waves& waves : axes) {
    for (Eigen::Index f = 0; f < frequencies; ++f)
      power[f] += waves.block<2, 1>(2 * f, 0).squaredNorm() / number;
  }
  return power;
}

// The likeliest sum of the powers of white noise, of its differences and of their differences: an
// IMU's noise, a path's steps, single poses. Rounds as in noise_fit.cc; frequency 0 has no say,
// because the mean is fitted away.
Eigen::VectorXd law_of(const Eigen::VectorXd& power, Eigen::Index count) {
  const Eigen::Index used = power.size() - 1;
  Eigen::Matrix<double, Eigen::Dynamic, 3> parts(power.size(), 3);
  for (Eigen::Index f = 0; f < power.size(); ++f) {
    const double of_differences =
        2.0 - 2.0 * std::cos(2.0 * std::numbers::pi * static_cast<double>(f) /
                             static_cast<double>(count));
    parts.row(f) << 1.0, of_differences, of_differences * of_differences;
  }
  // The sum over all differences is that of the first and the last value alone, and so on: small,
  // but not nothing. Without this a signal of differences would know its mean for certain.
  const auto all = static_cast<double>(count);
  parts.row(0) << 1.0, 2.0 / all, 4.0 / all;
  const auto some = parts.bottomRows(used);
  const Eigen::ArrayXd measured = power.tail(used).array().max(kLeastPower);
  Eigen::Vector3d sizes = Eigen::Vector3d::Constant(measured.mean() / 3.0);
  for (int round = 0; round < kLawRounds; ++round) {
    const Eigen::ArrayXd law = (some * sizes).array();
    const Eigen::Vector3d more = some.transpose() * (measured / law.square()).matrix();
    const Eigen::Vector3d less = some.transpose() * law.inverse().matrix();
    sizes.array() *= (more.array() / less.array()).sqrt();
  }
  return parts * sizes;
}

// The law, corrected by how the power around each frequency differs from it.
Eigen::VectorXd smooth_power(const Eigen::VectorXd& power, Eigen::Index count) {
  const Eigen::VectorXd law = law_of(power, count);
  const Eigen::VectorXd ratio = power.cwiseQuotient(law);
  const Eigen::Index frequencies = power.size();
  const Eigen::Index reach = std::min<Eigen::Index>(kReach, (frequencies - 1) / 4);
  Eigen::VectorXd smooth(frequencies);
  for (Eigen::Index f = 0; f < frequencies; ++f) {
    const Eigen::Index low = std::max<Eigen::Index>(1, f - reach);
    const Eigen::Index high = std::min(frequencies - 1, f + reach);
    smooth[f] = law[f] * ratio.segment(low, high - low + 1).mean();
  }
  return smooth;
}

}  // namespace

void add_coloured(const PathResiduals& residuals, NormalEquations& equations) {
  const Eigen::Index count = residuals.values.size() / residuals.axes;
  const Eigen::MatrixXd table = trigonometric(count);
  std::vector<Waves> axes;
  for (Eigen::Index axis = 0; axis < residuals.axes; ++axis)
    axes.push_back(waves_of(residuals, axis, table));
  const Eigen::VectorXd power = smooth_power(power_of(axes), count);
  for (const Waves& waves : axes) {
    for (Eigen::Index f = 0; f < power.size(); ++f) {
      // Frequencies 0 and half the rate stand once in the sum over all, others twice.
      const bool alone = f == 0 || 2 * f == count;
      const double weight = (alone ? 1.0 : 2.0) / std::max(power[f], kLeastPower);
      const Eigen::Matrix<double, 2, kLidarImuParameters> by_step =
          waves.block<2, kLidarImuParameters>(2 * f, 1);
      const Eigen::Vector2d value = waves.block<2, 1>(2 * f, 0);
      equations.information.noalias() += weight * (by_step.transpose() * by_step);
      equations.gradient.noalias() += weight * (by_step.transpose() * value);
    }
  }
}

}  // namespace understory
