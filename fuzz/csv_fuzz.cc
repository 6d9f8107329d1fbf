#include "fuzz_file.h"
#include "understory/recording/clouds/csv_events.h"
#include "understory/util/error.h"

// imu.csv and gnss.csv.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const FuzzFile file(data, size);
  Log log;
  try {
    CsvImuReader imu(file.path(), log);
    while (imu.next()) {
    }
  } catch (const InputError&) {
  }
  try {
    CsvGnssReader gnss(file.path(), log);
    while (gnss.next()) {
    }
  } catch (const InputError&) {
  }
  return 0;
}
