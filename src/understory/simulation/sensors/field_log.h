#pragma once

#include <cstdint>
#include <fstream>
#include <string>

#include "understory/recording/recording.h"
#include "understory/simulation/sensors/lidar_model.h"
#include "understory/simulation/site.h"

namespace understory {

// Writes what a field computer keeps of a VLP-16 and a GNSS receiver. The scanner's data packets
// (strongest return) and position packets go to a capture (.pcap). The receiver's NMEA sentences
// (GGA, GSA, RMC, and PASHR of a second antenna) go to a log beside it. The scanner's cable points
// forwards, so that its azimuth 0, where drivers cut the scans, lies behind. A capture holds no
// extrinsics, so those that belong to it are written beside it, for `--extrinsics`.
//
// Files: NAME.pcap, NAME.nmea, NAME.extrinsics.yaml. Events come in the order of time; IMU and
// magnetometer samples are passed over. Throws OutputError. Not thread-safe.
class FieldLogWriter {
 public:
  // Only a VLP-16 can be written: ConfigError for others, for dual returns and for wrong clocks.
  FieldLogWriter(const std::string& pcap_path, const SiteConfig& site, const Rig& rig);

  void write(const Event& event);
  void finish();

 private:
  void write_scan(const Scan& scan);
  void write_fix(const GnssFix& fix);
  void write_record(TimeNs stamp, std::uint16_t port, const std::string& payload);
  void write_extrinsics(const std::string& path, const Rig& rig) const;

  std::string pcap_path_;
  std::string nmea_path_;
  LidarModel model_;
  TimeNs start_;
  std::ofstream pcap_;
  std::ofstream nmea_;
};

}  // namespace understory
