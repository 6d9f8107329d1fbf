#include "understory/preprocess/lone_share.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "understory/preprocess/preprocess_constants.h"
#include "understory/preprocess/range_grid.h"

namespace understory {
using namespace preprocess_constants::weather_filter;

LoneShare::LoneShare(const std::vector<std::uint16_t>& ring, const std::vector<std::uint32_t>& t_ns,
                     const std::vector<float>& range, const std::vector<std::uint8_t>& alone)
    : ring_(ring), t_ns_(t_ns), range_(range), alone_(alone) {
  if (ring.empty()) return;
  row_of_ring_.resize(*std::max_element(ring.begin(), ring.end()) + std::size_t{1}, 0);
  for (const std::uint16_t number : ring)
    row_of_ring_[number] = 1;  // it occurs
  for (std::size_t number = 0; number < row_of_ring_.size(); ++number) {
    if (row_of_ring_[number] == 0) continue;
    row_of_ring_[number] = static_cast<std::uint16_t>(ring_of_row_.size());
    ring_of_row_.push_back(static_cast<std::uint16_t>(number));
  }
  const auto [first, last] = std::minmax_element(t_ns.begin(), t_ns.end());
  first_ns_ = *first;
  columns_a_ns_ = static_cast<float>(kColumns) / (static_cast<float>(*last - *first) + 1.0F);
  before_.resize(ring_of_row_.size() * (kColumns + 1));
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const auto row = static_cast<std::size_t>(row_of(i));
    Cell& cell = before_[row * (kColumns + 1) + static_cast<std::size_t>(column_of(i) + 1)];
    ++cell.all;
    if (alone[i] == 0) continue;
    const int octaves = octave_of(i);
    for (int octave = 0; octave <= octaves; ++octave)
      ++cell.alone[octave];
  }
  for (std::size_t at = 1; at < before_.size(); ++at) {
    if (at % (kColumns + 1) == 0) continue;  // a row begins
    before_[at].all += before_[at - 1].all;
    for (int octave = 0; octave < kOctaves; ++octave)
      before_[at].alone[octave] += before_[at - 1].alone[octave];
  }
}

int LoneShare::column_of(std::size_t i) const {
  const auto column = static_cast<int>(static_cast<float>(t_ns_[i] - first_ns_) * columns_a_ns_);
  return std::min(column, kColumns - 1);
}

int LoneShare::octave_of(std::size_t i) const {
  return std::clamp(RangeGrid::octave_of(range_[i]) + 1, 0, kOctaves - 1);
}

double LoneShare::around(std::size_t i) const {
  const int octave = std::max(octave_of(i) - 1, 0);
  // The end of a revolution looks where its beginning does.
  const int column = column_of(i);
  const int begin = (column - kColumnsAround + kColumns) % kColumns;
  const int end = (column + kColumnsAround + 1) % kColumns;
  const std::uint32_t whole = end < begin ? 1 : 0;  // revolutions to add
  std::uint32_t all = 0;
  std::uint32_t lone = 0;
  const int last = std::min(row_of(i) + kRingsAround, static_cast<int>(ring_of_row_.size()) - 1);
  for (int row = std::max(row_of(i) - kRingsAround, 0); row <= last; ++row) {
    if (std::abs(ring_of_row_[static_cast<std::size_t>(row)] - ring_[i]) > kRingsAround) continue;
    const Cell* const cells = &before_[static_cast<std::size_t>(row) * (kColumns + 1)];
    all += cells[end].all - cells[begin].all + whole * cells[kColumns].all;
    lone += cells[end].alone[octave] - cells[begin].alone[octave] +
            whole * cells[kColumns].alone[octave];
  }
  if (all <= 1) return 0.0;
  return static_cast<double>(lone - alone_[i]) / (all - 1);
}

}  // namespace understory
