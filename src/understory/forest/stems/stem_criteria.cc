#include "understory/forest/stems/stem_criteria.h"

#include <algorithm>
#include <cmath>

#include "understory/forest/blur_constants.h"
#include "understory/forest/stem_constants.h"

namespace understory {
namespace {

using namespace blur_constants;
using namespace stem_constants::stem_detector;

// How much may lie beside the surface, as the sum of both ratios of StemEvidence, for it still to
// be a stem. In a thicket it takes many slices that agree to accept one; a steep lean is what a
// line through scattered points has.
double max_clutter(const StemFitResult& fit, double lean_deg, const SliceCut& cut) {
  const auto rings = static_cast<double>(fit.stem.slices.size());
  if (lean_deg > kSteepLeanDeg) return kSteepClutter;
  const double limit =
      std::min(kMostClutter, kClutterOfTwo + kClutterPerRing * std::max(0.0, rings - 2.0));
  if (cut.blur_m > 0.0) return std::max(limit, kBlurredClutter);
  const bool noisy = fit.evidence.scatter_m > kNoisyScatter && rings < kFewRings;
  return noisy ? std::min(limit, kNoisyClutter) : limit;
}

// m: how much the points of a stem may scatter.
double max_scatter(const StemFit& stem, const SliceCut& cut) {
  return std::max(
             {kMostScatter, kMostScatterShare * stem.radius_m, kBlurredScatters * cut.blur_m}) +
         kScatterSlack;
}

// Whether a thick stem in a blurred cloud is one. Foliage has a vague radius, or more scatter than
// stems, or it shows another side in each slice.
bool is_blurred_stem(const StemFitResult& fit, const SliceCut& cut, double blur_m) {
  const StemFit& stem = fit.stem;
  return std::sqrt(std::max(0.0, stem.covariance(2, 2))) <= kBlurredSd * stem.radius_m &&
         fit.evidence.scatter_m <= kMostOfBlur * blur_m &&
         (cut.blur_m == 0.0 ||
          (fit.evidence.fill >= kBlurredFill && fit.evidence.even_arc_deg >= kBlurredArcDeg));
}

// From the lowest slice that shows a stem to the highest one.
double slices_between(const StemFit& stem, const StemDetectorConfig& config) {
  return std::floor(stem.highest_m / config.slice_m) - std::floor(stem.lowest_m / config.slice_m) +
         1.0;
}

// A slim column of points that stands alone: with a thin stem and noisy ranges its inside fills up,
// but nothing else looks like that.
bool stands_alone(const StemFitResult& fit, const StemDetectorConfig& config) {
  const StemEvidence& e = fit.evidence;
  return fit.stem.radius_m <= kSlimRadius && e.outside_ratio <= kAloneOutside &&
         lean_deg_of(fit.stem) <= kAloneLeanDeg &&
         fit.stem.highest_m - fit.stem.lowest_m >= kAloneExtent &&
         e.slices >= kAloneSlices * slices_between(fit.stem, config) &&
         e.even_arc_deg >= kAloneArcDeg &&
         e.scatter_m <= kAloneScatterShare * fit.stem.radius_m + kAloneScatter;
}

// Through the highest slice.
bool reaches_top(const StemFit& stem, const StemDetectorConfig& config) {
  return stem.highest_m > config.highest_m - config.slice_m;
}

// Hardly a point lies beside or inside it over some height, and there is no gap in it.
bool stands_clear(const StemFitResult& fit, const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  return e.inside_ratio + e.outside_ratio <= kClearClutter && lean_deg_of(stem) <= kAloneLeanDeg &&
         stem.highest_m - stem.lowest_m >= kClearExtent &&
         e.slices >= kAloneSlices * slices_between(stem, config);
}

// A column that stands clear up to the top: a stem that was seen from one side, from afar. Its
// diameter may be uncertain, and what stands before it may hide its foot. `radius_sd_m`: of the
// radius at breast height.
bool is_clear_column(const StemFitResult& fit, const StemDetectorConfig& config,
                     double radius_sd_m) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  return stands_clear(fit, config) && reaches_top(stem, config) &&
         stem.lowest_m <= kBreastHeight + kClearBeginsAbove && e.even_arc_deg >= kClearArcDeg &&
         e.scatter_m <= kClearScatterShare * stem.radius_m &&
         radius_sd_m <= kClearSd * stem.radius_m;
}

// Whether its points are many and go on upwards, whatever its radius. Steep leans are rare, and a
// line through scattered points leans as it likes: they have to be better supported.
bool has_points_of_stem(const StemFitResult& fit, const SliceCut& cut,
                        const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  const double lean_deg = lean_deg_of(stem);
  const double wanted_returns = config.min_returns * (1.0 + std::pow(lean_deg / kSteepLeanDeg, 2));
  return fit.converged && 2.0 * stem.radius_m >= config.min_dbh_m &&
         lean_deg <= config.max_lean_deg && e.returns >= wanted_returns &&
         e.slices >= config.min_slices &&
         e.slices >= kLeastSliceShare * slices_between(stem, config) &&
         stem.highest_m - stem.lowest_m >= std::max(kLeastExtent, 2.0 * cut.thickness_m);
}

}  // namespace

double lean_deg_of(const StemFit& stem) {
  return std::atan(stem.slope.norm()) * 180.0 / M_PI;
}

bool is_flat_column(const StemFitResult& fit, const SliceCut& cut,
                    const StemDetectorConfig& config) {
  // A band as wide as the blur holds all points that are near: it always stands clear.
  if (cut.blur_m > 0.0 || (fit.stem.radius_m > kThickBlurs * config.blur_m && config.blur_m > 0.0 &&
                           fit.evidence.scatter_m > max_scatter(fit.stem, cut))) {
    return false;
  }
  return has_points_of_stem(fit, cut, config) && stands_clear(fit, config) &&
         fit.stem.lowest_m <= kBreastHeight + kBeginsAbove;
}

bool is_stem(const StemFitResult& fit, const SliceCut& cut, const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  const double dbh = 2.0 * stem.radius_m;
  const double dbh_sd = 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
  const double lean_deg = lean_deg_of(stem);
  if (!has_points_of_stem(fit, cut, config) || dbh > config.max_dbh_m ||
      stem.arc_deg < config.min_arc_deg || e.even_arc_deg < kEvenArcOfLeast * config.min_arc_deg) {
    return false;
  }
  if (cut.blur_m == 0.0 &&
      is_clear_column(fit, config, std::sqrt(std::max(0.0, stem.covariance(2, 2)))))
    return true;
  if (cut.only_clear) return reaches_top(stem, config) && stands_alone(fit, config);
  if (e.even_arc_deg < kEvenArcShare * stem.arc_deg) return false;
  // What begins higher is a branch or a crown.
  if (stem.lowest_m > kBreastHeight + kBeginsAbove || dbh_sd > kDbhSd + kDbhSdShare * dbh)
    return false;
  if (stands_alone(fit, config)) return true;
  // Where points are many, a stem shows in thin slices; what only thick ones show has to be clean.
  const double clutter = e.inside_ratio + e.outside_ratio;
  const bool dense = e.on > kDensePointsPerSlice * e.slices;
  if (cut.min_slices < config.min_slices && dense &&
      (clutter > kThickOnlyClutter || e.scatter_m > kThickOnlyScatter)) {
    return false;
  }
  return 4 * e.inside <= e.on && e.inside_ratio <= kMostInside &&
         clutter <= max_clutter(fit, lean_deg, cut) && e.scatter_m <= max_scatter(stem, cut);
}

// A stem's pieces were filled to 0.67 and more on the tuning maps. What shows in few slices has to
// stand clear, and must not be cut off where it was seen well.
bool is_stem_still(const StemFitResult& fit, const SliceCut& cut,
                   const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  if (!fit.converged || 2.0 * stem.radius_m < config.min_dbh_m ||
      2.0 * stem.radius_m > config.max_dbh_m || e.returns < config.min_returns ||
      lean_deg_of(stem) > config.max_lean_deg || stem.arc_deg < config.min_arc_deg ||
      e.fill < kClearFill) {
    return false;
  }
  if (config.blur_m > 0.0 && !is_blurred_stem(fit, cut, config.blur_m)) return false;
  if (cut.blur_m == 0.0 && is_clear_column(fit, config, kClearSpreads * stem.spread_m)) return true;
  if (e.fill < kLeastFill) return false;
  if (cut.only_clear) return reaches_top(stem, config) && stands_alone(fit, config);
  const double all = (config.highest_m - config.lowest_m) / config.slice_m;
  if (e.slices >= kShownByMost * all) return true;
  const double sd = std::sqrt(std::max(0.0, stem.covariance(2, 2)));
  return e.inside_ratio + e.outside_ratio <= kFewSlicesClutter &&
         sd <= kFewSlicesSd * stem.radius_m &&
         (e.slices >= kShownByFew * all || e.returns < kWellSeen * e.slices);
}

}  // namespace understory
