#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/captures/velodyne_clock.h"
#include "understory/recording/captures/velodyne_tables.h"
#include "understory/recording/first_scan.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// How packets of Velodyne become scans.
struct VelodyneConfig {
  // Azimuth (clockwise from above) at which a scan ends and the next begins.
  double scan_start_deg = 0.0;
  double min_range_m = 0.1;  // nearer returns are of the housing
  // Adds the height at which each beam leaves the optics (VLP-16 manual, "Vertical Correction"; up
  // to 11 mm). Off: all beams leave the origin, as the nebula driver for ROS 2 has it.
  bool vertical_offsets = true;
  // Factory bytes are used where this is kUnknown.
  VelodyneModel model = VelodyneModel::kUnknown;
};

// Turns Velodyne data packets (1206 bytes of UDP payload; single, last and dual return) into scans.
//
// Points are in the frame of ROS drivers: x where the azimuth is 0 (away from the cable), y left,
// z up; metres. Times are of each firing, azimuths interpolated between the packet's blocks. Rings
// count from the lowest beam up. In dual-return packets the brighter return has return_index 0, the
// other 1; where both are the same only one is kept.
//
// Absolute time is the hour plus the packet's microseconds since the hour. The hour comes from
// position packets with a valid fix, else from the `stamp` given with the packet. Sensor clock and
// stamp may differ by more than a second (no GNSS at the sensor). The sensor's clock then gives the
// differences, and the smoothed stamps give the offset. Damaged packets, and those that come twice
// in a row, are passed over with a warning ("recording.damaged_packet"). Not thread-safe.
class VelodyneDecoder {
 public:
  static constexpr std::size_t kDataPacketSize = 1206;
  static constexpr std::size_t kPositionPacketSize = 512;

  // `source` names the stream in warnings ("drive.pcap", "drive.bag: /velodyne_packets").
  VelodyneDecoder(const VelodyneConfig& config, std::string source, Log& log);

  // `stamp` is when the packet was received. Any bytes of any size are survived.
  void add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp);
  // A position packet. It sets the clock, and the fix in its NMEA sentence is given if it is new
  // and valid.
  std::optional<GnssFix> add_position_packet(const std::uint8_t* data, std::size_t size);
  // Joins a position packet's time of day with the data packets' clock. False if the packet has no
  // valid fix or the sensor is not locked to it.
  bool set_clock(const std::uint8_t* data, std::size_t size);

  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan();
  // Ends the scan in progress; at the end of the stream. A first scan that is only a part of a turn
  // is left out (FinishedScans).
  void finish();

  // All that has come in so far and is not given out yet, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

  [[nodiscard]] VelodyneModel model() const { return model_; }
  // "VLP-16", "HDL-32E"; "" before the first packet.
  [[nodiscard]] const std::string& model_name() const { return table_.name; }
  // For `info`: "dual return; time from position packets; ...".
  [[nodiscard]] std::string conventions() const;
  // Packets decoded so far.
  [[nodiscard]] std::uint64_t packets() const { return packets_; }

 private:
  static constexpr std::size_t kBlocks = 12;
  struct Block {
    const std::uint8_t* returns = nullptr;  // null: damaged
    double azimuth_cdeg = 0.0;
    double cdeg_per_us = 0.0;
  };
  using Blocks = std::array<Block, kBlocks>;
  struct Shot {
    double azimuth_cdeg = 0.0;
    TimeNs time = 0;
  };

  [[nodiscard]] bool accept_model(std::uint8_t product_byte);
  [[nodiscard]] bool comes_twice(const std::uint8_t* data, std::uint32_t counter_us);
  [[nodiscard]] Blocks read_blocks(const std::uint8_t* data);
  [[nodiscard]] double sequence_start_us(std::size_t block, int sequence) const;
  void set_rates(Blocks& blocks);
  void decode_sequence(const Blocks& blocks, std::size_t block, int sequence, TimeNs packet_time);
  void add_returns(const std::uint8_t* first, const std::uint8_t* second, std::size_t laser,
                   const Shot& shot);
  void add_return(const std::uint8_t* raw, std::size_t laser, const Shot& shot,
                  std::uint8_t return_index);
  void turn_to(double azimuth_cdeg, TimeNs time);
  void close_scan();
  void damaged(const std::string& what);

  VelodyneConfig config_;
  std::string source_;
  Log& log_;
  VelodyneModel model_ = VelodyneModel::kUnknown;
  VelodyneModel contradicting_ = VelodyneModel::kUnknown;
  VelodyneTable table_;
  VelodyneClock clock_;
  bool dual_ = false;
  std::uint8_t return_mode_ = 0;
  std::uint64_t packets_ = 0;
  std::uint64_t received_ = 0;
  TimeNs last_fix_ = -1;
  // Time, first and last azimuth of the last packet; none has 2^32 - 1 microseconds.
  std::array<std::uint32_t, 3> last_marks_ = {0xFFFFFFFFU, 0, 0};
  double rate_cdeg_per_us_ = 0.36;
  double turned_cdeg_ = -1.0;  // azimuth since the scan's start angle; -1: no scan yet
  TimeNs scan_begin_ = 0;
  GrowingScan growing_;
  double missing_cdeg_ = -1.0;  // of the scan in progress, at its beginning; -1: no firing yet
  FinishedScans finished_;
};

}  // namespace understory
