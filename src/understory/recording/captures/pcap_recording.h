#pragma once

#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

class ByteSource;

// Whether a file begins as a capture (pcap, pcapng) does; false if it cannot be read.
[[nodiscard]] bool is_pcap(const std::string& path);

// A capture of what the sensors sent: Velodyne data and position packets, Ouster lidar and IMU
// packets. Of several lidars the one with most packets is read, or the one that `lidar_topic` names
// ("udp 2368"). An Ouster's metadata is `metadata_file`, else the only .json beside the capture
// whose name the capture's name begins with. Throws InputError if the file is no capture or holds
// no lidar that can be read.
[[nodiscard]] std::unique_ptr<Recording> open_pcap(const std::string& path,
                                                   const OpenOptions& options, Log& log);
// The same for bytes that need not be a file.
[[nodiscard]] std::unique_ptr<Recording> open_pcap(std::unique_ptr<ByteSource> source,
                                                   const OpenOptions& options, Log& log);

}  // namespace understory
