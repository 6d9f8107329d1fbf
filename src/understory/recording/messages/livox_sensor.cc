#include "understory/recording/messages/livox_sensor.h"

#include <cstddef>
#include <string_view>

namespace understory {
namespace {

constexpr int kMid360Lines = 4;

struct Unread {
  std::string_view begin;  // of the type
  std::string_view way;
};

// Packets and clouds of lidars that are known and not read.
constexpr Unread kUnread[] = {
    {"ouster_ros/", "replay it through the driver ouster-ros and record its PointCloud2"},
    {"ouster_msgs/", "replay it through the driver ros2_ouster and record its PointCloud2"},
    {"ouster_sensor_msgs/", "replay it through the driver ouster-ros and record its PointCloud2"},
    {"rslidar_msg", "replay it through rslidar_sdk and record its PointCloud2"},
    {"robosense_msgs/", "replay it through rslidar_sdk and record its PointCloud2"},
    {"seyond/", "replay it through the driver seyond and record its PointCloud2"},
    {"innovusion/", "replay it through the driver seyond and record its PointCloud2"},
    {"velodyne_msgs/VelodynePacket", "record velodyne_msgs/VelodyneScan instead"},
    {"sensor_msgs/LaserScan", "a scanner of one plane does not map a forest"},
    {"sensor_msgs/MultiEchoLaserScan", "a scanner of one plane does not map a forest"},
};

// Empty for types of no lidar. `type` in ROS 1 or ROS 2 spelling.
std::string_view way_around(const std::string& type) {
  std::string name = type;
  const std::size_t middle = name.find("/msg/");
  if (middle != std::string::npos) name.erase(middle, 4);
  for (const Unread& each : kUnread) {
    if (name.rfind(each.begin, 0) == 0) return each.way;
  }
  return {};
}

}  // namespace

std::optional<LivoxSensor> livox_sensor(const TopicSurvey& lidar) {
  if (lidar.role != TopicRole::kLivox || lidar.type.rfind(kSecondDriver, 0) != 0 ||
      lidar.lines > kMid360Lines)
    return std::nullopt;
  return LivoxSensor{"Mid-360", mid360_lidar_from_imu()};
}

std::optional<int> busiest_livox(const TopicSurvey& lidar) {
  std::optional<int> best;
  std::uint64_t most = 0;
  for (const auto& [id, points] : lidar.livox_ids) {
    if (points <= most) continue;
    best = id;
    most = points;
  }
  return best;
}

void warn_of_unread_lidars(const MessageSurvey& survey, const std::string& file, Log& log) {
  for (const TopicSurvey& topic : survey.topics) {
    if (!topic.unread.empty())
      log.warn("recording.unread_lidar", file + ": " + topic.topic + ": packets of " +
                                             topic.unread +
                                             " are not read: replay them through "
                                             "the sensor's driver and record its PointCloud2");
    if (topic.role != TopicRole::kIgnored) continue;
    const std::string_view way = way_around(topic.type);
    if (way.empty()) continue;
    log.warn("recording.unread_lidar", file + ": " + topic.topic + ": messages of type " +
                                           topic.type + " are not read: " + std::string(way));
  }
}

}  // namespace understory
