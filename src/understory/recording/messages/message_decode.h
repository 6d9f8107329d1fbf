#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/recording/messages/field_type.h"
#include "understory/recording/messages/message_reader.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/imu_sample.h"

namespace understory {

// The ROS 1 and ROS 2 messages that recordings hold. Each decoder takes any bytes and returns
// nothing where they are not a whole message of that type. Pure functions.

// std_msgs/Header.
struct MessageHeader {
  TimeNs stamp = 0;
  std::string frame;
};

// sensor_msgs/PointField.
struct CloudField {
  std::string name;
  std::uint32_t offset = 0;
  FieldType type = FieldType::kFloat32;
  std::uint32_t count = 1;
};

// sensor_msgs/PointCloud2; the data point into the message.
struct PointCloud2Message {
  MessageHeader header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::vector<CloudField> fields;
  bool big_endian = false;
  std::uint32_t point_step = 0;
  std::uint32_t row_step = 0;
  ByteSpan data;  // part of the message's bytes
};

// sensor_msgs/Imu; rad/s and m/s^2 as it has them.
struct ImuMessage {
  MessageHeader header;
  ImuSample sample;
};

// sensor_msgs/MagneticField.
struct MagMessage {
  MessageHeader header;
  MagSample sample;
};

// sensor_msgs/NavSatFix or gps_msgs/GPSFix.
struct GnssMessage {
  MessageHeader header;
  GnssFix fix;
};

// nmea_msgs/Sentence.
struct NmeaMessage {
  MessageHeader header;
  std::string sentence;
};

// geometry_msgs/TransformStamped.
struct TransformMessage {
  TimeNs stamp = 0;
  std::string parent;
  std::string child;
  Pose parent_from_child;
};

// livox_ros_driver2/CustomMsg, and livox_ros_driver/CustomMsg, which has the same fields: the
// points as a cloud with the fields offset_time (ns), x, y, z, reflectivity, tag and line.
struct LivoxMessage {
  PointCloud2Message cloud;
  std::uint64_t timebase = 0;       // ns, of the first point on the sensor's clock
  std::uint32_t stated_points = 0;  // point_num
  std::uint8_t lidar_id = 0;
};

// VelodyneScan, NebulaPackets, PandarScan and UdpFrame: packets as the sensor sent them.
struct SensorPacket {
  TimeNs stamp = 0;
  ByteSpan data;
};

// Packets of a lidar in one message.
struct PacketsMessage {
  MessageHeader header;
  std::vector<SensorPacket> packets;
};

// Nothing where the bytes are no whole message of the type.
[[nodiscard]] std::optional<PointCloud2Message> decode_point_cloud2(MessageReader reader);
[[nodiscard]] std::optional<LivoxMessage> decode_livox(MessageReader reader);
[[nodiscard]] std::optional<ImuMessage> decode_imu(MessageReader reader);
[[nodiscard]] std::optional<MagMessage> decode_magnetic_field(MessageReader reader);
[[nodiscard]] std::optional<GnssMessage> decode_nav_sat_fix(MessageReader reader);
[[nodiscard]] std::optional<GnssMessage> decode_gps_fix(MessageReader reader);
[[nodiscard]] std::optional<NmeaMessage> decode_nmea_sentence(MessageReader reader);
[[nodiscard]] std::optional<std::vector<TransformMessage>> decode_transforms(MessageReader reader);
[[nodiscard]] std::optional<PacketsMessage> decode_velodyne_scan(MessageReader reader);
[[nodiscard]] std::optional<PacketsMessage> decode_nebula_packets(MessageReader reader);
// pandar_msgs/PandarScan and hesai_lidar/PandarScan: packets of 1500 bytes and their true length.
[[nodiscard]] std::optional<PacketsMessage> decode_pandar_scan(MessageReader reader);
// hesai_ros_driver/UdpFrame.
[[nodiscard]] std::optional<PacketsMessage> decode_hesai_frame(MessageReader reader);

}  // namespace understory
