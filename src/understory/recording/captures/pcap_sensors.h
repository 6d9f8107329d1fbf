#pragma once

#include <memory>
#include <string>

#include "understory/recording/captures/pcap_stream.h"

namespace understory {

// A capture of a Hesai whose packets are in the stream `lidar`. `calibration_file`: the sensor's
// angle correction, empty = what lies beside the capture. Throws InputError for a wrong
// calibration, and for a model that is not read.
[[nodiscard]] std::unique_ptr<PcapRecording> open_hesai_pcap(std::unique_ptr<PcapFile> file,
                                                             PcapSurvey survey, UdpStream lidar,
                                                             const std::string& calibration_file,
                                                             Log& log);

// A capture of a Livox whose packets of points are in the stream `lidar`. Its IMU is the stream of
// IMU packets from the same address.
[[nodiscard]] std::unique_ptr<PcapRecording> open_livox_pcap(std::unique_ptr<PcapFile> file,
                                                             PcapSurvey survey, UdpStream lidar,
                                                             Log& log);

}  // namespace understory
