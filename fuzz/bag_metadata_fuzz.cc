#include <string>

#include "fuzz_file.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/util/error.h"

// metadata.yaml of a ROS 2 bag.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  try {
    (void)bag_file_names(std::string(reinterpret_cast<const char*>(data), size), "fuzz");
  } catch (const ConfigError&) {
  }
  return 0;
}
