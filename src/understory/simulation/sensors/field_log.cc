#include "understory/simulation/sensors/field_log.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

#include "understory/recording/captures/nmea.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::int64_t kFiringsPerPacket = 24;
constexpr std::size_t kLasers = 16;

// With the system's reason: nothing else was asked of it since the stream failed.
OutputError unwritten(const std::string& path) {
  return {path, errno == 0 ? "cannot be written"
                           : std::string("cannot be written: ") + std::strerror(errno)};
}

template <typename T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

template <typename T>
void put_big(std::string& bytes, T value) {
  for (std::size_t i = sizeof(T); i-- > 0;)
    bytes.push_back(static_cast<char>(value >> (8 * i)));
}

std::uint32_t us_of_hour(TimeNs time) {
  return static_cast<std::uint32_t>((time / 1000) % 3'600'000'000LL);
}

std::string sentence(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body)
    sum ^= static_cast<unsigned char>(c);
  return fmt::format("${}*{:02X}\r\n", body, sum);
}

// Degrees and minutes as NMEA has them, with seven decimals of a minute (0.2 mm).
std::string angle(double degrees, int width, const char* letters) {
  const char letter = degrees < 0.0 ? letters[1] : letters[0];
  const double size = std::abs(degrees);
  auto whole = static_cast<int>(size);
  double minutes = 60.0 * (size - whole);
  if (minutes >= 59.99999995) {
    minutes = 0.0;
    ++whole;
  }
  return fmt::format("{:0{}d}{:010.7f},{}", whole, width, minutes, letter);
}

struct Clock {
  explicit Clock(TimeNs stamp) {
    const TimeNs centiseconds = stamp / 10'000'000;  // receivers print as much
    const auto in_day = static_cast<long>(centiseconds % 8'640'000);
    time = fmt::format("{:02d}{:02d}{:05.2f}", in_day / 360'000, in_day / 6000 % 60,
                       static_cast<double>(in_day % 6000) / 100.0);
    // The civil calendar from days since 1970 (years that begin in March).
    const std::int64_t days = centiseconds / 8'640'000 + 719'468;
    const std::int64_t era = days / 146'097;
    const std::int64_t of_era = days % 146'097;
    const std::int64_t year = (of_era - of_era / 1460 + of_era / 36'524 - of_era / 146'096) / 365;
    const std::int64_t of_year = of_era - (365 * year + year / 4 - year / 100);
    const std::int64_t month = (5 * of_year + 2) / 153;
    const std::int64_t calendar_month = month < 10 ? month + 3 : month - 9;
    date = fmt::format("{:02d}{:02d}{:02d}", of_year - (153 * month + 2) / 5 + 1, calendar_month,
                       (year + 400 * era + (calendar_month <= 2 ? 1 : 0)) % 100);
  }
  std::string time;
  std::string date;
};

std::string rmc(const GnssFix& fix) {
  const Clock clock(fix.stamp);
  return sentence(fmt::format("GPRMC,{},A,{},{},{:.3f},{:.2f},{},,,A", clock.time,
                              angle(fix.latitude_deg, 2, "NS"), angle(fix.longitude_deg, 3, "EW"),
                              fix.speed_m_s / 0.514444, fix.track_deg, clock.date));
}

std::string gga(const GnssFix& fix) {
  // The separation is written as zero, so that altitude is height above the ellipsoid.
  return sentence(fmt::format("GPGGA,{},{},{},{},{:02d},{:.2f},{:.3f},M,0.0,M,,",
                              Clock(fix.stamp).time, angle(fix.latitude_deg, 2, "NS"),
                              angle(fix.longitude_deg, 3, "EW"), fix.quality, fix.satellites,
                              fix.hdop, fix.height_m));
}

std::string gsa(const GnssFix& fix) {
  return sentence(fmt::format("GPGSA,A,3,,,,,,,,,,,,,{:.2f},{:.2f},{:.2f}",
                              std::hypot(fix.hdop, fix.vdop), fix.hdop, fix.vdop));
}

// What one firing measured: 2 mm steps and intensities, 0 without a return.
struct Firing {
  std::uint16_t steps[kLasers] = {};
  std::uint8_t intensity[kLasers] = {};
};

}  // namespace

FieldLogWriter::FieldLogWriter(const std::string& pcap_path, const SiteConfig& site, const Rig& rig)
    : pcap_path_(pcap_path),
      nmea_path_(std::filesystem::path(pcap_path).replace_extension(".nmea").string()),
      model_(make_lidar_model(site.lidar)) {
  std::vector<std::string> problems;
  if (site.lidar.model != "VLP-16") problems.push_back("lidar.model: a capture needs VLP-16");
  if (site.lidar.returns != 1) problems.push_back("lidar.returns: a capture needs 1");
  if (site.lidar.time_offset_s != 0.0) problems.push_back("lidar.time_offset_s: must be 0");
  if (site.lidar.range_step_m != 0.002) problems.push_back("lidar.range_step_m: must be 0.002");
  if (!problems.empty()) throw ConfigError(problems);
  const double whole = std::floor(site.origin.start_time_s);
  start_ =
      static_cast<TimeNs>(whole) * kNsPerSecond + from_seconds(site.origin.start_time_s - whole);
  pcap_.open(pcap_path_, std::ios::binary);
  nmea_.open(nmea_path_, std::ios::binary);
  if (!pcap_) throw OutputError(pcap_path_, "cannot be opened for writing");
  if (!nmea_) throw OutputError(nmea_path_, "cannot be opened for writing");
  std::string header;
  put(header, std::uint32_t{0xA1B23C4D});  // stamps with nanoseconds
  put(header, std::uint16_t{2});
  put(header, std::uint16_t{4});
  put(header, std::uint64_t{0});
  put(header, std::uint32_t{65535});
  put(header, std::uint32_t{1});  // Ethernet
  pcap_ << header;
  write_extrinsics(std::filesystem::path(pcap_path).replace_extension(".extrinsics.yaml").string(),
                   rig);
}

void FieldLogWriter::write_extrinsics(const std::string& path, const Rig& rig) const {
  // The frame of the packets is the simulated one turned by half a turn.
  const Pose turned(Eigen::Quaterniond(0.0, 0.0, 0.0, 1.0), Eigen::Vector3d::Zero());
  const auto line = [](const char* name, const Pose& pose) {
    const Eigen::Vector3d& t = pose.translation();
    const Eigen::Quaterniond& q = pose.rotation();
    return fmt::format(
        "{}:\n  translation_m: [{:.6f}, {:.6f}, {:.6f}]\n"
        "  rotation_xyzw: [{:.9f}, {:.9f}, {:.9f}, {:.9f}]\n",
        name, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  };
  std::ofstream file(path, std::ios::binary);
  file << "body_frame: " << rig.body_frame << "\nlidar_model: VLP-16\n"
       << line("body_from_lidar", rig.body_from_lidar * turned);
  if (rig.body_from_gnss) file << line("body_from_gnss", *rig.body_from_gnss);
  if (rig.body_from_second_gnss) file << line("body_from_second_gnss", *rig.body_from_second_gnss);
  file.close();
  if (!file) throw unwritten(path);
}

void FieldLogWriter::write(const Event& event) {
  if (const auto* scan = std::get_if<ScanPtr>(&event)) write_scan(**scan);
  if (const auto* fix = std::get_if<GnssFix>(&event)) write_fix(*fix);
  if (!pcap_) throw unwritten(pcap_path_);
  if (!nmea_) throw unwritten(nmea_path_);
}

// Puts the points back into the firings that they came from, and those into packets of 24.
void FieldLogWriter::write_scan(const Scan& scan) {
  std::map<std::uint16_t, std::size_t> laser_of_ring;
  for (std::size_t i = 0; i < model_.beams.size(); ++i)
    laser_of_ring[model_.beams[i].ring] = i;
  std::map<std::int64_t, Firing> firings;
  for (const ScanPoint& point : scan.points) {
    const std::size_t laser = laser_of_ring.at(point.ring);
    const double time =
        static_cast<double>(scan.stamp + point.t_ns - start_) - model_.beams[laser].delay_ns;
    Firing& firing = firings[std::llround(time / model_.firing_ns)];
    const double range = std::sqrt(double(point.x) * point.x + double(point.y) * point.y +
                                   double(point.z) * point.z);
    firing.steps[laser] = static_cast<std::uint16_t>(std::lround(range / 0.002));
    firing.intensity[laser] = static_cast<std::uint8_t>(point.intensity);
  }
  if (firings.empty()) return;
  const std::int64_t last = firings.rbegin()->first;
  for (std::int64_t first = firings.begin()->first; first <= last; first += kFiringsPerPacket) {
    std::string payload;
    for (std::int64_t firing = first; firing < first + kFiringsPerPacket; ++firing) {
      if ((firing - first) % 2 == 0) {
        const double time = static_cast<double>(model_.firing_time(firing));
        const double azimuth = 180.0 - model_.azimuth(time) / kDegree;  // clockwise from the rear
        put(payload, std::uint16_t{0xEEFF});
        put(payload, static_cast<std::uint16_t>(std::lround(100.0 * azimuth) % 36'000));
      }
      const auto found = firings.find(firing);
      const Firing measured = found == firings.end() ? Firing() : found->second;
      for (std::size_t laser = 0; laser < kLasers; ++laser) {
        put(payload, measured.steps[laser]);
        put(payload, measured.intensity[laser]);
      }
    }
    const TimeNs begin = start_ + model_.firing_time(first);
    put(payload, us_of_hour(begin));
    payload += "\x37\x22";  // strongest return, VLP-16
    write_record(start_ + model_.firing_time(first + kFiringsPerPacket), 2368, payload);
  }
}

void FieldLogWriter::write_fix(const GnssFix& fix) {
  nmea_ << gga(fix) << gsa(fix) << rmc(fix);
  if (std::isfinite(fix.heading_deg)) {
    GnssFix printed = fix;  // with the time as the other sentences print it
    printed.stamp -= printed.stamp % 10'000'000;
    nmea_ << nmea_heading(printed) << "\r\n";
  }
  std::string payload(198, '\0');
  put(payload, us_of_hour(fix.stamp));
  payload.resize(206, '\0');
  payload += rmc(fix);
  payload.resize(512, '\0');
  write_record(fix.stamp, 8308, payload);
}

// One frame: Ethernet, IPv4, UDP without a checksum.
void FieldLogWriter::write_record(TimeNs stamp, std::uint16_t port, const std::string& payload) {
  std::string frame(12, '\x11');
  frame += std::string("\x08\x00\x45\x00", 4);
  put_big(frame, static_cast<std::uint16_t>(28 + payload.size()));
  put_big(frame, std::uint16_t{0});
  put_big(frame, std::uint16_t{0});
  frame += std::string("\x40\x11\x00\x00\xC0\xA8\x01\xC9\xC0\xA8\x01\x01", 12);
  put_big(frame, port);
  put_big(frame, port);
  put_big(frame, static_cast<std::uint16_t>(8 + payload.size()));
  put_big(frame, std::uint16_t{0});
  frame += payload;
  std::string head;
  put(head, static_cast<std::uint32_t>(stamp / kNsPerSecond));
  put(head, static_cast<std::uint32_t>(stamp % kNsPerSecond));
  put(head, static_cast<std::uint32_t>(frame.size()));
  put(head, static_cast<std::uint32_t>(frame.size()));
  pcap_ << head << frame;
}

void FieldLogWriter::finish() {
  pcap_.close();
  nmea_.close();
  if (!pcap_) throw unwritten(pcap_path_);
  if (!nmea_) throw unwritten(nmea_path_);
}

}  // namespace understory
