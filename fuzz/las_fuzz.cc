#include "fuzz_input.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"

// LASzip does not free all it has read of a header that it then refuses.
extern "C" int __lsan_is_turned_off() {
  return 1;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  try {
    const auto file = fuzz_source(data, size);
    (void)read_cloud(*file, log);
  } catch (const InputError&) {
  }
  return 0;
}
