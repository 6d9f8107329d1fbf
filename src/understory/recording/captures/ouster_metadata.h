#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/rig.h"

namespace understory {

// Layouts of Ouster's lidar packets (Ouster, "Sensor Data", UDP profiles).
enum class OusterProfile {
  kLegacy,
  kRng19,  // RNG19_RFL8_SIG16_NIR16: single return
  kDual,   // RNG19_RFL8_SIG16_NIR16_DUAL
  kRng15,  // RNG15_RFL8_NIR8: low data rate
  kRng15Dual,
};

// What an Ouster sensor says of itself, in any layout of its metadata JSON. One is the flat legacy
// one (firmware 1.x and 2.0 with defaults where a key is missing). The other is the nested one of
// firmware 2.4 / 3.x (sensor_info, beam_intrinsics, lidar_intrinsics, imu_intrinsics,
// lidar_data_format, config_params). Lengths in metres here.
struct OusterMetadata {
  std::string product;  // "OS-1-128"
  std::string serial;
  std::string firmware;
  std::string mode;       // "1024x10"
  std::string time_mode;  // "TIME_FROM_INTERNAL_OSC", empty if not given
  OusterProfile profile = OusterProfile::kLegacy;
  int pixels_per_column = 0;
  int columns_per_packet = 16;
  int columns_per_frame = 0;
  int first_column = 0;  // column window, inclusive; may wrap past zero
  int last_column = 0;
  std::vector<double> beam_altitude_deg;  // per pixel, from the top beam down
  std::vector<double> beam_azimuth_deg;
  // Where the beams leave: an offset along x, or the whole transform where the metadata has one.
  Eigen::Matrix4d lidar_from_beam = Eigen::Matrix4d::Identity();
  Pose sensor_from_lidar;
  Pose sensor_from_imu;
  int lidar_port = 0;  // 0 if not given
  int imu_port = 0;
  bool legacy_imu = true;  // false: IMU packets of a layout that is not read

  // Size of a lidar packet's payload; the IMU's is 48.
  [[nodiscard]] std::size_t lidar_packet_size() const;
  [[nodiscard]] std::size_t column_size() const;
  [[nodiscard]] std::size_t pixel_size() const;
  // Body is the IMU; the lidar frame of the rig is Ouster's sensor frame.
  [[nodiscard]] Rig rig() const;
};

inline constexpr std::size_t kOusterImuPacketSize = 48;

// Throws InputError naming `file` and the key at fault.
[[nodiscard]] OusterMetadata parse_ouster_metadata(const std::string& json,
                                                   const std::string& file);
[[nodiscard]] OusterMetadata read_ouster_metadata(const std::string& path);

}  // namespace understory
