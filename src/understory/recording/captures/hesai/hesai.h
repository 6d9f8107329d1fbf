#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/captures/hesai/hesai_calibration.h"
#include "understory/recording/captures/hesai/hesai_tables.h"
#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/captures/sensor_clock.h"
#include "understory/recording/first_scan.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// How packets of Hesai become scans.
struct HesaiConfig {
  double scan_start_deg = 0.0;  // azimuth, clockwise from above, at which a scan ends
  double min_range_m = 0.1;     // nearer returns are of the housing
  HesaiCalibration calibration;
};

// Turns packets of PandarXT-32, PandarXT-16, Pandar64 and PandarQT64 (UDP payload; single and dual
// return) into scans.
//
// Points are in the frame of Hesai's drivers: y where the azimuth is 0, x to the right of it, z up;
// metres. An azimuth is that of the block and the channel's correction. With a firing time file the
// turn between block and firing is added, as Hesai's SDK does. Times are of each firing. Rings
// count from the lowest beam up. In dual-return packets the brighter return has return_index 0, the
// other 1; where both are the same only one is kept.
//
// Packets that are cut, doubled or of another sensor are passed over, and gaps in their sequence
// are counted ("recording.damaged_packet"). Not thread-safe.
class HesaiDecoder {
 public:
  // `source` names the stream in warnings.
  HesaiDecoder(HesaiConfig config, std::string source, Log& log);

  // `stamp` is when the packet was received. Any bytes of any size are survived. Throws InputError
  // if the calibration has another number of channels than the sensor.
  void add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp);
  // The next finished scan, or null. Call until null after each packet.
  [[nodiscard]] ScanPtr take_scan() { return finished_.take(); }
  // Ends the scan in progress; at the end of the stream.
  void finish();

  // All that has come in so far and is not given out yet, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

  // "PandarXT-32"; "" before the first packet.
  [[nodiscard]] const std::string& model_name() const { return table_.name; }
  // For `info`: "dual return; firing times per channel; ...".
  [[nodiscard]] std::string conventions() const;

 private:
  struct Beam {
    double cos_elevation = 1.0;
    double sin_elevation = 0.0;
    double cos_azimuth = 1.0;  // of the correction
    double sin_azimuth = 0.0;
    TimeNs firing_ns = 0;
    std::uint16_t ring = 0;
  };
  // A firing: two blocks of one in dual return.
  struct Firing {
    const std::uint8_t* first = nullptr;
    const std::uint8_t* second = nullptr;  // null: single return
    double cosine = 1.0;                   // of the block's azimuth
    double sine = 0.0;
    TimeNs time = 0;
  };

  [[nodiscard]] bool accept_model(ByteSpan packet);
  [[nodiscard]] bool is_whole(ByteSpan packet, const HesaiTable& table);
  [[nodiscard]] bool accept_sequence(ByteSpan packet);
  void set_model(HesaiModel model);
  void set_turn(double degrees_per_us);
  [[nodiscard]] TimeNs firing_time(TimeNs packet, std::size_t block, std::size_t returns) const;
  void decode_blocks(ByteSpan packet, std::size_t returns, TimeNs time);
  void decode_firing(const Firing& firing);
  void add_return(const std::uint8_t* raw, const Beam& beam, const Firing& firing,
                  std::uint8_t return_index);
  void turn_to(double azimuth_deg, TimeNs time);
  void close_scan();
  void damaged(const std::string& what);

  HesaiConfig config_;
  std::string source_;
  Log& log_;
  HesaiModel model_ = HesaiModel::kUnknown;
  HesaiModel contradicting_ = HesaiModel::kUnknown;
  HesaiTable table_;
  std::vector<Beam> beams_;
  double degrees_per_us_ = 0.0;  // that beams_ are made for
  SensorClock clock_;
  std::uint8_t return_mode_ = 0;
  double unit_m_ = 0.004;
  std::uint64_t received_ = 0;
  std::optional<std::uint32_t> sequence_;  // of the last packet
  double turned_deg_ = -1.0;               // azimuth since the scan's start angle; -1: no scan yet
  double missing_deg_ = -1.0;              // of the scan in progress, at its beginning
  TimeNs scan_begin_ = 0;
  GrowingScan growing_;
  FinishedScans finished_;
};

}  // namespace understory
