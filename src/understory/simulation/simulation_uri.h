#pragma once

#include <string>
#include <vector>

namespace understory {

// "sim:handheld?seed=3&lidar.rays_per_beam=1" in its parts.
struct SimulationUri {
  std::string site;
  std::vector<std::string> settings;
};
[[nodiscard]] bool is_simulation_uri(const std::string& text);
// Throws ConfigError if the text is no such URI.
[[nodiscard]] SimulationUri parse_simulation_uri(const std::string& text);

}  // namespace understory
