#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/captures/ouster_metadata.h"
#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/first_scan.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"

namespace understory {

// Turns Ouster lidar and IMU packets into scans and samples.
//
// Points are in Ouster's *sensor frame*: x away from the connector, z up, origin at the centre of
// the base; metres. lidar_to_sensor_transform is applied, as in ouster-sdk's XYZLut without further
// extrinsics. Order: column after column, in each from the top beam down. Rings count from the
// lowest beam up. Intensity is the signal, in low data rate profiles the reflectivity. t_ns is the
// column's time. Times are on the sensor's own clock: UTC or TAI if it is synchronised, else since
// power-on. Damaged packets are passed over with a warning ("recording.damaged"). Not thread-safe.
class OusterDecoder {
 public:
  // `source` names the stream in warnings.
  OusterDecoder(const OusterMetadata& metadata, std::string source, Log& log);

  // Payload of one UDP packet of the lidar port. Any bytes of any size are survived.
  void add_lidar_packet(const std::uint8_t* data, std::size_t size);
  // Payload of one UDP packet of the IMU port; nothing if it is damaged. Specific force in m/s² and
  // angular rate in rad/s, in the IMU's frame, at the gyroscope's time stamp.
  [[nodiscard]] std::optional<ImuSample> add_imu_packet(const std::uint8_t* data, std::size_t size);

  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan();
  // Ends the scan in progress; at the end of the stream. A first scan that is only a part of a turn
  // is left out (FinishedScans).
  void finish();

  // All that has come in so far and is not given out yet, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

  // For `info`: "RNG15_RFL8_NIR8; per-column times on the sensor's clock (...)".
  [[nodiscard]] std::string conventions() const;

 private:
  struct Beam {
    double cos_altitude = 1.0;
    double sin_altitude = 0.0;
    double cos_azimuth = 1.0;
    double sin_azimuth = 0.0;
    std::uint16_t ring = 0;
  };
  struct Column {
    const std::uint8_t* pixels = nullptr;
    TimeNs time = 0;
    std::uint16_t frame = 0;
    std::uint16_t measurement = 0;
  };
  // Frame and time of a packet, by which it is seen whether it follows another.
  struct Mark {
    std::uint16_t frame = 0;
    TimeNs time = 0;
    [[nodiscard]] bool followed_by(const Mark& next) const;
  };

  void make_beams();
  [[nodiscard]] std::vector<Column> read_columns(const std::uint8_t* data) const;
  void add_columns(const std::vector<Column>& columns, const Mark& mark);
  void add_column(const Column& column);
  void add_return(const Beam& beam, const Column& column, std::uint32_t range_mm, float intensity,
                  std::uint8_t return_index);
  void close_scan();
  [[nodiscard]] double missing_at_beginning() const;
  void damaged(const std::string& what);

  OusterMetadata metadata_;
  std::string source_;
  Log& log_;
  std::vector<Beam> beams_;
  double range_offset_m_ = 0.0;
  Eigen::Matrix3d sensor_from_lidar_rotation_;
  Eigen::Vector3d sensor_from_lidar_translation_;
  std::uint64_t received_ = 0;
  std::optional<Mark> last_;
  std::optional<Mark> strange_mark_;   // of the last packet, if it did not follow
  std::vector<std::uint8_t> strange_;  // and the packet itself
  std::optional<TimeNs> last_imu_;
  std::optional<TimeNs> strange_imu_;
  std::vector<bool> seen_;  // columns of the scan in progress
  double encoder_cos_ = 1.0, encoder_sin_ = 0.0;
  GrowingScan growing_;
  FinishedScans finished_;
};

}  // namespace understory
