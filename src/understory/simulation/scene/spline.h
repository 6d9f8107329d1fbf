#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "understory/util/error.h"

namespace understory {

// Uniform quintic B-spline of vectors over time: four times continuously differentiable, so that
// accelerations and jerks made from it are smooth and exact. The curve follows its control points
// closely but does not pass through them; it holds still beyond its ends.
template <int N>
class QuinticSpline {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  struct Sample {
    Vector value;
    Vector rate;          // per second
    Vector acceleration;  // per second squared
  };

  QuinticSpline() : QuinticSpline({Vector::Zero()}, 1.0) {}
  // Control point i belongs to time i * step_s; at least one.
  QuinticSpline(std::vector<Vector> controls, double step_s)
      : controls_(std::move(controls)), step_s_(step_s) {
    UNDERSTORY_CHECK(!controls_.empty() && step_s > 0.0);
  }

  [[nodiscard]] double duration_s() const {
    return static_cast<double>(controls_.size() - 1) * step_s_;
  }

  [[nodiscard]] Vector value(double time_s) const {
    double u = 0.0;
    const long first = locate(time_s, u);
    double w[6];
    weights(u, w);
    return blend(first, w);
  }

  [[nodiscard]] Sample sample(double time_s) const {
    double u = 0.0;
    const long first = locate(time_s, u);
    double w[6];
    double d[6];
    double dd[6];
    weights(u, w);
    first_derivatives(u, d);
    second_derivatives(u, dd);
    return {blend(first, w), blend(first, d) / step_s_, blend(first, dd) / (step_s_ * step_s_)};
  }

 private:
  long locate(double time_s, double& u) const {
    const double position = time_s / step_s_;
    const double cell = std::floor(position);
    u = position - cell;
    return static_cast<long>(cell) - 2;
  }

  Vector blend(long first, const double* w) const {
    const long last = static_cast<long>(controls_.size()) - 1;
    Vector sum = Vector::Zero();
    for (long i = 0; i < 6; ++i) {
      const long index = std::clamp(first + i, 0L, last);
      sum += w[i] * controls_[static_cast<std::size_t>(index)];
    }
    return sum;
  }

  static void weights(double u, double* w) {
    const double u2 = u * u;
    const double u3 = u2 * u;
    const double u4 = u3 * u;
    const double u5 = u4 * u;
    const double v = 1.0 - u;
    w[0] = v * v * v * v * v / 120.0;
    w[1] = (26.0 - 50.0 * u + 20.0 * u2 + 20.0 * u3 - 20.0 * u4 + 5.0 * u5) / 120.0;
    w[2] = (66.0 - 60.0 * u2 + 30.0 * u4 - 10.0 * u5) / 120.0;
    w[3] = (26.0 + 50.0 * u + 20.0 * u2 - 20.0 * u3 - 20.0 * u4 + 10.0 * u5) / 120.0;
    w[4] = (1.0 + 5.0 * u + 10.0 * u2 + 10.0 * u3 + 5.0 * u4 - 5.0 * u5) / 120.0;
    w[5] = u5 / 120.0;
  }

  static void first_derivatives(double u, double* w) {
    const double u2 = u * u;
    const double u3 = u2 * u;
    const double u4 = u3 * u;
    const double v = 1.0 - u;
    w[0] = -v * v * v * v / 24.0;
    w[1] = (-50.0 + 40.0 * u + 60.0 * u2 - 80.0 * u3 + 25.0 * u4) / 120.0;
    w[2] = (-120.0 * u + 120.0 * u3 - 50.0 * u4) / 120.0;
    w[3] = (50.0 + 40.0 * u - 60.0 * u2 - 80.0 * u3 + 50.0 * u4) / 120.0;
    w[4] = (5.0 + 20.0 * u + 30.0 * u2 + 20.0 * u3 - 25.0 * u4) / 120.0;
    w[5] = u4 / 24.0;
  }

  static void second_derivatives(double u, double* w) {
    const double u2 = u * u;
    const double u3 = u2 * u;
    const double v = 1.0 - u;
    w[0] = v * v * v / 6.0;
    w[1] = (40.0 + 120.0 * u - 240.0 * u2 + 100.0 * u3) / 120.0;
    w[2] = (-120.0 + 360.0 * u2 - 200.0 * u3) / 120.0;
    w[3] = (40.0 - 120.0 * u - 240.0 * u2 + 200.0 * u3) / 120.0;
    w[4] = (20.0 + 60.0 * u + 60.0 * u2 - 100.0 * u3) / 120.0;
    w[5] = u3 / 6.0;
  }

  std::vector<Vector> controls_;
  double step_s_;
};

}  // namespace understory
