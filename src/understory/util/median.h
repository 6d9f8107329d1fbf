#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace understory {

// The middle value, of an even number the upper of the two; `of_none` where there is none.
template <typename T>
[[nodiscard]] T upper_median(std::vector<T> values, T of_none = T()) {
  if (values.empty()) return of_none;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace understory
