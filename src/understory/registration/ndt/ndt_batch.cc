#include "understory/registration/ndt/ndt_batch.h"

#include <cstring>

namespace understory::internal {
namespace {

// Eight numbers that the compiler keeps in one vector register, or two where those are short.
typedef float Lanes __attribute__((vector_size(32)));
constexpr std::size_t kLanes = 8;

Lanes load(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

float sum_of(const Lanes& lanes) {
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) +
         ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

// Row `I` of the upper triangle and of the gradient: sum of w j_I j_k for k = I..6.
template <std::size_t I, std::size_t Rows>
void add_row_of_products(const float (&j)[7][Rows], const float* weight, std::size_t rows,
                         float* to) {
  Lanes total[7 - I] = {};
  for (std::size_t r = 0; r < rows; r += kLanes) {
    const Lanes scaled = load(weight + r) * load(&j[I][r]);
    for (std::size_t k = I; k < 7; ++k)
      total[k - I] += scaled * load(&j[k][r]);
  }
  for (std::size_t k = I; k < 7; ++k)
    to[k - I] += sum_of(total[k - I]);
}

}  // namespace

void NdtBatch::flush(float d2, float pull, NdtSums& sums) {
  const float scale = -0.5F * d2;
  for (std::size_t m = 0; m < matches_; ++m)
    weight_[m] = pull * share_[m] * exp_of_negative(scale * q_[m]);
  for (std::size_t m = 0; m < matches_; ++m) {
    const auto weight = static_cast<double>(weight_[m]);
    sums.weight += weight;
    sums.weighted_residual += weight * static_cast<double>(q_[m]);
    sums.weighted_rows += weight * static_cast<double>(row_count_[m]);
    sums.surface_squared += weight * static_cast<double>(surface_[m]);
    sums.cost -= weight / static_cast<double>(d2);
  }
  for (std::size_t r = 0; r < rows_; ++r)
    row_weight_[r] = weight_[match_of_row_[r]];
  add_products(sums);
  rows_ = 0;
  matches_ = 0;
}

void NdtBatch::add_products(NdtSums& sums) {
  std::size_t rows = rows_;
  for (; rows % kLanes != 0; ++rows) {
    row_weight_[rows] = 0.0F;
    for (auto& column : j_)
      column[rows] = 0.0F;
  }
  float* to = sums.hessian.data();
  add_row_of_products<0>(j_, row_weight_, rows, to);
  add_row_of_products<1>(j_, row_weight_, rows, to + 7);
  add_row_of_products<2>(j_, row_weight_, rows, to + 13);
  add_row_of_products<3>(j_, row_weight_, rows, to + 18);
  add_row_of_products<4>(j_, row_weight_, rows, to + 22);
  add_row_of_products<5>(j_, row_weight_, rows, to + 25);
}

}  // namespace understory::internal
