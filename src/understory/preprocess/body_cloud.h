#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/geometry/points.h"
#include "understory/util/time.h"

namespace understory {

// A deskewed scan: all returns in the body frame as it stood at `stamp`. Parallel arrays, one entry
// a return, in the order of the scan.
struct BodyCloud {
  TimeNs stamp = 0;
  Points points;                 // metres, body frame at `stamp`
  std::vector<float> intensity;  // as the sensor gives it
  std::vector<float> range;      // metres from the lidar's origin when measured
  std::vector<std::uint16_t> ring;
  std::vector<std::uint32_t> t_ns;    // since `stamp`
  std::vector<PointFeature> feature;  // only where a matcher asks for it; else empty
  // 1: it goes along with the lidar, and is not matched (CarriedReturns). Empty: none.
  std::vector<std::uint8_t> carried;

  [[nodiscard]] std::size_t size() const { return points.size(); }
  [[nodiscard]] bool empty() const { return points.empty(); }
  [[nodiscard]] bool is_carried(std::size_t i) const { return !carried.empty() && carried[i] != 0; }
  void resize(std::size_t n) {
    points.resize(n);
    intensity.resize(n);
    range.resize(n);
    ring.resize(n);
    t_ns.resize(n);
  }
};

// Which lidar of several measured each point, by its ring (kRingsALidar); empty where it was the
// first one always.
[[nodiscard]] std::vector<std::uint8_t> lidars_of(const std::vector<std::uint16_t>& rings);
// The same cloud in parts, by the lidar that measured the points; its features and what is carried
// go along.
[[nodiscard]] std::vector<BodyCloud> clouds_by_lidar(const BodyCloud& cloud);

}  // namespace understory
