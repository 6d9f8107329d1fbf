#include "understory/preprocess/event_bytes.h"

namespace understory {
namespace {

void put_vector(BinaryWriter& writer, const Eigen::Vector3d& vector) {
  writer.put_doubles(vector.data(), 3);
}

Eigen::Vector3d get_vector(BinaryReader& reader) {
  Eigen::Vector3d vector;
  reader.get_doubles(vector.data(), 3);
  return vector;
}

void put(BinaryWriter& writer, const ScanPtr& scan) {
  writer.put(scan->stamp);
  writer.put(scan->has_point_times);
  writer.put(scan->ring_count);
  writer.put(scan->points);
}

void put(BinaryWriter& writer, const ImuSample& sample) {
  writer.put(sample.stamp);
  put_vector(writer, sample.angular_rate);
  put_vector(writer, sample.specific_force);
  writer.put(sample.orientation.has_value());
  if (sample.orientation) writer.put_doubles(sample.orientation->coeffs().data(), 4);
}

void put(BinaryWriter& writer, const GnssFix& fix) {
  writer.put(fix.stamp);
  for (const double value : {fix.latitude_deg, fix.longitude_deg, fix.height_m, fix.hdop, fix.vdop,
                             fix.track_deg, fix.speed_m_s})
    writer.put(value);
  writer.put_doubles(fix.covariance.data(), 9);
  writer.put(fix.quality);
  writer.put(fix.satellites);
}

void put(BinaryWriter& writer, const MagSample& sample) {
  writer.put(sample.stamp);
  put_vector(writer, sample.field);
}

ScanPtr get_scan(BinaryReader& reader) {
  auto scan = std::make_shared<Scan>();
  scan->stamp = reader.get<TimeNs>();
  scan->has_point_times = reader.get<bool>();
  scan->ring_count = reader.get<int>();
  scan->points = reader.get_vector<ScanPoint>();
  return scan;
}

ImuSample get_imu(BinaryReader& reader) {
  ImuSample sample;
  sample.stamp = reader.get<TimeNs>();
  sample.angular_rate = get_vector(reader);
  sample.specific_force = get_vector(reader);
  if (reader.get<bool>()) {
    sample.orientation.emplace();
    reader.get_doubles(sample.orientation->coeffs().data(), 4);
  }
  return sample;
}

GnssFix get_fix(BinaryReader& reader) {
  GnssFix fix;
  fix.stamp = reader.get<TimeNs>();
  for (double* value : {&fix.latitude_deg, &fix.longitude_deg, &fix.height_m, &fix.hdop, &fix.vdop,
                        &fix.track_deg, &fix.speed_m_s})
    *value = reader.get<double>();
  reader.get_doubles(fix.covariance.data(), 9);
  fix.quality = reader.get<int>();
  fix.satellites = reader.get<int>();
  return fix;
}

MagSample get_mag(BinaryReader& reader) {
  MagSample sample;
  sample.stamp = reader.get<TimeNs>();
  sample.field = get_vector(reader);
  return sample;
}

}  // namespace

void put_event(BinaryWriter& writer, const Event& event) {
  writer.put(static_cast<std::uint8_t>(event.index()));
  std::visit([&](const auto& value) { put(writer, value); }, event);
}

Event get_event(BinaryReader& reader) {
  const auto kind = reader.get<std::uint8_t>();
  switch (kind) {
    case 0:
      return get_scan(reader);
    case 1:
      return get_imu(reader);
    case 2:
      return get_fix(reader);
    case 3:
      return get_mag(reader);
    default:
      throw InputError("checkpoint", "event of kind " + std::to_string(kind), "expected 0 to 3");
  }
}

}  // namespace understory
