#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/ground/ground.h"
#include "understory/forest/stems/standing_direction.h"

namespace understory {

// The direction of a cloud's own frame that points up.
enum class UpAxis { kZ, kMinusZ, kX, kMinusX, kY, kMinusY };
inline constexpr std::array<UpAxis, 6> kUpAxes = {
    UpAxis::kZ, UpAxis::kMinusZ, UpAxis::kX, UpAxis::kMinusX, UpAxis::kY, UpAxis::kMinusY};
[[nodiscard]] std::string to_string(UpAxis axis);  // "z", "-z", "x" ...
// The rotation that turns this direction of the cloud's frame to +z.
[[nodiscard]] Eigen::Matrix3d upright_from_cloud(UpAxis axis);

// What tells whether a cloud is a stand in metres with z up. Thresholds and where they come from:
// docs/method/forest.md. Lengths are in the unit of the cloud, which may be wrong.
struct CloudShape {
  std::size_t points = 0;                            // looked at: 400,000 at most
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();  // between the 0.2 and 99.8 percentiles
  // Median step of the lowest points from cell to cell that is no slope, over the size of a cell.
  // One value for each axis taken as up (order of kUpAxes). Ground: under 0.2. NaN: too few cells.
  std::array<double, 6> roughness{};
  // From the lowest to the highest point of a column, less what the ground rises within it. Nine
  // tenths of the columns are lower. NaN: too few columns.
  double column_height = 0.0;
  // Of the plane through the lowest points, z = slope * (x, y) + constant; NaN: unknown.
  Eigen::Vector2d ground_slope = Eigen::Vector2d::Zero();
  double ground_slope_deg = 0.0;
  double alone_share = 0.0;  // of points without another one in their cube of 3 units
  std::optional<StandingDirection> standing;  // where the ground is known
};
// Deterministic; two runs through the cloud.
[[nodiscard]] CloudShape shape_of(const PointBlocks& cloud);
// Of every `step`-th point of a cloud, about the first one.
[[nodiscard]] CloudShape shape_of_sample(const std::vector<Eigen::Vector3d>& points,
                                         std::size_t step);

// The axis that is up, if that is clearly not z.
[[nodiscard]] std::optional<UpAxis> other_up_axis(const CloudShape& shape);
// The direction along which stems stand, if that is clearly not z: unit vector, cloud frame.
[[nodiscard]] std::optional<Eigen::Vector3d> leaning_axis(const CloudShape& shape);
// Why z is not up, in words for the user; empty: nothing speaks against it.
[[nodiscard]] std::string up_complaint(const CloudShape& shape);
// Why the unit cannot be the metre, what it looks like; empty: nothing speaks against it.
[[nodiscard]] std::string unit_complaint(const CloudShape& shape);
// Why the unit may be the foot; empty: the stand is none that is tall for metres. There are trees
// that are so tall: no reason to refuse a cloud.
[[nodiscard]] std::string feet_suspicion(const CloudShape& shape);

}  // namespace understory
