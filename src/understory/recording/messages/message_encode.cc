#include "understory/recording/messages/message_encode.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "understory/recording/captures/nmea.h"

namespace understory {
namespace {

// sensor_msgs/msg/PointField datatypes.
constexpr std::uint8_t kUint8 = 2;
constexpr std::uint8_t kUint16 = 4;
constexpr std::uint8_t kUint32 = 6;
constexpr std::uint8_t kFloat32 = 7;

constexpr std::uint32_t kRingOffset = 16;
constexpr std::uint32_t kReturnOffset = 18;
constexpr std::uint32_t kTagOffset = 19;
constexpr std::uint32_t kTimeOffset = 20;
constexpr std::uint32_t kPointStep = 24;

constexpr double kUnknownCovariance = 0.0;
constexpr std::uint8_t kCovarianceUnknown = 0;
constexpr std::uint8_t kCovarianceKnown = 3;

void put_field(CdrWriter& out, const std::string& name, std::uint32_t offset, std::uint8_t type) {
  out.put_text(name);
  out.put(offset);
  out.put(type);
  out.put(std::uint32_t{1});
}

// What some scans have and others lack.
struct CloudContent {
  explicit CloudContent(const Scan& scan) : times(scan.has_point_times) {
    for (const ScanPoint& point : scan.points) {
      returns = returns || point.return_index != 0;
      tags = tags || point.tag != 0;
    }
  }
  bool times = false;
  bool returns = false;
  bool tags = false;
};

// The design's fields; `t` only where there are times, `return_index` only where a second return
// occurs, `tag` only where a point is marked.
void put_fields(CdrWriter& out, const CloudContent& has) {
  out.put(static_cast<std::uint32_t>(5 + (has.returns ? 1 : 0) + (has.tags ? 1 : 0) +
                                     (has.times ? 1 : 0)));
  put_field(out, "x", 0, kFloat32);
  put_field(out, "y", 4, kFloat32);
  put_field(out, "z", 8, kFloat32);
  put_field(out, "intensity", 12, kFloat32);
  put_field(out, "ring", kRingOffset, kUint16);
  if (has.returns) put_field(out, "return_index", kReturnOffset, kUint8);
  if (has.tags) put_field(out, "tag", kTagOffset, kUint8);
  if (has.times) put_field(out, "t", kTimeOffset, kUint32);
}

void pack_point(const ScanPoint& point, std::uint8_t* raw) {
  std::memcpy(raw, &point.x, 4);
  std::memcpy(raw + 4, &point.y, 4);
  std::memcpy(raw + 8, &point.z, 4);
  std::memcpy(raw + 12, &point.intensity, 4);
  std::memcpy(raw + kRingOffset, &point.ring, 2);
  raw[kReturnOffset] = point.return_index;
  raw[kTagOffset] = point.tag;
  std::memcpy(raw + kTimeOffset, &point.t_ns, 4);
}

void put_vector(CdrWriter& out, const Eigen::Vector3d& vector) {
  for (int i = 0; i < 3; ++i)
    out.put(vector[i]);
}

void put_quaternion(CdrWriter& out, const Eigen::Quaterniond& rotation) {
  out.put(rotation.x());
  out.put(rotation.y());
  out.put(rotation.z());
  out.put(rotation.w());
}

void put_covariance(CdrWriter& out, double first) {
  out.put(first);
  for (int i = 1; i < 9; ++i)
    out.put(0.0);
}

void put_position_covariance(CdrWriter& out, const GnssFix& fix) {
  const bool known = fix.covariance.allFinite();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      out.put(known ? fix.covariance(row, column) : kUnknownCovariance);
  }
  out.put(known ? kCovarianceKnown : kCovarianceUnknown);
}

// sensor_msgs/msg/NavSatStatus: -1 none, 0 fix, 1 satellite-, 2 ground-based augmentation.
std::int8_t nav_sat_status(int quality) {
  if (quality <= 0) return -1;
  if (quality == 1) return 0;
  return quality == 2 ? 1 : 2;
}

// gps_msgs/msg/GPSStatus.
std::int16_t gps_status(int quality) {
  switch (quality) {
    case 0:
      return -1;
    case 1:
      return 0;
    case 2:
      return 18;
    case 4:
      return 19;
    case 5:
      return 20;
    default:
      return quality < 0 ? -1 : 0;
  }
}

void put_gps_status(CdrWriter& out, const GnssFix& fix) {
  out.put_header(fix.stamp, "gnss");
  out.put(static_cast<std::uint16_t>(std::max(fix.satellites, 0)));
  out.put(std::uint32_t{0});  // satellite_used_prn
  out.put(std::uint16_t{0});  // satellites_visible
  for (int i = 0; i < 4; ++i)
    out.put(std::uint32_t{0});  // satellite_visible_{prn, z, azimuth, snr}
  out.put(gps_status(fix.quality));
  for (int i = 0; i < 3; ++i)
    out.put(std::uint16_t{0});  // {motion, orientation, position}_source
}

}  // namespace

void CdrWriter::align(std::size_t size) {
  const std::size_t over = (buffer_.size() - 4) % size;
  if (over == 0) return;
  for (std::size_t i = over; i < size; ++i)
    buffer_.put(std::uint8_t{0});
}

void CdrWriter::put_text(const std::string& text) {
  put(static_cast<std::uint32_t>(text.size() + 1));
  buffer_.put_bytes({reinterpret_cast<const std::uint8_t*>(text.c_str()), text.size() + 1});
}

void CdrWriter::put_time(TimeNs time) {
  TimeNs seconds = time / kNsPerSecond;
  TimeNs rest = time % kNsPerSecond;
  if (rest < 0) {
    rest += kNsPerSecond;
    --seconds;
  }
  put(static_cast<std::int32_t>(seconds));
  put(static_cast<std::uint32_t>(rest));
}

void CdrWriter::put_header(TimeNs stamp, const std::string& frame) {
  put_time(stamp);
  put_text(frame);
}

std::uint8_t* CdrWriter::put_space(std::size_t size) {
  const std::size_t begin = buffer_.size();
  buffer_.resize(begin + size);
  return buffer_.data() + begin;
}

ByteBuffer encode_point_cloud2(const Scan& scan, const std::string& frame) {
  const auto count = static_cast<std::uint32_t>(scan.points.size());

  CdrWriter out;
  out.put_header(scan.stamp, frame);
  out.put(std::uint32_t{1});  // height
  out.put(count);             // width
  put_fields(out, CloudContent(scan));
  out.put(std::uint8_t{0});  // is_bigendian
  out.put(kPointStep);
  out.put(kPointStep * count);
  out.put(kPointStep * count);  // length of data
  std::uint8_t* raw = out.put_space(static_cast<std::size_t>(kPointStep) * count);
  for (const ScanPoint& point : scan.points) {
    pack_point(point, raw);
    raw += kPointStep;
  }
  out.put(std::uint8_t{1});  // is_dense
  return out.bytes();
}

ByteBuffer encode_livox(const Scan& scan) {
  const auto count = static_cast<std::uint32_t>(scan.points.size());
  CdrWriter out;
  out.put_header(scan.stamp, "lidar");
  out.put(static_cast<std::uint64_t>(scan.stamp));  // timebase
  out.put(count);
  for (int i = 0; i < 4; ++i)
    out.put(std::uint8_t{0});  // lidar_id and three reserved bytes
  out.put(count);
  for (const ScanPoint& point : scan.points) {
    out.put(point.t_ns);
    out.put(point.x);
    out.put(point.y);
    out.put(point.z);
    out.put(static_cast<std::uint8_t>(std::clamp(point.intensity, 0.0F, 255.0F)));
    out.put(point.tag);
    out.put(static_cast<std::uint8_t>(point.ring));
  }
  return out.bytes();
}

ByteBuffer encode_imu(const ImuSample& sample) {
  CdrWriter out;
  out.put_header(sample.stamp, "imu");
  put_quaternion(out, sample.orientation.value_or(Eigen::Quaterniond::Identity()));
  put_covariance(out, sample.orientation ? 0.0 : -1.0);
  put_vector(out, sample.angular_rate);
  put_covariance(out, 0.0);
  put_vector(out, sample.specific_force);
  put_covariance(out, 0.0);
  return out.bytes();
}

ByteBuffer encode_nav_sat_fix(const GnssFix& fix, const std::string& frame) {
  CdrWriter out;
  out.put_header(fix.stamp, frame);
  out.put(nav_sat_status(fix.quality));
  out.put(std::uint16_t{1});  // service: GPS
  out.put(fix.latitude_deg);
  out.put(fix.longitude_deg);
  out.put(fix.height_m);
  put_position_covariance(out, fix);
  return out.bytes();
}

ByteBuffer encode_gps_fix(const GnssFix& fix) {
  const double unknown = std::nan("");
  CdrWriter out;
  out.put_header(fix.stamp, "gnss");
  put_gps_status(out, fix);
  for (const double value : {fix.latitude_deg, fix.longitude_deg, fix.height_m, fix.track_deg,
                             fix.speed_m_s, unknown, unknown, unknown, unknown, unknown})
    out.put(value);  // ..., climb, pitch, roll, dip, time
  // A dilution of precision that is not positive is unknown: gdop, pdop, hdop, vdop, tdop.
  for (const double value : {-1.0, -1.0, std::isfinite(fix.hdop) ? fix.hdop : -1.0,
                             std::isfinite(fix.vdop) ? fix.vdop : -1.0, -1.0})
    out.put(value);
  for (int i = 0; i < 10; ++i)
    out.put(unknown);  // err ... err_dip
  put_position_covariance(out, fix);
  return out.bytes();
}

ByteBuffer encode_heading(const GnssFix& fix) {
  CdrWriter out;
  out.put_header(fix.stamp, kSecondAntennaFrame);
  out.put_text(nmea_heading(fix));
  return out.bytes();
}

ByteBuffer encode_magnetic_field(const MagSample& sample) {
  CdrWriter out;
  out.put_header(sample.stamp, "imu");
  put_vector(out, sample.field);
  put_covariance(out, 0.0);
  return out.bytes();
}

ByteBuffer encode_transforms(const std::vector<NamedTransform>& transforms, TimeNs stamp) {
  CdrWriter out;
  out.put(static_cast<std::uint32_t>(transforms.size()));
  for (const NamedTransform& transform : transforms) {
    out.put_header(stamp, transform.parent);
    out.put_text(transform.child);
    put_vector(out, transform.parent_from_child.translation());
    put_quaternion(out, transform.parent_from_child.rotation());
  }
  return out.bytes();
}

}  // namespace understory
