#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace understory {

// Standard deviation of normal errors over their median absolute deviation.
inline constexpr double kSdOverMad = 1.4826;
// Median distance over the standard deviation of each of two axes: of the Rayleigh distribution.
inline constexpr double kRayleighMedian = 1.1774;
// Standard deviations beyond which Tukey's biweight counts nothing: 95 % efficient where errors are
// normal.
inline constexpr double kBiweightReach = 4.685;
// Standard deviations at which Cauchy's weight is a half, for the same efficiency.
inline constexpr double kCauchyWidth = 2.385;
// Standard deviation of a median over that of a mean: the square root of pi/2.
inline constexpr double kMedianSd = 1.2533;

// The middle value, of an even number the upper of the two; `of_none` where there is none.
template <typename T>
[[nodiscard]] T upper_median(std::vector<T> values, T of_none = T()) {
  if (values.empty()) return of_none;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace understory
