#include "understory/recording/messages/event_bytes.h"

#include "understory/geometry/pose_io.h"
#include "understory/sensor/sensor_io.h"

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
  put_imu(writer, sample);
}
void put(BinaryWriter& writer, const GnssFix& fix) {
  put_fix(writer, fix);
}
void put(BinaryWriter& writer, const MagSample& sample) {
  writer.put(sample.stamp);
  put_vector(writer, sample.field);
}

ScanPtr get_whole_scan(BinaryReader& reader) {
  auto scan = std::make_shared<Scan>();
  scan->stamp = reader.get<TimeNs>();
  scan->has_point_times = reader.get<bool>();
  scan->ring_count = reader.get<int>();
  scan->points = reader.get_vector<ScanPoint>();
  return scan;
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
      return get_whole_scan(reader);
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

void put_scan(BinaryWriter& writer, const ScanPtr& scan) {
  writer.put(scan != nullptr);
  if (scan != nullptr) put(writer, scan);
}

ScanPtr get_scan(BinaryReader& reader) {
  return reader.get<bool>() ? get_whole_scan(reader) : nullptr;
}

void put_rig(BinaryWriter& writer, const Rig& rig) {
  put_pose(writer, rig.body_from_lidar);
  for (const std::optional<Pose>* place :
       {&rig.body_from_imu, &rig.body_from_gnss, &rig.body_from_second_gnss}) {
    writer.put(place->has_value());
    if (*place) put_pose(writer, **place);
  }
  for (const std::string& text :
       {rig.body_frame, rig.lidar_model, rig.lidar_extrinsic_source, rig.imu_extrinsic_source,
        rig.gnss_extrinsic_source, rig.second_gnss_extrinsic_source})
    writer.put(text);
  writer.put(static_cast<std::uint64_t>(rig.further_lidars.size()));
  for (const FurtherLidar& lidar : rig.further_lidars) {
    put_pose(writer, lidar.lidar_from_further);
    writer.put(lidar.first_ring);
  }
}

Rig get_rig(BinaryReader& reader) {
  Rig rig;
  rig.body_from_lidar = get_pose(reader);
  for (std::optional<Pose>* place :
       {&rig.body_from_imu, &rig.body_from_gnss, &rig.body_from_second_gnss})
    if (reader.get<bool>()) *place = get_pose(reader);
  for (std::string* text :
       {&rig.body_frame, &rig.lidar_model, &rig.lidar_extrinsic_source, &rig.imu_extrinsic_source,
        &rig.gnss_extrinsic_source, &rig.second_gnss_extrinsic_source})
    *text = reader.get_string();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    FurtherLidar& lidar = rig.further_lidars.emplace_back();
    lidar.lidar_from_further = get_pose(reader);
    lidar.first_ring = reader.get<std::uint16_t>();
  }
  return rig;
}

void put_flags(BinaryWriter& writer, const std::vector<bool>& flags) {
  writer.put(std::vector<char>(flags.begin(), flags.end()));
}

std::vector<bool> get_flags(BinaryReader& reader) {
  const std::vector<char> flags = reader.get_vector<char>();
  return {flags.begin(), flags.end()};
}

void put_strings(BinaryWriter& writer, const std::map<std::string, std::string>& strings) {
  writer.put(static_cast<std::uint64_t>(strings.size()));
  for (const auto& [key, value] : strings) {
    writer.put(key);
    writer.put(value);
  }
}

std::map<std::string, std::string> get_strings(BinaryReader& reader) {
  std::map<std::string, std::string> strings;
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    const std::string key = reader.get_string();
    strings[key] = reader.get_string();
  }
  return strings;
}

}  // namespace understory
