#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/bytes.h"
#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/captures/sensor_clock.h"
#include "understory/recording/first_scan.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// The head of a packet of a Livox, of both protocols.
struct LivoxHead {
  int protocol = 2;            // 1: Avia, Horizon, Mid-70; 2: Mid-360, HAP
  std::uint8_t data_type = 0;  // as the packet has it
  bool imu = false;
  std::size_t firings = 0;  // points, or groups of two or three returns
  std::size_t returns = 1;  // of a firing
  std::size_t firing_bytes = 0;
  std::size_t data_at = 0;     // where the points begin
  std::uint8_t time_type = 0;  // 0: since power-on; 3 of protocol 1: UTC with a date
  std::optional<TimeNs> time;  // of the first point; nothing if it is impossible
  double interval_ns = 0.0;    // from firing to firing; 0: the packet does not tell
  std::optional<std::uint16_t> counter;
};

// The head of a packet of points or of the IMU; nothing for other bytes. Sources: Livox LiDAR
// Communication Protocol Mid-360 1.4.11 (sections "Point Cloud & IMU Data Protocol") and Livox SDK
// Communication Protocol 1.3.0, section 3.
[[nodiscard]] std::optional<LivoxHead> livox_head(ByteSpan payload);

// How packets of a Livox become scans.
struct LivoxConfig {
  TimeNs scan = kNsPerSecond / 10;  // duration of a scan: the pattern has no turn
};

// Turns UDP packets of a Livox (protocol 2: Mid-360; protocol 1: Avia) into scans of an even
// duration and samples of its IMU.
//
// Points are in Livox's frame: x forward, y left, z up; metres. Firings of a packet are spread
// evenly over the interval that it states, or in protocol 1 over the time until the next packet.
// The ring is the line: the number of the firing modulo 4 (protocol 2) or 6 (protocol 1), as in
// Livox's drivers. Lines are no rings, so ring_count is 0. Points at zero range are left out. The
// tag is kept; in protocol 1 it numbers the returns. Not thread-safe.
class LivoxDecoder {
 public:
  // `source` names the stream in warnings.
  LivoxDecoder(const LivoxConfig& config, std::string source, Log& log);

  // A packet of points. `stamp` is when it was received. Any bytes of any size are survived.
  void add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp);
  // A packet of the IMU: rad/s, m/s^2, in Livox's frame. Nothing if it is damaged.
  [[nodiscard]] std::optional<ImuSample> add_imu_packet(const std::uint8_t* data, std::size_t size,
                                                        TimeNs stamp);
  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan() { return finished_.take(); }
  // Ends the scan in progress; at the end of the stream.
  void finish();

  // All that has come in so far and is not given out yet, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

  // For `info`: "cartesian, mm; 4 lines; time = sensor clock".
  [[nodiscard]] std::string conventions() const;

 private:
  struct Waiting {  // a packet of points whose interval the next one tells
    std::vector<std::uint8_t> bytes;
    TimeNs time = 0;
  };

  [[nodiscard]] bool accept(const LivoxHead& head, TimeNs time);
  void decode_waiting(TimeNs next);
  void decode(ByteSpan packet, const LivoxHead& head, TimeNs time, double interval_ns);
  void add_point(const std::uint8_t* raw, const LivoxHead& head, std::size_t firing,
                 std::size_t number, TimeNs time);
  void close_scan();
  void damaged(const std::string& what);

  LivoxConfig config_;
  std::string source_;
  Log& log_;
  SensorClock clock_;
  std::uint64_t received_ = 0;
  std::optional<std::uint16_t> counter_;
  std::optional<TimeNs> last_time_;
  std::optional<TimeNs> last_imu_;
  std::optional<Waiting> waiting_;
  double interval_ns_ = 0.0;
  std::uint8_t data_type_ = 0;
  int protocol_ = 0;
  TimeNs scan_begin_ = 0;
  GrowingScan growing_;
  FinishedScans finished_;
};

}  // namespace understory
