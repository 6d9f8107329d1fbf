#pragma once

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>

namespace understory {

// Which part of a circle's circumference holds points, in steps of 10 degrees; gaps of up to two
// steps between points count as covered, because sparse points leave such gaps on a full stem.
class ArcBins {
 public:
  static constexpr std::size_t kBins = 36;

  static std::size_t bin_of(double x, double y) {
    const double turn = std::atan2(y, x) / (2.0 * M_PI) + 0.5;
    return std::min(kBins - 1, static_cast<std::size_t>(turn * static_cast<double>(kBins)));
  }
  void add(double x, double y) { bins_.set(bin_of(x, y)); }
  [[nodiscard]] double covered_deg() const {
    const std::bitset<kBins> wide = bins_ | turned(bins_, 1) | turned(bins_, kBins - 1);
    const std::bitset<kBins> closed = wide & turned(wide, 1) & turned(wide, kBins - 1);
    return 360.0 / static_cast<double>(kBins) * static_cast<double>((closed | bins_).count());
  }

 private:
  static std::bitset<kBins> turned(const std::bitset<kBins>& bins, std::size_t by) {
    return bins << by | bins >> (kBins - by);
  }
  std::bitset<kBins> bins_;
};

}  // namespace understory
