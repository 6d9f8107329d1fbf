#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "understory/forest/form/taper_form.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// A stem at one height above the ground.
struct CurveSection {
  double height_m = 0.0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // metres, frame of the stem
  double diameter_m = 0.0;                           // across the axis
  double diameter_sd_m = 0.0;
  bool measured = false;  // by points within a step; otherwise by the form of the taper
};

// A second stem that leaves another one.
struct StemFork {
  double height_m = 0.0;  // above the ground at the stem: its centre line leaves the bark
  double from_m = 0.0;    // heights between which it was seen
  double to_m = 0.0;
};

// The diameters of a stem from the ground to the top, every decimetre.
struct StemCurve {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  std::vector<CurveSection> sections;  // upwards; without a height of the tree they end where the
                                       // measured ones end
  double measured_to_m = kUnknown;     // height of the last measured section
  double volume_m3 = kUnknown;         // over bark, ground to top; unknown without a height
  // Standard deviation of the volume where breast height and height of the tree are right: of the
  // sections and of the form.
  double volume_form_sd_m3 = kUnknown;
  double volume_per_height_m2 = kUnknown;  // what a metre of height would add
  // How far the centre line is from a straight one at most, between 0.5 and 5 m above the ground.
  // Unknown where it was not seen up to there.
  double sweep_m = kUnknown;
  std::optional<StemFork> fork;  // the lowest one that was seen
};

// How a stem curve is completed.
struct StemCurveConfig {
  TaperSpecies species = TaperSpecies::kUnknown;  // whose form stands where nothing was measured
};

// Follows a stem upwards and downwards from breast height: a noisy cylinder every quarter of a
// metre, each begun from those before it. Sections that do not fit into the curve are left out.
// What was not seen has the form of the taper, scaled to what was seen next to it. `points`: around
// the stem, height above the ground at the stem, in any order. `height_m`: of the tree, NaN if
// unknown. The diameter at breast height is that of `stem`. Deterministic.
[[nodiscard]] StemCurve measure_stem_curve(std::vector<SlicePoint> points, const StemFit& stem,
                                           double height_m, const StemCurveConfig& config);

// Standard deviation of the volume, m3. All diameters of a stem go with that at breast height,
// whose standard deviation is `dbh_sd_share` of it. What was not measured stretches with the height
// of the tree, whose standard deviation is `height_sd_m`. NaN without a volume.
[[nodiscard]] double volume_sd_m3(const StemCurve& curve, double dbh_sd_share, double height_sd_m);

}  // namespace understory
