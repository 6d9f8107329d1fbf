#include "understory/pipeline/source.h"

#include "understory/simulation/simulator.h"

namespace understory {
namespace {

constexpr const char* kScheme = "sim:";

}  // namespace

bool is_simulation(const std::string& name) {
  return name.rfind(kScheme, 0) == 0;
}

std::unique_ptr<Recording> open_source(const std::string& name, const OpenOptions& options,
                                       Log& log) {
  if (is_simulation(name)) return open_simulation(name, log);
  return open_recording(name, options, log);
}

}  // namespace understory
