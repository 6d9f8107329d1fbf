#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// A height that was not measured, and its standard deviation, metres.
struct HeightAbove {
  double height_m = 0.0;
  double sd_m = 0.0;
};

// The height of a stand's trees over their diameter: h = 1.3 + (d / (a + b d))^2, h and d in metres
// (M. Naeslund, Skogsfoersoeksanstaltens gallringsfoersoek i tallskog, Meddelanden fran Statens
// skogsfoersoeksanstalt 29, 1936).
struct HeightCurve {
  double a = 0.0;
  double b = 0.0;
  double sd_m = 0.0;                                     // of single trees about it
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // of a and b
  std::size_t trees = 0;                                 // with full heights
  std::size_t lower_bounds = 0;                          // that count as well
  // Share of the trees that end at their full height, and at their lower bound.
  double seen_that_end = 1.0;
  double bounds_that_end = 1.0;

  // Metres; `dbh_m` over 0.
  [[nodiscard]] double at(double dbh_m) const;
  // Standard deviation of the curve itself there, metres: an error that all trees share.
  [[nodiscard]] double own_sd_at(double dbh_m) const;
  // A tree with a lower bound: its expected height and the standard deviation of that, metres. It
  // ends there, or is higher by the normal distribution about the curve: both by their chances.
  [[nodiscard]] HeightAbove above(double dbh_m, double bound_m) const;
  // Whether a tree with a full height more likely ends there than goes on.
  [[nodiscard]] bool is_likely_height(double dbh_m, double height_m) const;
};

// Whether the tree may be higher than its height says. It tells no height then.
[[nodiscard]] bool is_lower_bound(const Tree& tree);

// The curve of the trees with diameter and height. Each tree ends at its height, or goes on: then
// the view ended anywhere below. Expectation and maximization weigh it by the chance of the first,
// which is smaller for lower bounds and for low trees. How many end is found with the curve. Trees
// that are far too high count for nothing (Tukey's biweight). No curve where the full heights are
// fewer than 8, all of trees about as thick, or where thicker ones are no higher.
[[nodiscard]] std::optional<HeightCurve> fit_height_curve(const std::vector<Tree>& trees);

}  // namespace understory
