#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/points.h"

namespace understory {

// What one lidar saw from one place: the range of returns by direction, in pixels of a degree.
// Immutable, thread-safe.
class RangeView {
 public:
  // `points`: any frame, metres; `eye`: the place in that frame.
  RangeView(const Points& points, const Eigen::Vector3f& eye);

  // Whether the points can have been seen from that place at one time. Most points then lie about
  // as far as the nearest one of their pixel. A map, or a cloud in another frame, has them one
  // behind the other.
  [[nodiscard]] bool is_one_view() const { return one_view_; }

  // How a point in the same frame lies against what was seen.
  enum class Sight {
    kUnknown,      // nothing was seen in that direction, or only nearer things
    kSeen,         // as far as what was seen
    kSeenThrough,  // nearer than all that was seen there: the place was free
  };
  [[nodiscard]] Sight look(const Eigen::Vector3f& point) const;

 private:
  struct Pixel {
    float nearest;
    float farthest;
    int count;
  };
  [[nodiscard]] int pixel_of(const Eigen::Vector3f& from_eye, float range) const;

  Eigen::Vector3f eye_;
  bool one_view_ = false;
  std::vector<Pixel> pixels_;
};

}  // namespace understory
