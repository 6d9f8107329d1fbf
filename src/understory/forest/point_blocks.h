#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

#include "understory/util/progress.h"

namespace understory {

// A cloud that is handed over block by block (a tile, a part of a file), so that it need not lie in
// memory. World frame, metres, z up. Every call runs through the whole cloud again, in the same
// order. NaN coordinates are not allowed.
using PointVisitor = std::function<void(std::span<const Eigen::Vector3d>)>;
using PointBlocks = std::function<void(const PointVisitor&)>;

// The same cloud, which polls before each block. Both arguments must outlive it.
[[nodiscard]] inline PointBlocks polled(const PointBlocks& cloud, const ProgressSink& progress) {
  return [&cloud, &progress](const PointVisitor& visit) {
    cloud([&](std::span<const Eigen::Vector3d> points) {
      progress.poll();
      visit(points);
    });
  };
}

}  // namespace understory
