#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

namespace understory {

// Points in single precision, metres, relative to an origin near them (body or local frame).
using Points = std::vector<Eigen::Vector3f>;

// Every second, third or `most`-th point: the fewest that still are `enough`.
[[nodiscard]] inline Points thin_evenly(const Points& points, std::size_t enough,
                                        std::size_t most) {
  const std::size_t stride = std::clamp<std::size_t>(points.size() / enough, 1, most);
  Points thinned;
  thinned.reserve(points.size() / stride + 1);
  for (std::size_t i = 0; i < points.size(); i += stride)
    thinned.push_back(points[i]);
  return thinned;
}

}  // namespace understory
