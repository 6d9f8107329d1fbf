#pragma once

#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/imu_sample.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Sensor data in a checkpoint, bit for bit.
inline void put_imu(BinaryWriter& writer, const ImuSample& sample) {
  writer.put(sample.stamp);
  writer.put_doubles(sample.angular_rate.data(), 3);
  writer.put_doubles(sample.specific_force.data(), 3);
  writer.put(sample.orientation.has_value());
  if (sample.orientation) writer.put_doubles(sample.orientation->coeffs().data(), 4);
}

// Reads what put_imu has written. Throws InputError at the end of the bytes.
[[nodiscard]] inline ImuSample get_imu(BinaryReader& reader) {
  ImuSample sample;
  sample.stamp = reader.get<TimeNs>();
  reader.get_doubles(sample.angular_rate.data(), 3);
  reader.get_doubles(sample.specific_force.data(), 3);
  if (reader.get<bool>()) {
    sample.orientation.emplace();
    reader.get_doubles(sample.orientation->coeffs().data(), 4);
  }
  return sample;
}

// A fix in the bytes of checkpoints; get_fix reads it.
inline void put_fix(BinaryWriter& writer, const GnssFix& fix) {
  writer.put(fix.stamp);
  const double numbers[] = {fix.latitude_deg, fix.longitude_deg, fix.height_m,
                            fix.hdop,         fix.vdop,          fix.track_deg,
                            fix.speed_m_s,    fix.heading_deg,   fix.heading_sd_deg};
  writer.put_doubles(numbers, 9);
  writer.put_doubles(fix.covariance.data(), 9);
  writer.put(fix.quality);
  writer.put(fix.satellites);
}

// Reads what put_fix has written.
[[nodiscard]] inline GnssFix get_fix(BinaryReader& reader) {
  GnssFix fix;
  fix.stamp = reader.get<TimeNs>();
  for (double* number : {&fix.latitude_deg, &fix.longitude_deg, &fix.height_m, &fix.hdop, &fix.vdop,
                         &fix.track_deg, &fix.speed_m_s, &fix.heading_deg, &fix.heading_sd_deg}) {
    *number = reader.get<double>();
  }
  reader.get_doubles(fix.covariance.data(), 9);
  fix.quality = reader.get<int>();
  fix.satellites = reader.get<int>();
  return fix;
}

}  // namespace understory
