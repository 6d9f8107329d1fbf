#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace understory {

// The settings ("key=value") of a site that the seed draws: ground, stand, objects among the trees,
// carrier and scanner. The same seed gives the same settings.
[[nodiscard]] std::vector<std::string> drawn_settings(std::uint64_t seed);

}  // namespace understory
