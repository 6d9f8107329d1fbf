#include <algorithm>

#include "fuzz_input.h"
#include "understory/recording/captures/ouster.h"

namespace {

understory::OusterMetadata small_sensor(std::uint8_t profile) {
  understory::OusterMetadata metadata;
  metadata.profile = static_cast<understory::OusterProfile>(profile % 5);
  metadata.pixels_per_column = 4;
  metadata.columns_per_packet = 2;
  metadata.columns_per_frame = 16;
  metadata.beam_altitude_deg = {10.0, 3.0, -3.0, -10.0};
  metadata.beam_azimuth_deg = {4.0, 1.0, -1.0, -4.0};
  return metadata;
}

}  // namespace

// The first byte chooses the profile; packets of the right size follow, the last may be short.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  if (size < 1) return 0;
  const OusterMetadata metadata = small_sensor(data[0]);
  Log log;
  OusterDecoder decoder(metadata, "fuzz", log);
  std::size_t at = 1;
  while (at < size) {
    const bool imu = data[at] == 'i';
    const std::size_t want = imu ? kOusterImuPacketSize : metadata.lidar_packet_size();
    const std::size_t got = std::min(want, size - at);
    // A copy of exactly these bytes, so that the sanitizer sees reads beyond them.
    const std::vector<std::uint8_t> packet(data + at, data + at + got);
    if (imu) {
      (void)decoder.add_imu_packet(packet.data(), packet.size());
    } else {
      decoder.add_lidar_packet(packet.data(), packet.size());
    }
    while (decoder.take_scan() != nullptr) {
    }
    at += got;
  }
  decoder.finish();
  return 0;
}
