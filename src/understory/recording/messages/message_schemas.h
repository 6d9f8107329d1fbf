#pragma once

#include <string>

namespace understory {

// The ros2msg text of a message type ("sensor_msgs/msg/Imu") with all the types that it uses, as
// the schema record of an MCAP file holds it. Empty for a type that the project does not write.
[[nodiscard]] std::string ros2_schema(const std::string& type);

}  // namespace understory
