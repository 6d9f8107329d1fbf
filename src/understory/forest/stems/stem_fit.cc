#include "understory/forest/stems/stem_fit.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "understory/forest/blur_constants.h"
#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/arc_bins.h"
#include "understory/forest/stems/noisy_cylinder.h"
#include "understory/forest/stems/surface_band.h"
#include "understory/geometry/matrix_inverse.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace blur_constants;
using namespace stem_constants::stem_fit;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Parameters: centre x, y; slope x, y; radius; taper.
struct System {
  Matrix6 normal = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  int used = 0;
  double weight = 0.0;
};

System build_system(const std::vector<SlicePoint>& points, const StemFit& stem,
                    const StemFit& start, double scatter) {
  System system;
  const double reach = kReachScatters * scatter;
  const double upright = 1.0 / std::sqrt(1.0 + stem.slope.squaredNorm());
  const StemAxis axis(stem);
  for (const SlicePoint& point : points) {
    const AxisPlace place = axis.place(point);
    const double e = axis.surface_error(place);
    if (std::abs(e) >= reach || place.distance_m < 1e-4) continue;
    const double u = e / reach;
    // A point stands for its returns. The thinned cloud alone would fill the noise around a surface
    // evenly, and more of that lies outside than inside.
    const double weight = static_cast<double>(point.returns) * (1.0 - u * u) * (1.0 - u * u);
    Vector6 jacobian;
    const Eigen::Vector2d out = place.outward.head<2>();
    jacobian << -out, -place.along_m * upright * out, -1.0, -place.along_m;
    system.normal.noalias() += weight * jacobian * jacobian.transpose();
    system.gradient += weight * e * jacobian;
    system.weight += weight;
    ++system.used;
  }
  // Priors, scaled as if they were points of this scatter.
  const auto prior = [&](int i, double difference, double sd) {
    const double weight = scatter * scatter / (sd * sd);
    system.normal(i, i) += weight;
    system.gradient[i] += weight * difference;
  };
  prior(2, stem.slope.x() - start.slope.x(), kSlopeSd);
  prior(3, stem.slope.y() - start.slope.y(), kSlopeSd);
  prior(5, stem.taper - kUsualTaper, kTaperSd);
  return system;
}

// Enough points to fit by: those near the surface of the start, every n-th where they are many.
std::vector<SlicePoint> sample_of(const std::vector<SlicePoint>& points, const StemFit& start,
                                  double reach) {
  std::vector<SlicePoint> near;
  const StemAxis axis(start);
  for (const SlicePoint& point : points) {
    if (std::abs(axis.surface_error(point)) < reach) near.push_back(point);
  }
  const std::size_t stride = near.size() / kEnoughPoints + 1;
  std::vector<SlicePoint> some;
  for (std::size_t i = 0; i < near.size(); i += stride)
    some.push_back(near[i]);
  return some;
}

// m: the scatter of points about a stem at most.
double most_scatter_m(const StemDetectorConfig& config) {
  return std::max(kMostScatter, kMostBlurs * config.blur_m);
}

// 1.48 times the median distance from the surface of the returns within `reach`, in steps of a
// quarter of a millimetre.
double scatter_of(const std::vector<SlicePoint>& points, const StemFit& stem, double reach,
                  double most) {
  constexpr double kStep = 0.00025;
  constexpr std::size_t kSteps = 256;
  std::array<std::uint64_t, kSteps> counts{};
  std::uint64_t returns = 0;
  const StemAxis axis(stem);
  for (const SlicePoint& point : points) {
    const double e = std::abs(axis.surface_error(point));
    if (e >= reach) continue;
    counts[std::min(kSteps - 1, static_cast<std::size_t>(e / kStep))] += point.returns;
    returns += point.returns;
  }
  if (returns == 0) return most;
  std::uint64_t passed = 0;
  std::size_t middle = 0;
  for (; middle + 1 < kSteps && 2 * passed < returns; ++middle)
    passed += counts[middle];
  return std::clamp(kSdOverMad * kStep * (static_cast<double>(middle) - 0.5), kLeastScatter, most);
}

// Which parts of the surface were seen: steps of 10 degrees in each slice.
class Patches {
 public:
  explicit Patches(const StemDetectorConfig& config)
      : slice_m_(config.slice_m),
        masks_(static_cast<std::size_t>(config.highest_m / config.slice_m) + 2, 0) {}
  void add(double height_m, const AxisPlace& place) {
    const auto slice = static_cast<std::size_t>(std::max(0.0, height_m / slice_m_));
    masks_[std::min(slice, masks_.size() - 1)] |=
        std::uint64_t{1} << ArcBins::bin_of(place.outward.x(), place.outward.y());
    ++points_;
  }
  [[nodiscard]] int slices() const {
    return static_cast<int>(
        std::count_if(masks_.begin(), masks_.end(), [](std::uint64_t m) { return m != 0; }));
  }
  [[nodiscard]] int occupied() const {
    int count = 0;
    for (const std::uint64_t mask : masks_)
      count += std::popcount(mask);
    return count;
  }
  // The same with three steps of 10 degrees taken together.
  [[nodiscard]] int coarse() const {
    int count = 0;
    for (const std::uint64_t mask : masks_) {
      for (std::size_t b = 0; b < ArcBins::kBins; b += 3)
        count += (mask >> b & 7U) != 0 ? 1 : 0;
    }
    return count;
  }
  // Patches seen over those that as many points would hit if they lay evenly on the sides that
  // were seen in any slice.
  [[nodiscard]] double fill() const {
    std::uint64_t sides = 0;
    std::size_t first = masks_.size();
    std::size_t last = 0;
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      if (masks_[i] == 0) continue;
      sides |= masks_[i];
      first = std::min(first, i);
      last = i;
    }
    if (sides == 0) return 0.0;
    const double cells = std::popcount(sides) * static_cast<double>(last - first + 1);
    return occupied() / (cells * -std::expm1(-points_ / cells));
  }

 private:
  double slice_m_;
  std::vector<std::uint64_t> masks_;
  int points_ = 0;
};

// The outline of a stem as it lies over the surface that was fitted, by steps of 10 degrees.
class Outline {
 public:
  void add(const AxisPlace& place, double error_m, double weight) {
    const std::size_t bin = ArcBins::bin_of(place.outward.x(), place.outward.y());
    errors_[bin] += weight * error_m;
    weights_[bin] += weight;
  }
  // See StemFit::oval.
  [[nodiscard]] Eigen::Vector2d oval() const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double bins = 0.0;
    for (std::size_t b = 0; b < ArcBins::kBins; ++b) {
      if (weights_[b] <= 0.0) continue;
      const double turn =
          2.0 * (static_cast<double>(b) + 0.5) * 2.0 * M_PI / static_cast<double>(ArcBins::kBins);
      sum += errors_[b] / weights_[b] * Eigen::Vector2d(std::cos(turn), std::sin(turn));
      ++bins;
    }
    if (bins < kOvalBins) return StemFit().oval;
    return 2.0 / bins * sum;
  }

 private:
  std::array<double, ArcBins::kBins> errors_{};
  std::array<double, ArcBins::kBins> weights_{};
};

// What speaks for and against the stem, and how much of it was seen.
void judge(const std::vector<SlicePoint>& points, const StemDetectorConfig& config,
           StemFitResult& result) {
  StemFit& stem = result.stem;
  const double scatter = result.evidence.scatter_m;
  StemEvidence evidence;
  evidence.scatter_m = scatter;
  const double band = surface_band_m(scatter);
  const double within = inside_from_m(band, stem.radius_m);
  ArcBins arc;
  Outline outline;
  Patches patches(config);
  int inner = 0;
  int outer = 0;
  double squares = 0.0;
  stem.lowest_m = config.highest_m;
  stem.highest_m = 0.0;
  const StemAxis axis(stem);
  for (const SlicePoint& point : points) {
    const AxisPlace place = axis.place(point);
    const double e = axis.surface_error(place);
    if (e < within) ++evidence.inside;
    if (e > band && e < 3.0 * band) ++outer;
    if (e < -band && e > -3.0 * band) ++inner;
    if (std::abs(e) > band) continue;
    ++evidence.on;
    evidence.returns += static_cast<int>(point.returns);
    squares += e * e;
    outline.add(place, e, static_cast<double>(point.returns));
    arc.add(place.outward.x(), place.outward.y());
    const auto height = static_cast<double>(point.height_m);
    patches.add(height, place);
    stem.lowest_m = std::min(stem.lowest_m, height);
    stem.highest_m = std::max(stem.highest_m, height);
  }
  evidence.slices = patches.slices();
  evidence.patches = patches.coarse();
  evidence.fill = patches.fill();
  // Rings of width 2 band: their areas go with their middle radii; where the inner one is cut off
  // by the centre, it is the disc.
  const double inner_edge = std::max(0.0, stem.radius_m - 3.0 * band);
  const double disc_edge = std::max(0.0, stem.radius_m - band);
  const double inner_area = disc_edge * disc_edge - inner_edge * inner_edge;
  const double on_density = evidence.on / (4.0 * band * std::max(stem.radius_m, 0.5 * band));
  const double outer_density = outer / (4.0 * band * (stem.radius_m + 2.0 * band));
  if (evidence.on > 0) {
    evidence.inside_ratio = inner_area > 1e-5 ? inner / inner_area / on_density : 0.0;
    evidence.outside_ratio = outer_density / on_density;
  }
  stem.arc_deg = arc.covered_deg();
  // The scatter of points along one line of sight would pass for an outline.
  const bool all_round = arc.even_deg() >= kOvalEvenDeg && scatter <= kOvalScatter * stem.radius_m;
  stem.oval = all_round ? outline.oval() : StemFit().oval;
  evidence.even_arc_deg = arc.even_deg();
  stem.returns = evidence.returns;
  stem.rms_m = evidence.on > 0 ? std::sqrt(squares / evidence.on) : 0.0;
  result.evidence = evidence;
}

// A thin stem where most of the points are.
StemFit thin_start(const std::vector<SlicePoint>& points, const StemFit& start) {
  const StemAxis axis(start);
  const double band = 3.0 * start.rms_m;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double square = 0.0;
  double weight = 0.0;
  for (const SlicePoint& point : points) {
    const AxisPlace place = axis.place(point);
    if (std::abs(axis.surface_error(place)) > band) continue;
    const auto w = static_cast<double>(point.returns);
    const Eigen::Vector2d off = place.distance_m * place.outward.head<2>();
    mean += w * off;
    square += w * off.squaredNorm();
    weight += w;
  }
  StemFit thin = start;
  if (weight <= 0.0) return thin;
  mean /= weight;
  thin.centre += mean;
  thin.radius_m = std::max(
      kThinRadius, kThinSpreads * std::sqrt(std::max(0.0, square / weight - mean.squaredNorm())));
  return thin;
}

// Returns are not independent, and their places on the surface are not known. The errors are
// therefore larger than the fit's covariance says, and more so where it is large. Both factors are
// measured on maps of simulated recordings with known poses (handheld seeds 1 and 2, harvester seed
// 1). With them 95 % of the diameters are within two standard deviations, near the path and 30 m
// from it. On top comes what no fit can see: keyframes that do not quite lie on each other, a stem
// that is not round.
void set_uncertainty(const NoisyCylinder& fit, StemFit& stem) {
  const double spread = std::sqrt(std::max(1e-12, fit.covariance(4, 4)));
  const double factor = kLinear * kLinear + std::pow(kSquare * spread, 2);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      stem.covariance(i, j) = factor * fit.covariance(i < 2 ? i : 4, j < 2 ? j : 4);
  }
  stem.covariance(2, 2) += kMapError * kMapError;
  stem.spread_m = spread;
  Eigen::Matrix<double, 2, 6> foot = Eigen::Matrix<double, 2, 6>::Zero();
  foot.leftCols<2>().setIdentity();
  foot.block<2, 2>(0, 2) = -kBreastHeight * Eigen::Matrix2d::Identity();
  stem.foot_covariance = factor * foot * fit.covariance * foot.transpose();
}

// Makes the noisy cylinder the stem of the result, if it is one, and takes the figures anew.
void take_over(const NoisyCylinder& fit, const std::vector<SlicePoint>& points,
               const StemDetectorConfig& config, StemFitResult& result) {
  result.converged = fit.converged && 2.0 * fit.radius_m <= config.max_dbh_m;
  if (!result.converged) return;
  take_cylinder(fit, result.stem);
  result.evidence.scatter_m = std::clamp(fit.scatter_m, kLeastScatter, most_scatter_m(config));
  judge(points, config, result);
  result.evidence.scatter_m = fit.scatter_m;
}

}  // namespace

void take_cylinder(const NoisyCylinder& fit, StemFit& stem) {
  stem.centre = fit.centre;
  stem.slope = fit.slope;
  stem.radius_m = fit.radius_m;
  stem.taper = fit.taper;
  stem.scatter_m = fit.scatter_m;
  set_uncertainty(fit, stem);
}

StemFitResult fit_stem(const std::vector<SlicePoint>& points, const StemFit& start,
                       const StemDetectorConfig& config) {
  StemFitResult result;
  StemFit& stem = result.stem;
  stem = start;
  stem.taper = kUsualTaper;
  const std::vector<SlicePoint> some =
      sample_of(points, stem, std::max(kSampleReach, kReachBlurs * config.blur_m));
  const auto scatter_now = [&] {
    return scatter_of(some, stem, std::max(kScatterReach, kScatterBlurs * config.blur_m),
                      most_scatter_m(config));
  };
  double scatter = std::max({kFirstScatter, config.blur_m, scatter_now()});
  System system;
  for (int iteration = 0; iteration < kMostSteps; ++iteration) {
    system = build_system(some, stem, start, scatter);
    if (system.used < 6) return result;
    const Vector6 step = -SymmetricSolver<6>(system.normal).solve(system.gradient);
    if (!step.allFinite() || step.head<2>().norm() > kLongestStep) return result;
    stem.centre += step.head<2>();
    stem.slope += step.segment<2>(2);
    stem.radius_m += step[4];
    stem.taper += step[5];
    if (stem.radius_m < kLeastRadiusShare * config.min_dbh_m || stem.radius_m > config.max_dbh_m)
      return result;
    if (iteration >= kFixedScatterSteps) scatter = scatter_now();
    if (iteration > 4 && step.norm() < kSettled) break;
  }
  result.converged = true;
  result.evidence.scatter_m = scatter;
  judge(points, config, result);
  // Errors of a map (drift, ranging) are alike for neighbouring points. The number of independent
  // measurements is therefore that of patches on the surface, not of points.
  const int patches = std::max(1, result.evidence.patches);
  const double thinning = std::max(1.0, system.weight / patches);
  const Matrix6 covariance = scatter * scatter * thinning * inverse_matrix(system.normal);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      stem.covariance(i, j) = covariance(i < 2 ? i : 4, j < 2 ? j : 4);
  }
  return result;
}

StemFitResult refine_stem(const std::vector<SlicePoint>& points, const StemFitResult& fit,
                          const StemDetectorConfig& config) {
  StemFit start = fit.stem;
  start.rms_m = fit.evidence.scatter_m;
  NoisyCylinderConfig cylinder;
  cylinder.stray_reach_m = std::max(cylinder.stray_reach_m, kReachBlurs * config.blur_m);
  cylinder.most_scatter_m = std::max(cylinder.most_scatter_m, kMostRefinedBlurs * config.blur_m);
  std::vector<SlicePoint> near;
  const StemAxis axis(start);
  for (const SlicePoint& point : points) {
    if (axis.surface_error(point) < cylinder.stray_reach_m) near.push_back(point);
  }
  NoisyCylinder best = fit_noisy_cylinder(near, start, cylinder);
  if (fit.evidence.scatter_m > kThinTryScatter * start.radius_m ||
      fit.evidence.fill < kThinTryFill || fit.evidence.even_arc_deg < kThinTryArc * start.arc_deg) {
    const NoisyCylinder thin = fit_noisy_cylinder(near, thin_start(near, start), cylinder);
    // It must not win by leaving out the half of a stem that was seen in few points.
    if (thin.converged && (!best.converged || (thin.log_likelihood > best.log_likelihood &&
                                               thin.strays < best.strays + kThinStrays)))
      best = thin;
  }
  StemFitResult result = fit;
  take_over(best, points, config, result);
  return result;
}

StemFitResult fit_in_foliage(const std::vector<SlicePoint>& points, const StemFit& column,
                             const StemDetectorConfig& config) {
  NoisyCylinderConfig foliage;
  foliage.stray_reach_m = kFoliageReach;
  foliage.most_strays = kFoliageStrays;
  foliage.max_points = kFoliagePoints;
  foliage.held_radius_m = kFoliageLeastRadius;
  std::vector<SlicePoint> near;
  const StemAxis axis(column);
  for (const SlicePoint& point : points) {
    if (axis.surface_error(point) < kFoliageReach) near.push_back(point);
  }
  StemFitResult result;
  result.stem = column;
  take_over(fit_noisy_cylinder(near, column, foliage), points, config, result);
  return result;
}

}  // namespace understory
