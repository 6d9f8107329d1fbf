#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

#include "understory/forest/ground.h"

namespace understory {

// The direction of a cloud's own frame that points up.
enum class UpAxis { kZ, kMinusZ, kX, kMinusX, kY, kMinusY };
inline constexpr std::array<UpAxis, 6> kUpAxes = {
    UpAxis::kZ, UpAxis::kMinusZ, UpAxis::kX, UpAxis::kMinusX, UpAxis::kY, UpAxis::kMinusY};
[[nodiscard]] std::string to_string(UpAxis axis);  // "z", "-z", "x" ...
// The rotation that turns this direction of the cloud's frame to +z.
[[nodiscard]] Eigen::Matrix3d upright_from_cloud(UpAxis axis);

// What tells whether a cloud is a stand in metres with z up. Thresholds and where they come from:
// docs/forest.md. Lengths are in the unit of the cloud, which may be wrong.
struct CloudShape {
  std::size_t points = 0;                            // looked at: 400,000 at most
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();  // between the 0.2 and 99.8 percentiles
  // Median step of the lowest points from cell to cell that is no slope, over the size of a cell,
  // seen with each axis as up (order of kUpAxes). Ground: under 0.2. NaN: too few cells.
  std::array<double, 6> roughness{};
  // From the lowest to the highest point of a column that holds more than nine tenths of the
  // others, less what the ground rises within it. NaN: too few columns.
  double column_height = 0.0;
  double ground_slope_deg = 0.0;  // of the plane through the lowest points; NaN: unknown
  double alone_share = 0.0;       // of points without another one in their cube of 3 units
};
// Deterministic; two runs through the cloud.
[[nodiscard]] CloudShape shape_of(const PointBlocks& cloud);

// The axis that is up, if that is clearly not z.
[[nodiscard]] std::optional<UpAxis> other_up_axis(const CloudShape& shape);
// Why z is not up, in words for the user; empty: nothing speaks against it.
[[nodiscard]] std::string up_complaint(const CloudShape& shape);
// Why the unit cannot be the metre, what it looks like; empty: nothing speaks against it. Feet are
// too near to the metre to be told from the shape.
[[nodiscard]] std::string unit_complaint(const CloudShape& shape);

}  // namespace understory
