#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstddef>

namespace understory {

// Which part of a circle's circumference holds points, in steps of 10 degrees.
class ArcBins {
 public:
  static constexpr std::size_t kBins = 36;

  static std::size_t bin_of(double x, double y) {
    const double turn = std::atan2(y, x) / (2.0 * M_PI) + 0.5;
    return std::min(kBins - 1, static_cast<std::size_t>(turn * static_cast<double>(kBins)));
  }
  void add(double x, double y) { ++counts_[bin_of(x, y)]; }

  // Gaps of up to two steps between points count as covered, because sparse points leave such gaps
  // on a full stem.
  [[nodiscard]] double covered_deg() const {
    std::bitset<kBins> bins;
    for (std::size_t i = 0; i < kBins; ++i)
      bins.set(i, counts_[i] > 0);
    const std::bitset<kBins> wide = bins | turned(bins, 1) | turned(bins, kBins - 1);
    const std::bitset<kBins> closed = wide & turned(wide, 1) & turned(wide, kBins - 1);
    return kStep * static_cast<double>((closed | bins).count());
  }

  // The arc over which the points would spread if they lay evenly: (sum n)^2 / sum n^2 steps. A
  // large circle may merely pass through a small stem. It has a wide arc covered by strays, but
  // nearly all of its points in one place.
  [[nodiscard]] double even_deg() const {
    double sum = 0.0;
    double squares = 0.0;
    for (const int n : counts_) {
      sum += n;
      squares += static_cast<double>(n) * n;
    }
    return squares > 0.0 ? kStep * sum * sum / squares : 0.0;
  }

 private:
  static constexpr double kStep = 360.0 / static_cast<double>(kBins);
  static std::bitset<kBins> turned(const std::bitset<kBins>& bins, std::size_t by) {
    return bins << by | bins >> (kBins - by);
  }
  std::array<int, kBins> counts_{};
};

}  // namespace understory
