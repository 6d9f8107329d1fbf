#pragma once

#include <string>
#include <vector>

#include "understory/util/error.h"

namespace understory {

// "sim:handheld?seed=3&lidar.rays_per_beam=1" in its parts.
struct SimulationUri {
  std::string site;
  std::vector<std::string> settings;
};
[[nodiscard]] bool is_simulation_uri(const std::string& text);
// Throws ConfigError if the text is no such URI.
[[nodiscard]] SimulationUri parse_simulation_uri(const std::string& text);

// Throws the error anew. Its problems then name the URI, where whoever wrote it has no --set.
[[noreturn]] void rethrow_of_uri(const SimulationUri& uri, const ConfigError& error);

// What `work` returns; a ConfigError of its settings names the URI.
template <typename Work>
[[nodiscard]] auto with_problems_of(const SimulationUri& uri, const Work& work) {
  try {
    return work();
  } catch (const ConfigError& error) {
    rethrow_of_uri(uri, error);
  }
}

}  // namespace understory
