#pragma once

#include <optional>
#include <string>

#include "understory/geometry/pose.h"

namespace understory {

// How the sensors sit on their carrier. The body frame is base_link (x forward, y left, z up) where
// the recording has one, else the IMU, else the lidar.
struct Rig {
  std::string body_frame = "lidar";
  Pose body_from_lidar;
  std::optional<Pose> body_from_imu;          // empty: no IMU, or its place is unknown
  std::optional<Pose> body_from_gnss;         // antenna; empty: unknown
  std::optional<Pose> body_from_second_gnss;  // antenna at the end of GnssFix::heading_deg's line
  std::string lidar_model;                    // "OS-0-128", "VLP-16", "" where unknown
  // Where each extrinsic came from, for `info` and run.json: "/tf_static", "sensor metadata",
  // "assumed identity", "--extrinsics FILE".
  std::string lidar_extrinsic_source = "assumed identity";
  std::string imu_extrinsic_source = "none";
  std::string gnss_extrinsic_source = "none";
  std::string second_gnss_extrinsic_source = "none";
};

}  // namespace understory
