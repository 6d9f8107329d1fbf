#pragma once

#include <Eigen/Core>

#include "understory/registration/ndt/ndt.h"

namespace understory::internal {

// Constants of Magnusson's approximation of -log(c1 exp(-q/2) + c2) by d1 exp(-d2 q/2), P4 after
// (41) [Magnusson 2009, (6.8-6.10)]; d1 < 0.
struct MixtureConstants {
  double d1 = -1.0;
  double d2 = 1.0;
};
[[nodiscard]] MixtureConstants mixture_constants(double outlier_ratio, double cell_size_m);

}  // namespace understory::internal
