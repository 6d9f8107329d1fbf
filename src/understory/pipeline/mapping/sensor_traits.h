#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "understory/recording/recording.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// What a recording's sensors are like, as far as a configuration has to know.
struct SensorTraits {
  std::uint64_t scan_points = 0;  // returns of a full scan; 0: unknown
  int rings = 0;                  // beams of the lidar; 0: unknown
  double period_s = 0.0;          // from scan to scan, median; 0: unknown
  TimeNs first_scan = 0;          // stamp
  bool has_imu = false;           // one whose place on the carrier is known, and that measures
  bool imu_is_numb = false;       // there is one, and none of its first samples is a number
  Eigen::Vector3d lidar_in_body = Eigen::Vector3d::Zero();   // m
  std::vector<Eigen::Vector3d> further_lidars_in_body = {};  // m, of a scan of several lidars
};
// One line for people: "lidar: 29184 points a scan, 16 rings, 10.0 scans a second; with an IMU".
[[nodiscard]] std::string to_string(const SensorTraits& traits);
void put_traits(BinaryWriter& writer, const SensorTraits& traits);
[[nodiscard]] SensorTraits get_traits(BinaryReader& reader);

// Reads `source` up to its tenth scan that is not empty, and tells what its sensors are like. What
// is handed back gives all events of `source`, those read included. A full scan has as many returns
// as the second fullest of the ten. The first ones may be parts of a revolution or see little, and
// one may be two in one. Where no scan comes for long, the traits are unknown. Throws what reading
// throws.
[[nodiscard]] std::unique_ptr<Recording> learn_traits(std::unique_ptr<Recording> source,
                                                      SensorTraits& traits);

}  // namespace understory
