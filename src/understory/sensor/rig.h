#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// Rings of the lidars that are merged into one scan are counted so far apart.
inline constexpr std::uint16_t kRingsALidar = 1024;

// A lidar besides the first one. Its points are in the scans of the first one, in its frame.
struct FurtherLidar {
  Pose lidar_from_further;  // from its own frame into that of the first one
  // Its rings count from here up to `kRingsALidar` more; 0: its scans come by themselves.
  std::uint16_t first_ring = 0;
};

// How the sensors sit on their carrier. The body frame is base_link (x forward, y left, z up) where
// the recording has one, else the IMU, else the lidar.
struct Rig {
  std::string body_frame = "lidar";
  Pose body_from_lidar;
  std::optional<Pose> body_from_imu;          // empty: no IMU, or its place is unknown
  std::optional<Pose> body_from_gnss;         // antenna; empty: unknown
  std::optional<Pose> body_from_second_gnss;  // antenna at the end of GnssFix::heading_deg's line
  std::vector<FurtherLidar> further_lidars;   // with rising first_ring
  std::string lidar_model;                    // "OS-0-128", "VLP-16", "" where unknown
  // Where each extrinsic came from, for `info` and run.json: "/tf_static", "sensor metadata",
  // "assumed identity", "--extrinsics FILE".
  std::string lidar_extrinsic_source = "assumed identity";
  std::string imu_extrinsic_source = "none";
  std::string gnss_extrinsic_source = "none";
  std::string second_gnss_extrinsic_source = "none";
};

}  // namespace understory
