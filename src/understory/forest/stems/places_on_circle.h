#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace understory {

// Places on the circumference are taken so many at once.
inline constexpr Eigen::Index kTogether = 4;
using Places = Eigen::Array<double, kTogether, 1>;

// exp(x) for x <= 0 to nine digits, a quarter of the library's time: the fit is made of these.
inline Places quick_exp(const Places& x) {
  constexpr double kLog2e = 1.4426950408889634;
  constexpr double kLn2 = 0.6931471805599453;
  constexpr double kToBits = 0x1.8p52;  // its last bits count ones
  constexpr double kLeast = -60.0;      // a chance of 1e-26 counts as none
  const Places whole = (x * kLog2e + kToBits) - kToBits;
  const Places rest = x - whole * kLn2;  // at most 0.35
  Places sum = Places::Constant(1.0 / 40320.0);
  for (const double term :
       {1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0})
    sum = sum * rest + term;
  const Places bits = whole + kToBits;
  Places power;
  for (Eigen::Index i = 0; i < kTogether; ++i)
    power[i] = std::bit_cast<double>((std::bit_cast<std::uint64_t>(bits[i]) + 1023) << 52);
  return (x >= kLeast).select(sum * power, 0.0);
}

// The direction of (x, y) as a share of a turn, 0 to 1. At most 0.001 off: a sixth of the smallest
// distance between places.
inline double rough_turn(double x, double y) {
  const double along = std::abs(x);
  const double across = std::abs(y);
  const double ratio = std::min(along, across) / std::max({along, across, 1e-12});
  const double eighth = ratio * (0.9724 - 0.1919 * ratio * ratio) / (2.0 * M_PI);
  const double quarter = across > along ? 0.25 - eighth : eighth;
  const double half = x < 0.0 ? 0.5 - quarter : quarter;
  return y < 0.0 ? 1.0 - half : half;
}

}  // namespace understory
