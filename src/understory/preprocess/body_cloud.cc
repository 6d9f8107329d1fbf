#include "understory/preprocess/body_cloud.h"

#include <algorithm>

#include "understory/sensor/rig.h"

namespace understory {

std::vector<std::uint8_t> lidars_of(const std::vector<std::uint16_t>& rings) {
  std::vector<std::uint8_t> lidars;
  if (std::none_of(rings.begin(), rings.end(), [](auto ring) { return ring >= kRingsALidar; }))
    return lidars;
  lidars.reserve(rings.size());
  for (const std::uint16_t ring : rings)
    lidars.push_back(static_cast<std::uint8_t>(ring / kRingsALidar));
  return lidars;
}

}  // namespace understory
