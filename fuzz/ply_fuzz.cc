#include "fuzz_cloud.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return understory::fuzz_cloud(data, size, understory::read_ply);
}
