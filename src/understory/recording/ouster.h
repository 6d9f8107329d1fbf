#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/ouster_metadata.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/util/log.h"

namespace understory {

// Turns Ouster lidar and IMU packets into scans and samples.
//
// Points are in Ouster's *sensor frame* (lidar_to_sensor_transform applied, what ouster-sdk's
// XYZLut gives with the extrinsics of the metadata): x away from the connector, z up, origin at the
// centre of the base; metres. Order: column after column, in each from the top beam down. Rings
// count from the lowest beam up. t_ns is the column's time stamp. Times are the sensor's own clock:
// Unix time (or TAI) if it is synchronised, else since power-on.
// Damaged packets are passed over with a warning ("recording.damaged"). Not thread-safe.
class OusterDecoder {
 public:
  OusterDecoder(const OusterMetadata& metadata, std::string source, Log& log);

  // Payload of one UDP packet of the lidar port. Any bytes of any size are survived.
  void add_lidar_packet(const std::uint8_t* data, std::size_t size);
  // Payload of one UDP packet of the IMU port; nothing if it is damaged. Specific force m/s² and
  // angular rate rad/s in the IMU's frame, at the gyroscope's time stamp.
  [[nodiscard]] std::optional<ImuSample> add_imu_packet(const std::uint8_t* data, std::size_t size);

  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan();
  // Ends the scan in progress; at the end of the stream.
  void finish();

 private:
  struct Beam {
    double cos_altitude, sin_altitude, azimuth_rad;
  };
  struct Column {
    const std::uint8_t* pixels = nullptr;
    TimeNs time = 0;
    double encoder_rad = 0.0;
    std::uint16_t frame = 0;
    int measurement = 0;
  };

  void add_column(const Column& column);
  void close_scan();
  void damaged(const std::string& what);

  OusterMetadata metadata_;
  std::string source_;
  Log& log_;
  std::vector<Beam> beams_;
  std::optional<std::uint16_t> frame_;
  std::vector<ScanPoint> points_;
  std::vector<TimeNs> point_times_;
  std::deque<ScanPtr> finished_;
};

}  // namespace understory
