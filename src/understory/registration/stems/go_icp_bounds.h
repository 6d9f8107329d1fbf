#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/registration/icp/nearest_table.h"
#include "understory/registration/stems/sparse_icp.h"

namespace understory {

// A box of motions about a guess. The guess turns the source, the rotation vector (tilt x, tilt y,
// 0) tilts it, then it is turned by the yaw about the vertical and shifted. Radians and metres.
struct GoIcpBox {
  enum Side : std::size_t { kYaw, kTiltX, kTiltY, kX, kY, kZ, kSides };
  using Sides = Eigen::Matrix<double, kSides, 1>;

  Sides middle = Sides::Zero();
  Sides half = Sides::Zero();  // half the length of each side; 0: not searched
  double bound_m = 0.0;        // no motion in it has a smaller error
  std::int64_t number = 0;

  // Largest shift, yaw and tilt that a motion in the box has from its middle.
  [[nodiscard]] double half_shift() const { return half.segment<3>(kX).norm(); }
  [[nodiscard]] double half_yaw() const { return half[kYaw]; }
  [[nodiscard]] double half_tilt() const { return half.segment<2>(kTiltX).norm(); }

  // The middle's turn, to be made after the guess's.
  [[nodiscard]] Eigen::Quaterniond turn() const;
  [[nodiscard]] Pose target_from_source(const Pose& guess) const;
  // The motion's place in the coordinates of the sides: a box of no size.
  [[nodiscard]] static Sides sides_of(const Pose& target_from_source, const Pose& guess);
};

// What one box of motions comes to.
struct GoIcpErrors {
  double at_middle_m;  // trimmed root mean square error at the middle of the box
  double bound_m;      // no motion in the box has a smaller one
};

// The trimmed error over boxes, P0 (22): every point's distance at the middle, less what the
// motions of the box can bring it nearer. In the plane points are as near as their feet, and boxes
// have neither tilt nor height; in space heights count, and both are searched.
class GoIcpBounds {
 public:
  enum class Metric { kPlane, kSpace };

  // `margin_m`: how far beyond the target's points sources may come. At least `kFewestStems` source
  // points.
  GoIcpBounds(const SparseTarget& target, const SparsePoints& source, const Pose& guess,
              Metric metric, double outlier_ratio, double margin_m);

  [[nodiscard]] GoIcpErrors of(const GoIcpBox& box);
  // How far the side of half that length moves the points, in the mean.
  [[nodiscard]] double motion_m(GoIcpBox::Side side, double half) const;
  // P0's R: the farthest source point's distance in the plane.
  [[nodiscard]] double reach_m() const { return reach_m_; }

 private:
  void in_plane(const GoIcpBox& box);
  void in_space(const GoIcpBox& box);
  [[nodiscard]] double trimmed(std::vector<double>& squared) const;

  const PlaneGrid& grid_;
  NearestTable table_;
  Metric metric_;
  std::size_t keep_;
  Eigen::Vector3d origin_;
  SparsePoints points_;  // turned by the guess
  std::vector<double> radii_;
  std::vector<double> lengths_;
  double mean_radius_m_ = 0.0;
  double reach_m_ = 0.0;
  std::vector<double> middle_;  // squared distances of all points
  std::vector<double> lower_;
};

}  // namespace understory
