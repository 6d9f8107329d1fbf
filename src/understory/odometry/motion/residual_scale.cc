#include "understory/odometry/motion/residual_scale.h"

#include <algorithm>

#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::residual_scale;

}  // namespace

void ResidualScale::add(const Vector6d& residual, const Vector6d& variance) {
  count_ = std::min(count_ + 1, kMemory);
  const Vector6d square = residual.cwiseAbs2().cwiseQuotient(variance);
  mean_square_ += (square - mean_square_) / static_cast<double>(count_);
}

Matrix6d ResidualScale::scaled(const Matrix6d& covariance) const {
  if (count_ < kFewest) return covariance;
  const Vector6d factor =
      (kShared * mean_square_.cwiseSqrt()).cwiseMax(kSmallest).cwiseMin(kLargest);
  return factor.asDiagonal() * covariance * factor.asDiagonal();
}

void ResidualScale::save(BinaryWriter& writer) const {
  writer.put(count_);
  writer.put_doubles(mean_square_.data(), 6);
}

void ResidualScale::load(BinaryReader& reader) {
  count_ = reader.get<int>();
  reader.get_doubles(mean_square_.data(), 6);
}

}  // namespace understory
