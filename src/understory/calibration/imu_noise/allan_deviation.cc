#include "understory/calibration/imu_noise/allan_deviation.h"

#include <cmath>

#include "understory/calibration/calibration_constants.h"

namespace understory {

using namespace calibration_constants::allan_deviation;

// Of two neighbouring windows of 2^power sums each, which end with the last sum.
void AllanDeviation::add_difference(Level& level, std::size_t power) {
  const std::size_t width = std::size_t{1} << power;
  if (level.count < 2 * width) return;
  double later = 0.0;
  double earlier = 0.0;
  for (std::size_t k = 1; k <= width; ++k) {
    later += level.sums[(level.count - k) % level.sums.size()];
    earlier += level.sums[(level.count - width - k) % level.sums.size()];
  }
  level.squares[power] += (later - earlier) * (later - earlier);
  ++level.pairs[power];
}

void AllanDeviation::add(double value) {
  if (samples_ == 0) origin_ = value;
  ++samples_;
  double sum = value - origin_;
  for (std::size_t at = 0;; ++at) {
    if (at == levels_.size()) levels_.emplace_back();
    Level& level = levels_[at];
    level.sums[level.count % level.sums.size()] = sum;
    ++level.count;
    // Longer windows of few sums are those of many sums on the levels before.
    for (std::size_t power = at == 0 ? 0 : 3; power < level.squares.size(); ++power)
      add_difference(level, power);
    if (level.count % 2 == 1) {
      level.half = sum;
      return;
    }
    if (at + 1 == kMostOctaves) return;
    sum += level.half;
  }
}

std::vector<AllanPoint> AllanDeviation::curve(double interval_s) const {
  static_assert(kStepsOfAWindow == std::size_t{1} << 3);
  std::vector<AllanPoint> points;
  for (std::size_t octave = 0;; ++octave) {
    const std::size_t at = octave < 3 ? 0 : octave - 3;
    const std::size_t power = octave < 3 ? octave : 3;
    const std::uint64_t width = std::uint64_t{1} << octave;
    if (at >= levels_.size() || samples_ < kFewestWindows * width) return points;
    const Level& level = levels_[at];
    const auto pairs = static_cast<double>(level.pairs[power]);
    const auto length = static_cast<double>(width);
    points.push_back({length * interval_s, std::sqrt(0.5 * level.squares[power] / pairs) / length,
                      level.pairs[power]});
  }
}

}  // namespace understory
