#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "understory/simulation/sensors/beam_echo.h"
#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/site.h"

namespace understory {

// A beam of a lidar, and where it looks.
struct LookingBeam {
  std::int64_t firing = 0;
  std::uint64_t beam = 0;                                // within its firing
  double time_s = 0.0;                                   // since the start of the path
  Eigen::Vector3f direction = Eigen::Vector3f::UnitX();  // world frame, unit length
};

// What winter does to a lidar (P3, "Lessons learned" and figure 6 II). There is snow that falls,
// and snow that a branch lets go. There are spurious ranges of a lidar too cold for its rating, and
// those of beams that look into the low sun. A function of beam and time alone: any order of calls
// gives the same readings.
class LidarWeather {
 public:
  LidarWeather() = default;
  LidarWeather(const LidarConfig& config, std::uint64_t seed);

  [[nodiscard]] bool has_snow() const { return snow_fall_per_m_ > 0.0 || snow_interval_s_ > 0.0; }
  // A flake in front of what the beam would have met gives the first echo, if it is strong enough.
  void add_flake_echo(std::int64_t firing, std::uint64_t beam, double time_s, BeamEcho& echo) const;

  [[nodiscard]] bool has_spurious() const { return cold_noise_ > 0.0 || sun_noise_ > 0.0; }
  // The reading that a beam gives instead of its own, out of nothing; none where all is well.
  [[nodiscard]] std::optional<BeamReading> spurious(const LookingBeam& look) const;

 private:
  [[nodiscard]] double flakes_per_m(double time_s) const;
  [[nodiscard]] double spurious_share(const LookingBeam& look) const;

  double min_range_m_ = 0.0;
  double max_range_m_ = 0.0;
  double range_10_percent_m_ = 0.0;
  double range_step_m_ = 0.0;
  double snow_fall_per_m_ = 0.0;
  double snow_interval_s_ = 0.0;
  double cold_noise_ = 0.0;
  double sun_noise_ = 0.0;
  Eigen::Vector3f to_sun_ = Eigen::Vector3f::UnitX();  // world frame, unit length
  std::uint64_t seed_ = 0;
};

}  // namespace understory
