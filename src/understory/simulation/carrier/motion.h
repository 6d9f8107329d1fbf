#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/simulation/carrier/carrier.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

// What the plans of the different carriers are made of.
namespace understory::motion {

constexpr double kStep = 0.05;  // seconds between control points of the path

// From 0 to 1 with two continuous derivatives.
inline double ease(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * (t * (6.0 * t - 15.0) + 10.0);
}

// A smooth random function of time with frequencies of a band, standard deviation 1.
class Wander {
 public:
  Wander(Random& random, double low_hz, double high_hz) {
    for (Wave& wave : waves_) {
      wave.frequency = low_hz * std::pow(high_hz / low_hz, random.uniform());
      wave.phase = random.uniform(0.0, kTau);
    }
  }
  [[nodiscard]] double at(double time_s) const {
    double sum = 0.0;
    for (const Wave& wave : waves_)
      sum += std::sin(kTau * wave.frequency * time_s + wave.phase);
    return sum * std::sqrt(2.0 / std::size(waves_));
  }

 private:
  struct Wave {
    double frequency = 0.0;
    double phase = 0.0;
  };
  Wave waves_[6];
};

// A quantity that rests at values and eases from one to the next.
class Moves {
 public:
  void add(double start_s, double duration_s, double target) {
    moves_.push_back({start_s, duration_s, target});
  }
  [[nodiscard]] double at(double time_s) const {
    double value = 0.0;
    for (const Move& move : moves_) {
      if (time_s <= move.start_s) break;
      value += (move.target - value) * ease((time_s - move.start_s) / move.duration_s);
    }
    return value;
  }

 private:
  struct Move {
    double start_s;
    double duration_s;
    double target;
  };
  std::vector<Move> moves_;  // in order, not overlapping
};

// Seconds of a turn that begins and ends at rest with the peak rate given; half a second at least.
inline double turn_time(double angle_rad, double peak_rate_deg_s) {
  return std::max(0.5, 1.875 * std::abs(angle_rad) / (peak_rate_deg_s * kDegree));
}

// Heading against that of the route at the start, radians. `first_turn_deg` are turned until half a
// second before the carrier leaves, at an even rate but for half a second at both ends.
inline double first_turn(const CarrierConfig& c, double t) {
  constexpr double kRampS = 0.5;
  const double angle = c.first_turn_deg * kDegree;
  const double turning = std::max(kRampS, std::abs(c.first_turn_deg) / c.first_turn_rate_deg_s);
  const double left = std::clamp(c.still_s - kRampS - t, 0.0, turning + kRampS);
  // The way that is left at rate 1: a ramp, an even part, a ramp.
  const double last = std::min(left, kRampS);
  const double first = std::max(0.0, left - turning);
  const double way =
      0.5 * last * last / kRampS + std::max(0.0, left - kRampS) - 0.5 * first * first / kRampS;
  return -angle * way / turning;
}

// Steps of a path of that duration.
inline std::size_t steps_of(double duration_s) {
  return static_cast<std::size_t>(std::ceil(duration_s / kStep)) + 4;
}

// Rocking after a jolt: damped at about 1 Hz.
inline double rocking(const std::vector<double>& jolts_s, double t) {
  double sum = 0.0;
  for (const double jolt : jolts_s) {
    const double age = t - jolt;
    if (age <= 0.0 || age > 6.0) continue;
    sum += ease(age / 0.25) * std::exp(-age / 1.1) * std::sin(kTau * 0.9 * age);
  }
  return sum;
}

// Where a vehicle of the given length and width lies on the ground: height of its middle, pitch and
// roll (radians) towards a heading.
struct Lie {
  double height_m = 0.0;
  double pitch = 0.0;
  double roll = 0.0;
};
inline Lie lie_on(const Terrain& terrain, const Eigen::Vector2d& place, double heading,
                  double length_m, double width_m, double wheel_m) {
  const Eigen::Vector2d along(std::cos(heading), std::sin(heading));
  const Eigen::Vector2d across(-along.y(), along.x());
  const auto ground = [&](const Eigen::Vector2d& p) {
    return terrain.smooth_height(p.x(), p.y(), wheel_m);
  };
  const double front = ground(place + 0.5 * length_m * along);
  const double back = ground(place - 0.5 * length_m * along);
  const double left = ground(place + 0.5 * width_m * across);
  const double right = ground(place - 0.5 * width_m * across);
  return {0.25 * (front + back + left + right), -std::atan2(front - back, length_m),
          std::atan2(left - right, width_m)};
}

// The path of one kind of carrier along a route, from rest to rest; deterministic in the seed.
[[nodiscard]] CarrierPlan plan_thinning(const SiteConfig& config, const Route& route,
                                        const Terrain& terrain, const Stand& stand);
// The flight along a route; deterministic in the seed.
[[nodiscard]] CarrierPlan plan_uav(const SiteConfig& config, const Route& route,
                                   const Terrain& terrain);
// The flight with the sensor on a line below the drone; deterministic in the seed.
[[nodiscard]] CarrierPlan plan_sleigh(const SiteConfig& config, const Route& route,
                                      const Terrain& terrain);

}  // namespace understory::motion
