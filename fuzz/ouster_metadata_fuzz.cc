#include <string>

#include "fuzz_input.h"
#include "understory/recording/captures/ouster.h"
#include "understory/util/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  try {
    const std::string text(reinterpret_cast<const char*>(data), size);
    const OusterMetadata metadata = parse_ouster_metadata(text, "fuzz");
    OusterDecoder decoder(metadata, "fuzz", log);
    const std::vector<std::uint8_t> packet(metadata.lidar_packet_size(), 0xFF);
    decoder.add_lidar_packet(packet.data(), packet.size());
    decoder.finish();
  } catch (const InputError&) {
  }
  return 0;
}
