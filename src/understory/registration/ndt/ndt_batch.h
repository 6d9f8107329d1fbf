#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "understory/registration/match_sums.h"
#include "understory/registration/ndt/ndt_map.h"

namespace understory::internal {

// Sums over a block of points, in axes of the target around the source's origin.
struct NdtSums : MatchCounts {
  // Upper triangle of sum of w j j^T, each row followed by its part of the gradient. Row i has the
  // columns i..5 and the residual.
  std::array<float, 27> hessian{};
  std::array<std::array<float, 6>, 6> exact{};  // what the exact Hessian has beyond that
};

// exp(x) for x <= 0 to 2e-7, without branches or calls, so that loops over it become vector code.
[[nodiscard]] inline float exp_of_negative(float x) {
  const float t = std::max(x * 1.44269504F, -120.0F);
  const int whole = static_cast<int>(t - 0.5F);
  const float f = (t - static_cast<float>(whole)) * 0.693147181F;  // within half of log 2
  const float series =
      1.0F +
      f * (1.0F + f * (0.5F + f * (0.166666667F + f * (0.0416666667F + f * (0.00833333333F +
                                                                            f * 0.00138888889F)))));
  return series * std::bit_cast<float>((whole + 127) << 23);
}

// Matches of points with cells, gathered row by row as parallel arrays and summed up together: the
// sums run over eight rows at a time.
class NdtBatch {
 public:
  static constexpr std::size_t kRows = 512;

  [[nodiscard]] bool full() const { return rows_ + 3 > kRows; }

  // `offset` of the point from the mean of the cell, `lever` of the point from the source's origin,
  // both in axes of the target. Only for cells that have rows.
  void add(const NdtCell& cell, const Eigen::Vector3f& offset, const Eigen::Vector3f& lever,
           float share) {
    float squared = 0.0F;
    for (int k = 0; k < cell.rows; ++k) {
      const Eigen::Vector3f& a = cell.row[static_cast<std::size_t>(k)];
      const float e = a.x() * offset.x() + a.y() * offset.y() + a.z() * offset.z();
      const std::size_t r = rows_++;
      j_[0][r] = lever.y() * a.z() - lever.z() * a.y();
      j_[1][r] = lever.z() * a.x() - lever.x() * a.z();
      j_[2][r] = lever.x() * a.y() - lever.y() * a.x();
      j_[3][r] = a.x();
      j_[4][r] = a.y();
      j_[5][r] = a.z();
      j_[6][r] = e;
      match_of_row_[r] = static_cast<std::uint16_t>(matches_);
      squared += e * e;
    }
    const Eigen::Vector3f& first = cell.row[0];
    const float e = first.dot(offset);
    q_[matches_] = squared;
    share_[matches_] = share;
    row_count_[matches_] = static_cast<float>(cell.rows);
    surface_[matches_] = e * e / first.squaredNorm();
    ++matches_;
  }

  // Adds everything to the sums and starts anew. The weight of a match is pull * exp(-d2 q / 2).
  void flush(float d2, float pull, NdtSums& sums);

 private:
  void add_products(NdtSums& sums);

  alignas(32) float j_[7][kRows];
  alignas(32) float row_weight_[kRows];
  alignas(32) float q_[kRows];
  alignas(32) float share_[kRows];
  alignas(32) float weight_[kRows];
  float row_count_[kRows];
  float surface_[kRows];
  std::uint16_t match_of_row_[kRows];
  std::size_t rows_ = 0;
  std::size_t matches_ = 0;
};

}  // namespace understory::internal
