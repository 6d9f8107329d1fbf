#pragma once

#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// The diameters that the trees of a stand are expected to have, metres. Given are the measured ones
// and their standard deviations; expected are d + (1 - k) (m - d), k = s^2 / (s^2 + sd^2). m and s
// are mean and standard deviation of the diameters of the stand, from those stems that are sure. A
// curve that is fitted to noisy diameters is too flat; with these it is not (regression
// calibration: R. J. Carroll et al., Measurement Error in Nonlinear Models, 2006, chapter 4). As
// measured: trees without a standard deviation, those thinner than `min_dbh_m`, and all where too
// few stems are sure. Same order and number as `trees`.
[[nodiscard]] std::vector<double> expected_diameters(const std::vector<Tree>& trees,
                                                     double min_dbh_m);

}  // namespace understory
