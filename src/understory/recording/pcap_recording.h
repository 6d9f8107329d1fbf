#pragma once

#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// A capture of what the sensors sent: Velodyne data and position packets, Ouster lidar and IMU
// packets. Throws InputError if the file is no capture or holds no lidar.
[[nodiscard]] bool is_pcap(const std::string& path);
[[nodiscard]] std::unique_ptr<Recording> open_pcap(const std::string& path,
                                                   const OpenOptions& options, Log& log);

}  // namespace understory
