#include <algorithm>
#include <cstring>
#include <vector>

#include "fuzz_input.h"
#include "understory/recording/captures/hesai/hesai.h"

// Packets one after another. Before each stand two bytes: by them its stamp advances, and its
// length is chosen among those of the models.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  HesaiDecoder decoder({}, "fuzz", log);
  constexpr std::size_t kSizes[] = {1080, 568, 1198, 1072};
  TimeNs stamp = 1'700'000'000 * kNsPerSecond;
  std::size_t at = 0;
  while (at + 2 < size) {
    std::uint16_t step = 0;
    std::memcpy(&step, data + at, 2);
    at += 2;
    stamp += static_cast<TimeNs>(step / 4) * 100'000;
    const std::size_t got = std::min(kSizes[step % 4], size - at);
    const std::vector<std::uint8_t> packet(data + at, data + at + got);
    decoder.add_packet(packet.data(), packet.size(), stamp);
    while (decoder.take_scan() != nullptr) {
    }
    at += got;
  }
  decoder.finish();
  (void)decoder.conventions();
  return 0;
}
