#pragma once

#include <cmath>

namespace understory::test {

// Naeslund's curve of heights for tests, m, of a diameter at breast height in m. In his own units:
// 1.3 + d^2 / (1.2 + 0.19 d)^2, d in cm.
inline double true_height(double dbh_m) {
  const double d = 100.0 * dbh_m;
  return 1.3 + d * d / std::pow(1.2 + 0.19 * d, 2);
}

}  // namespace understory::test
