#pragma once

#include "understory/geometry/pose.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How large the errors of a motion model are, beside what it states. The noise of a match and that
// of an IMU are stated with a margin, which says how they weigh against each other. The residuals
// tell their size: those of matches against the prediction, divided by their stated standard
// deviation. It is the variance of unit weight of an adjustment, taken for each degree of freedom
// on its own.
class ResidualScale {
 public:
  // A match was off its prediction by `residual` (right perturbation, rad and m, rotation first,
  // frame of the IMU). `variance` is its stated variance: that of the prediction and of the match,
  // each over 0.
  void add(const Vector6d& residual, const Vector6d& variance);
  // A covariance in the same frame with the standard deviations that the residuals speak for; as it
  // is before there are enough of them.
  [[nodiscard]] Matrix6d scaled(const Matrix6d& covariance) const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  int count_ = 0;
  Vector6d mean_square_ = Vector6d::Zero();  // of residuals over their standard deviation
};

}  // namespace understory
