#include <sstream>
#include <string>

#include "fuzz_input.h"
#include "understory/recording/captures/rtklib.h"
#include "understory/util/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  std::istringstream stream(std::string(reinterpret_cast<const char*>(data), size));
  try {
    (void)read_rtklib_solution(stream, "fuzz", log);
  } catch (const InputError&) {
  }
  return 0;
}
