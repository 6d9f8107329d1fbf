#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/simulation/site.h"
#include "understory/util/time.h"

namespace understory {

// One laser of a spinning lidar.
struct Beam {
  double elevation_rad = 0.0;
  double azimuth_offset_rad = 0.0;  // counted like the azimuth, against the sensor's encoder
  double delay_ns = 0.0;            // after the start of the firing
  std::uint16_t ring = 0;           // from the lowest up
};

// When and where a spinning lidar measures. Firings follow each other without pause, each with all
// beams in the order in which they fire. The head turns clockwise (seen from above) and begins its
// revolutions facing backwards.
struct LidarModel {
  std::vector<Beam> beams;
  double firing_ns = 0.0;  // from one firing to the next
  double revolution_ns = 0.0;
  double beam_origin_m = 0.0;  // of the beams, off the axis of rotation
  bool beams_at_once = false;  // all delays are zero
  double half_fov_rad = 0.0;
  // A pattern that does not repeat: all beams swing up and down at an even rate while the head
  // turns, so many times a second. 0: each beam keeps its elevation.
  double swing_hz = 0.0;
  double swing_low_rad = 0.0;
  double swing_high_rad = 0.0;

  [[nodiscard]] bool swings() const { return swing_hz > 0.0; }
  // Of a beam at a time since the start of the first revolution.
  [[nodiscard]] double elevation(std::size_t beam, double time_ns) const;
  // Azimuth of the head at a time since the start of the first revolution. Radians from the
  // sensor's x axis, anticlockwise, in [-pi, pi].
  [[nodiscard]] double azimuth(double time_ns) const;
  // Firings of revolution `scan` that look into the field of view: [first, end).
  struct Firings {
    std::int64_t first = 0;
    std::int64_t end = 0;
  };
  [[nodiscard]] Firings firings(std::int64_t scan) const;
  [[nodiscard]] TimeNs firing_time(std::int64_t firing) const;  // since the first revolution
};

// The beams and firing times of a model. Throws ConfigError where the name is unknown.
[[nodiscard]] LidarModel make_lidar_model(const LidarConfig& config);

}  // namespace understory
