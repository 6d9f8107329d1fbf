#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/util/progress.h"

namespace understory {

// A place of a slice where points stand denser than around it.
struct DensityPeak {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // m, in the frame of the points
  double contrast = 0.0;  // points of its core above those expected, in standard deviations
};

// The peaks of the points of one slice (metres). A core of 2.5 cm is compared with the square of
// 42 cm around it. What is farther away does not matter, nor does the order of the points. Sorted
// by blocks of 8 m, by rows within. Polls `progress`.
[[nodiscard]] std::vector<DensityPeak> find_density_peaks(
    const std::vector<Eigen::Vector2f>& points, const ProgressSink& progress);

}  // namespace understory
