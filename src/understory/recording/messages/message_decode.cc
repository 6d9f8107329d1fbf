#include "understory/recording/messages/message_decode.h"

#include <cmath>

namespace understory {
namespace {

constexpr std::size_t kVelodynePacketBytes = 1206;
constexpr std::size_t kPandarPacketBytes = 1500;
constexpr std::size_t kLivoxPointBytes = 19;
constexpr std::size_t kLivoxCdrStep = 20;  // a point begins at a multiple of four bytes

// ROS 1 stamps are two unsigned, ROS 2 stamps a signed and an unsigned number.
TimeNs read_time(MessageReader& reader) {
  const TimeNs seconds = reader.is_ros1() ? static_cast<TimeNs>(reader.get<std::uint32_t>())
                                          : static_cast<TimeNs>(reader.get<std::int32_t>());
  return seconds * kNsPerSecond + static_cast<TimeNs>(reader.get<std::uint32_t>());
}

MessageHeader read_header(MessageReader& reader) {
  MessageHeader header;
  if (reader.is_ros1()) (void)reader.get<std::uint32_t>();  // seq
  header.stamp = read_time(reader);
  header.frame = std::string(reader.text());
  // Frames of tf may come with a slash before them.
  if (!header.frame.empty() && header.frame.front() == '/') header.frame.erase(0, 1);
  return header;
}

Eigen::Vector3d read_vector(MessageReader& reader) {
  Eigen::Vector3d vector;
  for (int i = 0; i < 3; ++i)
    vector[i] = reader.get<double>();
  return vector;
}

Eigen::Quaterniond read_quaternion(MessageReader& reader) {
  Eigen::Quaterniond rotation;
  rotation.x() = reader.get<double>();
  rotation.y() = reader.get<double>();
  rotation.z() = reader.get<double>();
  rotation.w() = reader.get<double>();
  return rotation;
}

Eigen::Matrix3d read_matrix(MessageReader& reader) {
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i)
    matrix(i / 3, i % 3) = reader.get<double>();
  return matrix;
}

bool is_rotation(const Eigen::Quaterniond& rotation) {
  const double norm = rotation.norm();
  return std::isfinite(norm) && norm > 0.5 && norm < 2.0;
}

// Position covariance and its type, which is 0 where the receiver gives none.
void read_position_covariance(MessageReader& reader, GnssFix& fix) {
  const Eigen::Matrix3d covariance = read_matrix(reader);
  if (reader.get<std::uint8_t>() != 0) fix.covariance = covariance;
}

int quality_of_nav_sat(std::int8_t status) {
  switch (status) {
    case -1:
      return 0;
    case 0:
      return 1;
    case 1:
      return 2;
    case 2:
      return 4;
    default:
      return status < 0 ? 0 : 1;
  }
}

int quality_of_gps_status(std::int16_t status) {
  switch (status) {
    case 0:
      return 1;
    case 1:
    case 18:
    case 33:
      return 2;
    case 2:
    case 19:
      return 4;
    case 20:
      return 5;
    default:
      return status < 0 ? 0 : 1;
  }
}

double positive_or_nan(double value) {
  return value > 0.0 ? value : std::nan("");
}

void read_gps_status(MessageReader& reader, GnssFix& fix) {
  (void)read_header(reader);
  fix.satellites = reader.get<std::uint16_t>();
  reader.skip_sequence<std::int32_t>();
  (void)reader.get<std::uint16_t>();
  for (int i = 0; i < 4; ++i)
    reader.skip_sequence<std::int32_t>();
  fix.quality = quality_of_gps_status(reader.get<std::int16_t>());
  for (int i = 0; i < 3; ++i)
    (void)reader.get<std::uint16_t>();
}

}  // namespace

std::optional<PointCloud2Message> decode_point_cloud2(MessageReader reader) {
  PointCloud2Message message;
  message.header = read_header(reader);
  message.height = reader.get<std::uint32_t>();
  message.width = reader.get<std::uint32_t>();
  const auto count = reader.length(13);
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    CloudField field;
    field.name = std::string(reader.text());
    field.offset = reader.get<std::uint32_t>();
    field.type = static_cast<FieldType>(reader.get<std::uint8_t>());
    field.count = reader.get<std::uint32_t>();
    message.fields.push_back(std::move(field));
  }
  message.big_endian = reader.get<std::uint8_t>() != 0;
  message.point_step = reader.get<std::uint32_t>();
  message.row_step = reader.get<std::uint32_t>();
  message.data = reader.byte_sequence();
  if (!reader.ok()) return std::nullopt;  // is_dense says nothing that the points do not say
  return message;
}

// The last point of a CDR sequence lacks the padding that follows the others. So the cloud begins
// one byte before its first point, at the length of the sequence. Its fields lie one byte later,
// and every point has its whole step.
std::optional<LivoxMessage> decode_livox(MessageReader reader) {
  LivoxMessage message;
  PointCloud2Message& cloud = message.cloud;
  cloud.header = read_header(reader);
  message.timebase = reader.get<std::uint64_t>();
  message.stated_points = reader.get<std::uint32_t>();
  message.lidar_id = reader.get<std::uint8_t>();
  (void)reader.take(3);  // reserved
  const std::size_t count = reader.length(kLivoxPointBytes);
  const std::uint32_t shift = reader.is_ros1() ? 0 : 1;
  cloud.point_step =
      static_cast<std::uint32_t>(reader.is_ros1() ? kLivoxPointBytes : kLivoxCdrStep);
  const ByteSpan points = reader.take(count == 0 ? 0 : count * cloud.point_step - shift);
  if (!reader.ok()) return std::nullopt;
  if (count > 0) cloud.data = {points.data() - shift, points.size() + shift};
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(count);
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.big_endian = reader.swaps_bytes();
  cloud.fields = {
      {"offset_time", shift, FieldType::kUint32, 1},      {"x", shift + 4, FieldType::kFloat32, 1},
      {"y", shift + 8, FieldType::kFloat32, 1},           {"z", shift + 12, FieldType::kFloat32, 1},
      {"reflectivity", shift + 16, FieldType::kUint8, 1}, {"tag", shift + 17, FieldType::kUint8, 1},
      {"line", shift + 18, FieldType::kUint8, 1}};
  return message;
}

std::optional<ImuMessage> decode_imu(MessageReader reader) {
  ImuMessage message;
  message.header = read_header(reader);
  const Eigen::Quaterniond orientation = read_quaternion(reader);
  const Eigen::Matrix3d orientation_covariance = read_matrix(reader);
  message.sample.stamp = message.header.stamp;
  message.sample.angular_rate = read_vector(reader);
  (void)read_matrix(reader);
  message.sample.specific_force = read_vector(reader);
  (void)read_matrix(reader);
  if (!reader.ok()) return std::nullopt;
  if (orientation_covariance(0, 0) != -1.0 && is_rotation(orientation))
    message.sample.orientation = orientation;
  return message;
}

std::optional<MagMessage> decode_magnetic_field(MessageReader reader) {
  MagMessage message;
  message.header = read_header(reader);
  message.sample.stamp = message.header.stamp;
  message.sample.field = read_vector(reader);
  (void)read_matrix(reader);
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<GnssMessage> decode_nav_sat_fix(MessageReader reader) {
  GnssMessage message;
  message.header = read_header(reader);
  GnssFix& fix = message.fix;
  fix.stamp = message.header.stamp;
  fix.quality = quality_of_nav_sat(reader.get<std::int8_t>());
  (void)reader.get<std::uint16_t>();  // service
  fix.latitude_deg = reader.get<double>();
  fix.longitude_deg = reader.get<double>();
  fix.height_m = reader.get<double>();
  read_position_covariance(reader, fix);
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<GnssMessage> decode_gps_fix(MessageReader reader) {
  GnssMessage message;
  message.header = read_header(reader);
  GnssFix& fix = message.fix;
  fix.stamp = message.header.stamp;
  read_gps_status(reader, fix);
  fix.latitude_deg = reader.get<double>();
  fix.longitude_deg = reader.get<double>();
  fix.height_m = reader.get<double>();
  fix.track_deg = reader.get<double>();
  fix.speed_m_s = reader.get<double>();
  for (int i = 0; i < 7; ++i)
    (void)reader.get<double>();  // climb, pitch, roll, dip, time, gdop, pdop
  fix.hdop = positive_or_nan(reader.get<double>());
  fix.vdop = positive_or_nan(reader.get<double>());
  for (int i = 0; i < 11; ++i)
    (void)reader.get<double>();  // tdop, err ... err_dip
  read_position_covariance(reader, fix);
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<NmeaMessage> decode_nmea_sentence(MessageReader reader) {
  NmeaMessage message;
  message.header = read_header(reader);
  message.sentence = std::string(reader.text());
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<std::vector<TransformMessage>> decode_transforms(MessageReader reader) {
  const auto count = reader.length(60);
  std::vector<TransformMessage> transforms;
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    TransformMessage transform;
    MessageHeader header = read_header(reader);
    transform.stamp = header.stamp;
    transform.parent = std::move(header.frame);
    transform.child = std::string(reader.text());
    if (!transform.child.empty() && transform.child.front() == '/') transform.child.erase(0, 1);
    const Eigen::Vector3d translation = read_vector(reader);
    const Eigen::Quaterniond rotation = read_quaternion(reader);
    if (!is_rotation(rotation) || !translation.allFinite()) continue;
    transform.parent_from_child = Pose(rotation, translation);
    transforms.push_back(std::move(transform));
  }
  if (!reader.ok()) return std::nullopt;
  return transforms;
}

std::optional<PacketsMessage> decode_velodyne_scan(MessageReader reader) {
  PacketsMessage message;
  message.header = read_header(reader);
  const auto count = reader.length(kVelodynePacketBytes);
  message.packets.reserve(count);
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    SensorPacket packet;
    packet.stamp = read_time(reader);
    packet.data = reader.take(kVelodynePacketBytes);
    message.packets.push_back(packet);
  }
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<PacketsMessage> decode_nebula_packets(MessageReader reader) {
  PacketsMessage message;
  message.header = read_header(reader);
  const auto count = reader.length(12);
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    SensorPacket packet;
    packet.stamp = read_time(reader);
    packet.data = reader.byte_sequence();
    message.packets.push_back(packet);
  }
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<PacketsMessage> decode_pandar_scan(MessageReader reader) {
  PacketsMessage message;
  message.header = read_header(reader);
  const auto count = reader.length(8 + kPandarPacketBytes + 4);
  message.packets.reserve(count);
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    SensorPacket packet;
    packet.stamp = read_time(reader);
    packet.data = reader.take(kPandarPacketBytes);
    const auto size = reader.get<std::uint32_t>();
    if (size < packet.data.size()) packet.data = packet.data.first(size);
    message.packets.push_back(packet);
  }
  if (!reader.ok()) return std::nullopt;
  return message;
}

std::optional<PacketsMessage> decode_hesai_frame(MessageReader reader) {
  PacketsMessage message;
  message.header = read_header(reader);
  const auto count = reader.length(16);
  for (std::uint32_t i = 0; i < count && reader.ok(); ++i) {
    SensorPacket packet;
    packet.stamp = read_time(reader);
    packet.data = reader.byte_sequence();
    const auto size = reader.get<std::uint32_t>();
    if (size < packet.data.size()) packet.data = packet.data.first(size);
    message.packets.push_back(packet);
  }
  if (!reader.ok()) return std::nullopt;
  return message;
}

}  // namespace understory
