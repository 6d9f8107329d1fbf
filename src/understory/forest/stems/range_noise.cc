#include "understory/forest/stems/range_noise.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "understory/forest/range_noise_constants.h"
#include "understory/forest/stems/breast_height_sections.h"
#include "understory/forest/stems/noisy_cylinder.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace range_noise_constants;

NoisyCylinder fit_in_noise(const std::vector<SlicePoint>& points, const StemFit& stem,
                           double reach_m, NoisyCylinderConfig config) {
  config.stray_reach_m = reach_m;
  StemFit start = stem;
  start.rms_m = stem.scatter_m;
  std::vector<SlicePoint> near;
  const StemAxis axis(start);
  for (const SlicePoint& point : points) {
    if (axis.surface_error(point) < reach_m) near.push_back(point);
  }
  return fit_noisy_cylinder(near, start, config);
}

}  // namespace

std::vector<SlicePoint> StemPoints::around(const StemFit& stem) const {
  const double within = stem.radius_m + kAround;
  std::vector<StemAxis> others;
  for (const StemFit& other : stems_) {
    const double gap = (other.centre - stem.centre).norm();
    if (gap > 0.0 && gap < within + other.radius_m + kLeanReach) others.emplace_back(other);
  }
  std::vector<SlicePoint> found;
  const StemAxis axis(stem);
  index_.near(stem.centre, within + kLeanReach, [&](std::size_t i) {
    const SlicePoint& point = points_[i];
    if (!axis.may_be_within(point, within)) return;
    const double error = axis.surface_error(point);
    const auto is_of = [&](const StemAxis& other) {
      const double away = other.surface_error(point);
      return away < kOthersMargin && away < error;
    };
    if (std::none_of(others.begin(), others.end(), is_of)) found.push_back(point);
  });
  return found;
}

bool tells_range_noise(const StemFit& stem) {
  return !stem.in_foliage && stem.below_sd_m == 0.0 && stem.radius_m > kLeastRadius &&
         stem.returns >= kLeastReturns;
}

std::vector<std::size_t> stems_for_range_noise(const std::vector<StemFit>& stems) {
  std::vector<std::size_t> best(stems.size());
  std::iota(best.begin(), best.end(), 0U);
  std::erase_if(best, [&](std::size_t i) { return !tells_range_noise(stems[i]); });
  sort_stably(best,
              [&](std::size_t a, std::size_t b) { return stems[a].returns > stems[b].returns; });
  best.resize(std::min(best.size(), kMostStems));
  return best;
}

std::optional<RangeNoiseFits> fit_range_noise(const std::vector<SlicePoint>& points,
                                              const StemFit& stem) {
  const double reach = fit_reach_m(stem.scatter_m);
  NoisyCylinderConfig config;
  config.max_points = kEnoughPoints;
  config.cycles = kMostCycles;
  const NoisyCylinder to_all_sides = fit_in_noise(points, stem, reach, config);
  config.range_noise_m = kFirstShare * stem.scatter_m;
  config.find_range_noise = true;
  const NoisyCylinder along = fit_in_noise(points, stem, reach, config);
  if (!to_all_sides.converged || !along.converged) return std::nullopt;
  return RangeNoiseFits{along.range_noise_m, along.log_likelihood - to_all_sides.log_likelihood};
}

double range_noise_of(const std::vector<RangeNoiseFits>& stems) {
  if (stems.size() < kFewestStems) return 0.0;
  std::vector<double> likelier;
  std::vector<double> noises;
  for (const RangeNoiseFits& stem : stems) {
    likelier.push_back(stem.likelier_by);
    noises.push_back(stem.noise_m);
  }
  const double noise = upper_median(std::move(noises));
  return upper_median(std::move(likelier)) < kLeastLikelier || noise < kLeastNoise ? 0.0 : noise;
}

double fit_reach_m(double range_noise_m) {
  return std::max(kFitReach, kReach + kReachNoises * range_noise_m);
}

void measure_at_breast_height(const std::vector<SlicePoint>& points, double range_noise_m,
                              StemFit& stem) {
  if (range_noise_m > 0.0) {
    NoisyCylinderConfig config;
    config.range_noise_m = range_noise_m;
    const NoisyCylinder found = fit_in_noise(points, stem, fit_reach_m(range_noise_m), config);
    const double most = kMostChange + kMostChangeNoises * range_noise_m;
    if (found.converged && std::abs(found.radius_m - stem.radius_m) < most &&
        (found.centre - stem.centre).norm() < most) {
      take_cylinder(found, stem);
      stem.range_noise_m = range_noise_m;
    }
  }
  stem.section_radius_m = radius_with_sections(points, stem);
}

}  // namespace understory
