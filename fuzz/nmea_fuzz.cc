#include <sstream>
#include <string>

#include "fuzz_input.h"
#include "understory/recording/captures/nmea.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const std::string text(reinterpret_cast<const char*>(data), size);
  Log log;
  std::istringstream ahead(text);
  std::istringstream stream(text);
  NmeaLogReader reader(stream, "fuzz", first_nmea_day(ahead, "fuzz"), log);
  while (reader.next()) {
  }
  return 0;
}
