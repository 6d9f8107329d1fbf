#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <nanoflann.hpp>

#include "understory/geometry/points.h"

namespace understory {

// Nearest points in space, by nanoflann. The adaptor only looks at the points, which must outlive
// it and stay as they are. Include it in sources alone: the library is a heavy header.
struct KdTreePoints {
  const Points* points = nullptr;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points->size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return (*points)[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, KdTreePoints>,
                                        KdTreePoints, 3, std::uint32_t>;

}  // namespace understory
