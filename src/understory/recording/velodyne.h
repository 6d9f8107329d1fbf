#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/scan.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

enum class VelodyneModel { kUnknown, kVlp16, kHdl32e, kPuckHiRes, kVlp32c };

struct VelodyneConfig {
  // Azimuth (clockwise from above) at which a scan ends and the next begins.
  double scan_start_deg = 0.0;
  double min_range_m = 0.1;  // nearer returns are of the housing
  // Adds the height at which each beam leaves the optics (VLP-16 manual, "Vertical Correction"; up
  // to 11 mm). Off: all beams leave the origin, as ROS 2 drivers compute their clouds.
  bool vertical_offsets = true;
  // Factory bytes are believed where this is kUnknown.
  VelodyneModel model = VelodyneModel::kUnknown;
};

// Turns Velodyne data packets (1206 bytes of UDP payload; single, last and dual return) into scans.
//
// Points are in the frame of ROS drivers: x where the azimuth is 0 (away from the cable), y left,
// z up; metres. Times are of each firing, azimuths interpolated between the packet's blocks at the
// rate measured inside the packet. Rings count from the lowest beam up. In dual-return packets the
// strongest return has return_index 0, the last one 1; where both are the same only one is kept.
//
// Absolute time: the packet's microseconds since the hour are joined with the hour of position
// packets that have a valid fix, else of the `stamp` given with the packet. Where sensor clock and
// stamp differ by more than a second (no GNSS at the sensor) and there are no position packets, the
// sensor's clock gives the differences and the stamps, smoothed, the offset.
// Damaged packets are passed over with a warning ("recording.damaged"). Not thread-safe.
class VelodyneDecoder {
 public:
  static constexpr std::size_t kDataPacketSize = 1206;
  static constexpr std::size_t kPositionPacketSize = 512;

  // `source` names the stream in warnings ("drive.pcap", "drive.bag /velodyne_packets").
  VelodyneDecoder(const VelodyneConfig& config, std::string source, Log& log);

  // `stamp` is when the packet was received. Any bytes of any size are survived.
  void add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp);
  // A position packet; the fix in its NMEA sentence, if it holds a new and valid one. `set_clock`
  // = false leaves the decoder's time base alone.
  std::optional<GnssFix> add_position_packet(const std::uint8_t* data, std::size_t size,
                                             TimeNs stamp, bool set_clock = true);

  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan();
  // Ends the scan in progress; at the end of the stream.
  void finish();

  [[nodiscard]] VelodyneModel model() const { return model_; }
  // "VLP-16", "HDL-32E", "VLP-32C", "" before the first packet.
  [[nodiscard]] std::string model_name() const;
  // "dual return; firing times from the manual; time from position packets" for `info`.
  [[nodiscard]] std::string conventions() const;
  [[nodiscard]] std::uint64_t packets() const { return packets_; }

 private:
  struct Block {
    int azimuth_cdeg = 0;
    const std::uint8_t* returns = nullptr;
  };
  struct PacketView {
    std::array<Block, 12> blocks;
    bool dual = false;
    TimeNs stamp = 0;
    double cdeg_per_us = 0.0;
  };

  [[nodiscard]] bool accept_format(const std::uint8_t* data, TimeNs stamp);
  [[nodiscard]] bool read_blocks(const std::uint8_t* data, PacketView& packet);
  [[nodiscard]] TimeNs packet_time(std::uint32_t microseconds, TimeNs stamp);
  void decode_blocks(const PacketView& packet);
  void decode_firings(const PacketView& packet, std::size_t block, int firing);
  void add_return(const PacketView& packet, std::size_t block, int firing, int laser,
                  double azimuth_cdeg, TimeNs time, std::uint8_t return_index);
  void advance_azimuth(double azimuth_cdeg);
  void close_scan();
  void damaged(const std::string& what);

  VelodyneConfig config_;
  std::string source_;
  Log& log_;
  VelodyneModel model_ = VelodyneModel::kUnknown;
  std::uint8_t return_mode_ = 0;
  std::uint64_t packets_ = 0;

  std::optional<TimeNs> hour_;  // UTC hour of the last position packet, at hour_seen_
  TimeNs hour_seen_us_ = 0;     // its microseconds since the hour
  bool free_running_ = false;   // sensor clock unrelated to the stamps
  TimeNs offset_ = 0;           // stamp minus unwrapped sensor time, smoothed
  TimeNs unwrapped_us_ = -1;    // sensor time without the wrap at the hour
  std::uint32_t last_us_ = 0;
  bool time_from_position_ = false;
  std::int64_t last_fix_second_ = -1;

  double last_azimuth_cdeg_ = -1.0;
  std::vector<ScanPoint> points_;  // of the scan in progress
  std::vector<TimeNs> point_times_;
  std::deque<ScanPtr> finished_;
};

}  // namespace understory
