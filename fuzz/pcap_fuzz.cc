#include "fuzz_input.h"
#include "fuzz_place.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/util/error.h"

// The metadata of a small Ouster stands beside, so that both kinds of sensor are reached.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  for (const char* metadata : {"", UNDERSTORY_SOURCE_DIR "/fuzz/ouster_small.json"}) {
    Log log;
    OpenOptions options;
    options.metadata_file = metadata;
    try {
      const auto recording = open_pcap(fuzz_source(data, size), options, log);
      while (recording->next()) {
      }
      (void)recording->topics();
      expect_to_go_on([&] { return open_pcap(fuzz_source(data, size), options, log); });
    } catch (const InputError&) {
    }
  }
  return 0;
}
