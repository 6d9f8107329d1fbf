#pragma once

#include <Eigen/Core>
#include <optional>

#include "understory/sensor/rig.h"

namespace understory {

// Where the second antenna is in the body frame, metres; nothing unless the first one's place is
// known, too.
[[nodiscard]] inline std::optional<Eigen::Vector3d> second_antenna_of(const Rig& rig) {
  if (!rig.body_from_gnss || !rig.body_from_second_gnss) return std::nullopt;
  return rig.body_from_second_gnss->translation();
}

}  // namespace understory
