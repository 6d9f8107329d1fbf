#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "understory/util/time.h"

namespace understory {

// One lidar return in the frame of the lidar, metres. NaN coordinates are dropped by the readers;
// a return at the origin (range 0) never appears.
struct ScanPoint {
  float x = 0.0F;
  float y = 0.0F;
  float z = 0.0F;
  float intensity = 0.0F;         // as the sensor gives it
  std::uint32_t t_ns = 0;         // since Scan::stamp
  std::uint16_t ring = 0;         // laser number, from the lowest beam up where the sensor tells
  std::uint8_t return_index = 0;  // 0 strongest or only, 1 second return of a dual-return sensor
  std::uint8_t tag = 0;           // marks of a Livox as they come: 0 is an ordinary point
};

// One revolution (or frame) of a lidar, in the order in which it was measured where the source
// keeps that order. Handed on as `std::shared_ptr<const Scan>`.
struct Scan {
  TimeNs stamp = 0;             // time of the first point
  bool has_point_times = true;  // false: every t_ns is 0 because the source has no times
  int ring_count = 0;           // number of beams, 0 where unknown
  std::vector<ScanPoint> points;

  // Time of the last point; `stamp` for an empty scan.
  [[nodiscard]] TimeNs end() const;
};

using ScanPtr = std::shared_ptr<const Scan>;

}  // namespace understory
