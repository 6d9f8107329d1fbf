#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace understory {

// The direction that stems, poles and walls share.
struct StandingDirection {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // unit vector in the frame of the points
  // How often two points share a column along the axis (0.5 m wide), over how often they lie in two
  // columns next to each other. 1: nothing stands along it.
  double gain = 1.0;
  double gain_of_z = 1.0;  // the same along z, within 6 degrees
};

// Looked for among the directions within 72 degrees of z. `points` are those of a stand in metres.
// `up_slope` is the gradient of the plane through its ground (z = up_slope * (x, y) + constant),
// above which they have to stand. Nothing if too few points stand above the ground. Deterministic.
[[nodiscard]] std::optional<StandingDirection> standing_direction(
    const std::vector<Eigen::Vector3d>& points, const Eigen::Vector2d& up_slope);

}  // namespace understory
