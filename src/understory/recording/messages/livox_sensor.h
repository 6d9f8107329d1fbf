#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "understory/geometry/pose.h"
#include "understory/recording/messages/message_survey.h"

namespace understory {

// Types of messages of livox_ros_driver2 begin so.
inline constexpr const char* kSecondDriver = "livox_ros_driver2/";

// The IMU of a Mid-360 in the frame of its points: (11.0, 23.29, -44.12) mm, axes parallel (Mid-360
// User Manual v1.2, "Coordinates").
[[nodiscard]] inline Pose mid360_lidar_from_imu() {
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.011, 0.02329, -0.04412)};
}

// What is known of the Livox that sends a topic of CustomMsg.
struct LivoxSensor {
  std::string model;    // "Mid-360"
  Pose lidar_from_imu;  // of its own IMU
};

// The driver livox_ros_driver2 runs with Mid-360 (four lines) and HAP (six lines) alone. So four
// lines are a Mid-360, whose IMU sits at (11.0, 23.29, -44.12) mm in the frame of the points, with
// parallel axes (Mid-360 User Manual v1.2, "Coordinates"). Nothing for other sensors.
[[nodiscard]] std::optional<LivoxSensor> livox_sensor(const TopicSurvey& lidar);

// The lidar_id of most points; nothing where there were none.
[[nodiscard]] std::optional<int> busiest_livox(const TopicSurvey& lidar);

// The number of a return by its tag: 0 for the first one, 1 and 2 for those behind it. Bits 4 and 5
// of the tag count from 1; 0 is a return that cannot be told from the sensor's own (Livox SDK
// Communication Protocol 1.3, section 3.4).
[[nodiscard]] inline std::uint8_t livox_return(std::uint8_t tag) {
  const int number = tag >> 4 & 3;
  return static_cast<std::uint8_t>(number > 1 ? number - 1 : 0);
}

// Warns of topics of lidars whose messages are not read ("recording.unread_lidar"), and names the
// way around: the driver that makes PointCloud2 of them.
void warn_of_unread_lidars(const MessageSurvey& survey, const std::string& file, Log& log);

}  // namespace understory
