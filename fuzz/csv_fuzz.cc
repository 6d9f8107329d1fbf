#include "fuzz_input.h"
#include "understory/recording/clouds/csv_events.h"
#include "understory/util/error.h"

// imu.csv and gnss.csv.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  try {
    CsvImuReader imu(fuzz_source(data, size), log);
    while (imu.next()) {
    }
  } catch (const InputError&) {
  }
  try {
    CsvGnssReader gnss(fuzz_source(data, size), log);
    while (gnss.next()) {
    }
  } catch (const InputError&) {
  }
  return 0;
}
