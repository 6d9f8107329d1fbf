#include "understory/simulation/stand/wind.h"

#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kReferenceHeight = 15.0;  // metres
constexpr double kWindSpeed = 4.0;         // at which gusts travel, m/s
constexpr double kWindAzimuth = 0.6;       // radians from east to north
constexpr double kAcross = 0.6;            // sway across the wind over that along it

// Strength of the wind, 1 on average.
double gust(double time_s) {
  return 1.0 + 0.6 * std::sin(0.31 * time_s) + 0.3 * std::sin(0.83 * time_s + 1.0);
}

// Brings the sway along the wind to a standard deviation of 1: gusts and swings are independent.
const double kUnit = 1.0 / std::sqrt(1.225 * (0.85 * 0.85 + 0.5 * 0.5) / 2.0 + 0.25 * 0.225);

}  // namespace

Wind::Sway Wind::sway_of(const GrownTree& tree) const {
  CounterNoise noise(static_cast<std::uint64_t>(tree.id), stream_of(NoiseStream::kShapes), 77);
  Sway sway;
  sway.top_m = sway_m_ * tree.height_m / kReferenceHeight;
  const double hertz = 0.0948 + 3.4317 * (100.0 * tree.dbh_m) / (tree.height_m * tree.height_m);
  sway.rate_rad_s = kTau * hertz;
  sway.lag_s =
      tree.foot.head<2>().dot(Eigen::Vector2d(std::cos(kWindAzimuth), std::sin(kWindAzimuth))) /
      kWindSpeed;
  for (double& phase : sway.phases_rad)
    phase = kTau * noise.uniform();
  return sway;
}

Eigen::Vector2d Wind::top(const Sway& sway, double time_s) {
  const double strength = gust(time_s - sway.lag_s);
  const auto swing = [&](double share, double phase) {
    return std::sin(share * sway.rate_rad_s * time_s + phase);
  };
  const auto& [a, b, c, d] = sway.phases_rad;
  const double along =
      strength * (0.85 * swing(1.0, a) + 0.5 * swing(0.91, b)) + 0.5 * (strength - 1.0);
  const double across = kAcross * strength * (0.85 * swing(1.06, c) + 0.5 * swing(0.87, d));
  const double x = std::cos(kWindAzimuth);
  const double y = std::sin(kWindAzimuth);
  return sway.top_m * kUnit * Eigen::Vector2d(x * along - y * across, y * along + x * across);
}

Eigen::Vector2d Wind::top_velocity(const Sway& sway, double time_s) {
  constexpr double kHalf = 0.01;
  return (top(sway, time_s + kHalf) - top(sway, time_s - kHalf)) / (2.0 * kHalf);
}

double stiff_height(const GrownTree& tree) {
  if (!tree.cloud.empty()) return kStiffShare * tree.height_m;
  for (const double height : tree.joints()) {
    if (height >= kStiffShare * tree.height_m) return height;
  }
  return tree.height_m;
}

}  // namespace understory
