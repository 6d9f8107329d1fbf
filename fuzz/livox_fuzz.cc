#include <algorithm>
#include <cstring>
#include <vector>

#include "fuzz_input.h"
#include "understory/recording/captures/livox_packets.h"

// Packets one after another. Before each stand two bytes: by them its stamp advances, and its
// length is chosen among those of both protocols.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  LivoxDecoder decoder({}, "fuzz", log);
  constexpr std::size_t kSizes[] = {1380, 60, 804, 996, 1362, 978, 42, 1278};
  TimeNs stamp = 1'700'000'000 * kNsPerSecond;
  std::size_t at = 0;
  while (at + 2 < size) {
    std::uint16_t step = 0;
    std::memcpy(&step, data + at, 2);
    at += 2;
    stamp += static_cast<TimeNs>(step / 8) * 100'000;
    const std::size_t got = std::min(kSizes[step % 8], size - at);
    const std::vector<std::uint8_t> packet(data + at, data + at + got);
    (void)decoder.add_imu_packet(packet.data(), packet.size(), stamp);
    decoder.add_packet(packet.data(), packet.size(), stamp);
    while (decoder.take_scan() != nullptr) {
    }
    at += got;
  }
  decoder.finish();
  (void)decoder.conventions();
  return 0;
}
