#pragma once

#include <limits>

namespace understory {

// One tree of a stand, world frame. NaN where unknown: never a guess that looks like a measurement.
struct Tree {
  int id = 0;
  double x = 0.0;  // centre line of the stem at the ground, metres
  double y = 0.0;
  double z = 0.0;                                              // ground at the stem, metres
  double dbh_m = std::numeric_limits<double>::quiet_NaN();     // diameter 1.3 m above the ground
  double dbh_sd_m = std::numeric_limits<double>::quiet_NaN();  // its standard deviation
  double height_m = std::numeric_limits<double>::quiet_NaN();  // highest point above the ground
  double lean_deg = std::numeric_limits<double>::quiet_NaN();  // from the vertical
  int observations = 0;  // returns (or views, in a sparse map) that support the stem
  double x_sd_m = std::numeric_limits<double>::quiet_NaN();
  double y_sd_m = std::numeric_limits<double>::quiet_NaN();
  bool felled = false;  // of a truth: cut down while it was scanned, so it may be listed or not
};

}  // namespace understory
