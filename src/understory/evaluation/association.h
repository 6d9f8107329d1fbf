#pragma once

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "understory/util/time.h"

namespace understory::internal {

// Pairs of indices of two lists with a `stamp`, both ascending. Each item of the shorter list goes
// with the nearest of the longer within the tolerance, the earlier one of two equally near.
template <typename A, typename B>
std::vector<std::pair<std::size_t, std::size_t>> nearest_in_time(const std::vector<A>& a,
                                                                 const std::vector<B>& b,
                                                                 double tolerance_s) {
  if (b.size() < a.size()) {
    auto pairs = nearest_in_time(b, a, tolerance_s);
    for (auto& pair : pairs)
      std::swap(pair.first, pair.second);
    return pairs;
  }
  const TimeNs tolerance = from_seconds(tolerance_s);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  std::size_t j = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto gap = [&](std::size_t k) { return std::llabs(b[k].stamp - a[i].stamp); };
    while (j + 1 < b.size() && (b[j + 1].stamp <= a[i].stamp || gap(j + 1) < gap(j)))
      ++j;
    if (!b.empty() && gap(j) <= tolerance) pairs.emplace_back(i, j);
  }
  return pairs;
}

}  // namespace understory::internal
