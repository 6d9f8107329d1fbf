#include <algorithm>
#include <cstring>

#include "fuzz_input.h"
#include "understory/recording/captures/velodyne.h"

// Packets one after another, each with two bytes before it by which its stamp advances.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  VelodyneDecoder decoder({}, "fuzz", log);
  TimeNs stamp = 1'700'000'000 * kNsPerSecond;
  std::size_t at = 0;
  while (at + 2 < size) {
    std::uint16_t step = 0;
    std::memcpy(&step, data + at, 2);
    at += 2;
    stamp += static_cast<TimeNs>(step) * 1'000'000;
    const bool position = step % 8 == 7;
    const std::size_t want =
        position ? VelodyneDecoder::kPositionPacketSize : VelodyneDecoder::kDataPacketSize;
    const std::size_t got = std::min(want, size - at);
    const std::vector<std::uint8_t> packet(data + at, data + at + got);
    if (position) {
      (void)decoder.add_position_packet(packet.data(), packet.size());
    } else {
      decoder.add_packet(packet.data(), packet.size(), stamp);
    }
    while (decoder.take_scan() != nullptr) {
    }
    at += got;
  }
  decoder.finish();
  (void)decoder.conventions();
  return 0;
}
