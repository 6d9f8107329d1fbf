#include "fuzz_file.h"
#include "understory/evaluation/trajectory.h"
#include "understory/util/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const FuzzFile file(data, size);
  try {
    (void)read_trajectory(file.path());
  } catch (const InputError&) {
  }
  return 0;
}
