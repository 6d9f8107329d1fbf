#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace understory {

// Allan deviation of a signal at one averaging time.
struct AllanPoint {
  double time_s = 0.0;      // averaging time
  double deviation = 0.0;   // in the unit of the signal
  std::uint64_t pairs = 0;  // neighbouring windows in it, overlapping ones too
};

// Overlapping Allan deviation of an evenly sampled signal at averaging times of 1, 2, 4, 8 ...
// samples: the root of half the mean squared difference of the means of two neighbouring windows.
// Windows move on by one sample, those of more than 8 samples by an eighth of their length. Samples
// come one after another, and memory grows with the logarithm of their number. Not thread-safe.
class AllanDeviation {
 public:
  AllanDeviation() : levels_(1) {}

  // The next sample, in any unit; finite.
  void add(double value);
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  // The curve so far for samples that lie `interval_s` apart (seconds, above 0). Averaging times
  // end where the signal holds fewer than three windows one after another; empty for fewer than
  // three samples.
  [[nodiscard]] std::vector<AllanPoint> curve(double interval_s) const;

 private:
  // Sums over 2^k samples, k the place of the level, and the differences made of them.
  struct Level {
    std::array<double, 16> sums{};  // the last ones, as a ring
    std::uint64_t count = 0;        // of the sums that came
    double half = 0.0;              // the sum that waits for its neighbour
    // Of windows of 1, 2, 4 (the first level alone) and 8 sums: squared differences and their
    // number.
    std::array<double, 4> squares{};
    std::array<std::uint64_t, 4> pairs{};
  };
  void add_difference(Level& level, std::size_t power);

  double origin_ = 0.0;  // the first sample, taken off all: sums of a large mean lose digits
  std::uint64_t samples_ = 0;
  std::vector<Level> levels_;
};

}  // namespace understory
