#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

namespace understory {

// A cloud that is handed over block by block (a tile, a part of a file), so that it need not lie in
// memory. World frame, metres, z up. Every call runs through the whole cloud again, in the same
// order. NaN coordinates are not allowed.
using PointVisitor = std::function<void(std::span<const Eigen::Vector3d>)>;
using PointBlocks = std::function<void(const PointVisitor&)>;

}  // namespace understory
