#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// The height of a stand's trees over their diameter: h = 1.3 + (d / (a + b d))^2, h and d in metres
// (M. Naeslund, Skogsfoersoeksanstaltens gallringsfoersoek i tallskog, Meddelanden fran Statens
// skogsfoersoeksanstalt 29, 1936).
struct HeightCurve {
  double a = 0.0;
  double b = 0.0;
  double sd_m = 0.0;  // of single trees about it
  std::size_t trees = 0;

  // Metres; `dbh_m` over 0.
  [[nodiscard]] double at(double dbh_m) const;
};

// Whether the tree may be higher than its height says. It tells no height then.
[[nodiscard]] bool is_lower_bound(const Tree& tree);

// Least squares of d / sqrt(h - 1.3) = a + b d over the trees with diameter and height. Nothing
// where they are fewer than 8, all about as thick, or where thicker ones are no higher.
[[nodiscard]] std::optional<HeightCurve> fit_height_curve(const std::vector<Tree>& trees);

}  // namespace understory
