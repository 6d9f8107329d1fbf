#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace understory {

// Points in single precision, metres, relative to an origin near them (body or local frame).
using Points = std::vector<Eigen::Vector3f>;

// Every second, third or `most`-th point: the fewest that still are `enough`. What stands in
// parallel to points is thinned like them.
template <typename Range = Points>
[[nodiscard]] std::vector<std::remove_cv_t<typename Range::value_type>> thin_evenly(
    const Range& points, std::size_t enough, std::size_t most) {
  const std::size_t stride = std::clamp<std::size_t>(points.size() / enough, 1, most);
  std::vector<std::remove_cv_t<typename Range::value_type>> thinned;
  thinned.reserve(points.size() / stride + 1);
  for (std::size_t i = 0; i < points.size(); i += stride)
    thinned.push_back(points[i]);
  return thinned;
}

}  // namespace understory
