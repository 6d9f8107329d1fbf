#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "understory/util/time.h"

namespace understory {

// One stem as seen in one frame: a point on its centre line, its foot where seen, and the direction
// of the line. Body frame, metres; NaN where unknown.
struct Stem {
  static constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  Eigen::Vector3f axis = Eigen::Vector3f::Constant(kUnknown);  // unit length
  float length_m = kUnknown;
  float dbh_m = kUnknown;
  float score = kUnknown;  // 0..1, higher is surer
  float radius_m = kUnknown;
  float radius_sd_m = kUnknown;
  // Variances of the point and the covariance of its x and y, square metres.
  float xx = kUnknown;
  float xy = kUnknown;
  float yy = kUnknown;
  float zz = kUnknown;
};

// The stems of one frame (a scan, or a short piece of the way put together).
struct StemView {
  int frame = 0;  // as numbered in the input
  TimeNs stamp = 0;
  std::vector<Stem> stems;
};

}  // namespace understory
