#pragma once

#include <Eigen/Core>
#include <functional>

#include "understory/geometry/raster.h"

namespace understory {

// The way of points from the frame of a raster to another, and back.
struct FrameChange {
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> to_target;
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> to_source;
  double cell_ratio = 1.0;  // units of the target's plane per unit of the source's
  bool none = false;        // both frames are one: cells stay as they are
};

// What the cells of a raster hold: ground, or heights above it, which a change of the frame leaves
// as they are.
enum class CellHeights { kOfGround, kAboveGround };

// A raster laid anew over cells of the other frame, with its north up. `ground` (in the frame of
// `own`) says how high the cells lie: a tilt moves what is high aside.
[[nodiscard]] Raster moved_raster(const Raster& own, const Raster& ground,
                                  const FrameChange& change, CellHeights heights);

}  // namespace understory
