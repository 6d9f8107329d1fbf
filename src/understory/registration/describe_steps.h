#pragma once

#include "understory/util/config/config.h"

namespace understory::internal {

// The settings of Newton steps that every method of matching scans has, with the same names.
template <typename Config>
void describe_steps(ConfigTable& table, Config& config) {
  table.add("independent_share", config.independent_share, {1e-4, 1.0}, "",
            "share of matched points that counts as independent");
  table.add("max_iterations", config.max_iterations, {1, 1000}, "", "most steps of one match");
  table.add("max_step_m", config.max_step_m, {0.01, 10.0}, "m", "longest step");
  table.add("step_translation_m", config.step_translation_m, {1e-7, 0.1}, "m",
            "converged when a step is shorter");
  table.add("step_rotation_rad", config.step_rotation_rad, {1e-8, 0.1}, "rad",
            "converged when a step turns less");
  table.add("degenerate_ratio", config.degenerate_ratio, {0.0, 0.5}, "",
            "a direction with less of the strongest direction's information is undetermined");
  table.add("min_matches", config.min_matches, {6, 100000}, "",
            "fewer matched points are no match");
}

}  // namespace understory::internal
