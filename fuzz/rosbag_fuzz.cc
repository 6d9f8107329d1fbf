#include "fuzz_recording.h"
#include "understory/recording/bags/rosbag_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  read_as_recording(data, size, [](const std::vector<std::uint8_t>& bytes, Log& log) {
    return read_rosbag(bytes_in_memory(bytes, "fuzz"), log);
  });
  return 0;
}
