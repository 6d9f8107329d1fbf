#include "understory/simulation/sensors/weather.h"

#include <algorithm>
#include <cmath>

#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kSnowDrop = 3.0;       // seconds that a load of snow takes to come down
constexpr double kSnowDropPerM = 0.03;  // flakes in a metre of beam then
constexpr float kFlakeEnergy = 0.06F;   // of a large flake, as reflectivity x share of the beam
constexpr double kColdSpell = 0.25;     // seconds that a laser malfunctions at a time
constexpr double kColdShare = 0.4;      // of its beams that give a spurious range in that time
constexpr double kSunSpread = 0.12;     // radians off the sun at which the glare has fallen to 0.6
constexpr double kSunReach = 4.0;       // of these, beyond which there is no glare
constexpr double kSpuriousReach = 0.6;  // share of the longest range up to which ranges are given

}  // namespace

LidarWeather::LidarWeather(const LidarConfig& config, std::uint64_t seed)
    : min_range_m_(config.min_range_m),
      max_range_m_(config.max_range_m),
      range_10_percent_m_(config.range_10_percent_m),
      range_step_m_(config.range_step_m),
      snow_fall_per_m_(config.snow_fall_per_m),
      snow_interval_s_(config.snow_drop_interval_s),
      cold_noise_(config.cold_noise),
      sun_noise_(config.sun_noise),
      seed_(seed) {
  const double azimuth = config.sun_azimuth_deg * kDegree;
  const double elevation = config.sun_elevation_deg * kDegree;
  to_sun_ = Eigen::Vector3d(std::cos(elevation) * std::sin(azimuth),
                            std::cos(elevation) * std::cos(azimuth), std::sin(elevation))
                .cast<float>();
}

// Flakes in a metre of beam at a time: the fall of snow, and for a few seconds what a branch lets
// go nearby.
double LidarWeather::flakes_per_m(double time_s) const {
  if (snow_interval_s_ <= 0.0) return snow_fall_per_m_;
  const double share = time_s / snow_interval_s_;
  CounterNoise noise(seed_ + 7, static_cast<std::uint64_t>(std::max(0.0, share)), 0);
  const double begin = std::floor(share) * snow_interval_s_ +
                       noise.uniform() * std::max(0.0, snow_interval_s_ - kSnowDrop);
  const bool drops = time_s >= begin && time_s < begin + kSnowDrop;
  return snow_fall_per_m_ + (drops ? kSnowDropPerM : 0.0);
}

// Whether a flake is strong enough is settled as for any other echo.
void LidarWeather::add_flake_echo(std::int64_t firing, std::uint64_t beam, double time_s,
                                  BeamEcho& echo) const {
  const double per_m = flakes_per_m(time_s);
  if (per_m <= 0.0) return;
  CounterNoise noise(seed_ + 6, static_cast<std::uint64_t>(firing), beam);
  const double range = min_range_m_ - std::log(1.0 - noise.uniform()) / per_m;
  const double reach = echo.surface == Surface::kNone ? max_range_m_ : echo.range_m;
  if (range >= reach) return;
  BeamEcho flake;
  flake.range_m = static_cast<float>(range);
  flake.energy = kFlakeEnergy * noise.uniform();
  flake.surface = Surface::kSnow;
  // Too weak a flake lets the beam pass.
  const double signal = 10.0 * flake.energy * std::pow(range_10_percent_m_ / range, 2.0);
  if (signal > 1.0) echo = flake;
}

// A cold laser malfunctions for a spell at a time, each laser by itself; `cold_noise` is the mean
// over spells. The glare falls off with the angle to the sun as a normal distribution does.
double LidarWeather::spurious_share(const LookingBeam& look) const {
  double share = 0.0;
  if (cold_noise_ > 0.0) {
    const auto spell = static_cast<std::uint64_t>(std::max(0.0, look.time_s / kColdSpell));
    CounterNoise noise(seed_ + 9, spell, look.beam);
    if (noise.uniform() * kColdShare < cold_noise_) share = kColdShare;
  }
  if (sun_noise_ > 0.0) {
    const double off = std::acos(std::clamp(double(look.direction.dot(to_sun_)), -1.0, 1.0));
    const double spreads = off / kSunSpread;
    if (spreads < kSunReach)
      share = std::max(share, sun_noise_ * std::exp(-0.5 * spreads * spreads));
  }
  return share;
}

std::optional<BeamReading> LidarWeather::spurious(const LookingBeam& look) const {
  const double share = spurious_share(look);
  if (share <= 0.0) return std::nullopt;
  CounterNoise noise(seed_ + 10, static_cast<std::uint64_t>(look.firing), look.beam);
  if (!(noise.uniform() < share)) return std::nullopt;
  const double range =
      min_range_m_ + noise.uniform() * std::max(0.0, kSpuriousReach * max_range_m_ - min_range_m_);
  const double step = std::max(range_step_m_, 1e-4);
  return BeamReading{static_cast<float>(std::round(range / step) * step),
                     std::round(1.0F + 24.0F * noise.uniform())};
}

}  // namespace understory
