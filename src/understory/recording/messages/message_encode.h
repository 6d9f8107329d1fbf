#pragma once

#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/recording/bytes.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/scan.h"

namespace understory {

// Values of one ROS 2 message as CDR, little-endian: each number aligned to its size, counted from
// behind the four bytes of encapsulation.
class CdrWriter {
 public:
  CdrWriter() { buffer_.put(std::uint32_t{0x00000100}); }

  template <typename T>
  void put(T value) {
    align(sizeof(T));
    buffer_.put(value);
  }
  void put_text(const std::string& text);
  void put_time(TimeNs time);
  void put_header(TimeNs stamp, const std::string& frame);
  // `size` bytes to be filled in by the caller, aligned as bytes are.
  [[nodiscard]] std::uint8_t* put_space(std::size_t size);
  [[nodiscard]] const ByteBuffer& bytes() const { return buffer_; }

 private:
  void align(std::size_t size);
  ByteBuffer buffer_;
};

// The frame of the antenna at the end of a heading's line.
inline constexpr const char* kSecondAntennaFrame = "gnss_second";

// The frame of a lidar besides the first one, counted from 0: lidar_2, lidar_3 and so on.
[[nodiscard]] inline std::string further_lidar_frame(std::size_t number) {
  return "lidar_" + std::to_string(number + 2);
}

// A fixed transform between two named frames.
struct NamedTransform {
  std::string parent;
  std::string child;
  Pose parent_from_child;
};

// The project's messages (design: formats), frames as named there. Pure functions.
[[nodiscard]] ByteBuffer encode_point_cloud2(const Scan& scan, const std::string& frame = "lidar");
// livox_ros_driver2/CustomMsg: the line of a point is its ring; its return is told by the tag
// alone.
[[nodiscard]] ByteBuffer encode_livox(const Scan& scan);
[[nodiscard]] ByteBuffer encode_imu(const ImuSample& sample);
[[nodiscard]] ByteBuffer encode_nav_sat_fix(const GnssFix& fix, const std::string& frame = "gnss");
[[nodiscard]] ByteBuffer encode_gps_fix(const GnssFix& fix);
// nmea_msgs/Sentence with the heading of a fix, in the frame of the second antenna.
[[nodiscard]] ByteBuffer encode_heading(const GnssFix& fix);
[[nodiscard]] ByteBuffer encode_magnetic_field(const MagSample& sample);
[[nodiscard]] ByteBuffer encode_transforms(const std::vector<NamedTransform>& transforms,
                                           TimeNs stamp);

}  // namespace understory
