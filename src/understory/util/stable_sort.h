#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace understory {

// Sorts as std::stable_sort does, for types of any alignment. The buffer of std::stable_sort is
// only aligned as malloc aligns. Types that hold a Pose or some of Eigen's matrices need more: a
// program that moves them there ends with a fault.
template <typename T, typename Less>
void sort_stably(std::vector<T>& items, const Less& less) {
  if constexpr (alignof(T) <= __STDCPP_DEFAULT_NEW_ALIGNMENT__) {
    std::stable_sort(items.begin(), items.end(), less);
  } else {
    std::vector<std::size_t> order(items.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return less(items[a], items[b]); });
    std::vector<T> sorted;
    sorted.reserve(items.size());
    for (const std::size_t i : order)
      sorted.push_back(std::move(items[i]));
    items = std::move(sorted);
  }
}

}  // namespace understory
