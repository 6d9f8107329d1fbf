#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/registration/registration_constants.h"

// The steps from a guess that may be far off: they only look for where the last ones begin.
namespace understory::internal {

// Limits of such steps, in any settings with the names of describe_steps.h.
template <typename Steps>
[[nodiscard]] Steps wide_steps(Steps steps) {
  using namespace registration_constants::wide_steps;
  steps.step_translation_m = std::max(steps.step_translation_m, kTranslation);
  steps.step_rotation_rad = std::max(steps.step_rotation_rad, kRotation);
  return steps;
}

// What of a source they take: every so-manieth of some values, one a point.
template <typename Value>
[[nodiscard]] std::vector<Value> wide_part(const std::vector<Value>& of_points) {
  using namespace registration_constants::wide_steps;
  const std::size_t every = std::clamp<std::size_t>(of_points.size() / kEnough, 1, kEvery);
  std::vector<Value> part;
  part.reserve(of_points.size() / every + 1);
  for (std::size_t i = 0; i < of_points.size(); i += every)
    part.push_back(of_points[i]);
  return part;
}

}  // namespace understory::internal
