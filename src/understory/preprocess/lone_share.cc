#include "understory/preprocess/lone_share.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/preprocess/preprocess_constants.h"

namespace understory {
namespace {

using namespace preprocess_constants::weather_filter;

// The numbers that occur, increasing.
std::vector<std::uint16_t> distinct(const std::vector<std::uint16_t>& numbers) {
  std::vector<std::uint8_t> occurs(UINT16_MAX + 1, 0);
  for (const std::uint16_t number : numbers)
    occurs[number] = 1;
  std::vector<std::uint16_t> found;
  for (std::size_t number = 0; number < occurs.size(); ++number) {
    if (occurs[number] != 0) found.push_back(static_cast<std::uint16_t>(number));
  }
  return found;
}

}  // namespace

LoneShare::LoneShare(const std::vector<std::uint16_t>& ring, const std::vector<std::uint32_t>& t_ns,
                     const std::vector<float>& range, const std::vector<std::uint8_t>& alone)
    : places_(ring.size()), alone_(alone), ring_(distinct(ring)) {
  if (ring.empty()) return;
  std::vector<std::uint16_t> row_of(ring_.back() + std::size_t{1}, 0);
  for (std::size_t row = 0; row < ring_.size(); ++row)
    row_of[ring_[row]] = static_cast<std::uint16_t>(row);
  const auto [first, last] = std::minmax_element(t_ns.begin(), t_ns.end());
  const std::uint64_t duration = std::uint64_t{*last} - *first + 1;
  before_.resize(ring_.size() * (kColumns + 1));
  for (std::size_t i = 0; i < ring.size(); ++i) {
    Place& place = places_[i];
    place.row = row_of[ring[i]];
    place.column = static_cast<std::uint8_t>((t_ns[i] - *first) * std::uint64_t{kColumns} / duration);
    const float unit = std::isfinite(range[i]) ? 0.1F + std::max(range[i], 0.0F) : 1.0F;
    place.octave = static_cast<std::uint8_t>(std::clamp(std::ilogb(unit) + 1, 0, kOctaves - 1));
    Cell& cell = before_[place.row * std::size_t{kColumns + 1} + place.column + 1];
    ++cell.all;
    if (alone[i] == 0) continue;
    for (int octave = 0; octave <= place.octave; ++octave)
      ++cell.alone[octave];
  }
  for (std::size_t at = 1; at < before_.size(); ++at) {
    if (at % (kColumns + 1) == 0) continue;  // a row begins
    before_[at].all += before_[at - 1].all;
    for (int octave = 0; octave < kOctaves; ++octave)
      before_[at].alone[octave] += before_[at - 1].alone[octave];
  }
}

double LoneShare::around(std::size_t i) const {
  const Place& place = places_[i];
  const int octave = std::max(place.octave - 1, 0);
  // The end of a revolution looks where its beginning does.
  const int begin = (place.column - kColumnsAround + kColumns) % kColumns;
  const int end = (place.column + kColumnsAround + 1) % kColumns;
  const std::uint32_t whole = end < begin ? 1 : 0;  // revolutions to add
  std::uint32_t all = 0;
  std::uint32_t lone = 0;
  const int rows = static_cast<int>(ring_.size());
  const int ring = ring_[place.row];
  for (int row = std::max(place.row - kRingsAround, 0);
       row <= std::min(place.row + kRingsAround, rows - 1); ++row) {
    if (std::abs(ring_[static_cast<std::size_t>(row)] - ring) > kRingsAround) continue;
    const Cell* const cells = &before_[static_cast<std::size_t>(row) * (kColumns + 1)];
    all += cells[end].all - cells[begin].all + whole * cells[kColumns].all;
    lone += cells[end].alone[octave] - cells[begin].alone[octave] +
            whole * cells[kColumns].alone[octave];
  }
  if (all <= 1) return 0.0;
  return static_cast<double>(lone - alone_[i]) / (all - 1);
}

}  // namespace understory
