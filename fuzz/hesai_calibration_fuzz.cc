#include "fuzz_file.h"
#include "understory/recording/captures/hesai/hesai_calibration.h"
#include "understory/util/error.h"

// The bytes as an angle correction file and as a firing time file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const FuzzFile file(data, size);
  HesaiCalibration calibration;
  try {
    read_hesai_angles(file.path(), calibration);
  } catch (const InputError&) {
  }
  try {
    read_hesai_firing_times(file.path(), calibration);
  } catch (const InputError&) {
  }
  return 0;
}
