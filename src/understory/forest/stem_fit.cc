#include "understory/forest/stem_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>

#include "understory/forest/arc_bins.h"

namespace understory {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kUsualTaper = -0.008;  // radius per metre of height, of a stem's lower part
constexpr double kTaperSd = 0.006;
constexpr double kSlopeSd = 0.05;
constexpr double kLeastScatter = 0.004;
constexpr double kMostScatter = 0.03;

double surface_error(const StemFit& stem, const AxisPlace& place) {
  return place.distance_m - (stem.radius_m + stem.taper * place.along_m);
}

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
  const double reach = 4.0 * scatter;
  const double upright = 1.0 / std::sqrt(1.0 + stem.slope.squaredNorm());
  for (const SlicePoint& point : points) {
    const AxisPlace place = place_on(stem, point);
    const double e = surface_error(stem, place);
    if (std::abs(e) >= reach || place.distance_m < 1e-4) continue;
    const double u = e / reach;
    // A point stands for its returns: the thinned cloud alone would fill the noise around a
    // surface evenly, which lies more outside than inside of it.
    const double weight = static_cast<double>(point.returns) * (1.0 - u * u) * (1.0 - u * u);
    Vector6 jacobian;
    const Eigen::Vector2d out = place.outward.head<2>();
    jacobian << -out, -place.along_m * upright * out, -1.0, -place.along_m;
    system.normal += weight * jacobian * jacobian.transpose();
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
std::vector<SlicePoint> sample_of(const std::vector<SlicePoint>& points, const StemFit& start) {
  constexpr double kReach = 0.15;
  constexpr std::size_t kEnough = 2'000;
  std::vector<SlicePoint> near;
  for (const SlicePoint& point : points) {
    if (std::abs(surface_error(start, place_on(start, point))) < kReach) near.push_back(point);
  }
  const std::size_t stride = near.size() / kEnough + 1;
  std::vector<SlicePoint> some;
  for (std::size_t i = 0; i < near.size(); i += stride)
    some.push_back(near[i]);
  return some;
}

double scatter_of(const std::vector<SlicePoint>& points, const StemFit& stem, double reach) {
  std::vector<std::pair<double, std::uint32_t>> errors;
  std::uint64_t returns = 0;
  for (const SlicePoint& point : points) {
    const double e = std::abs(surface_error(stem, place_on(stem, point)));
    if (e >= reach) continue;
    errors.emplace_back(e, point.returns);
    returns += point.returns;
  }
  if (errors.empty()) return kMostScatter;
  std::sort(errors.begin(), errors.end());
  std::uint64_t passed = 0;
  double middle = 0.0;
  for (const auto& [e, count] : errors) {
    middle = e;
    passed += count;
    if (2 * passed >= returns) break;
  }
  return std::clamp(1.4826 * middle, kLeastScatter, kMostScatter);
}

void judge(const std::vector<SlicePoint>& points, const StemDetectorConfig& config,
           StemFitResult& result) {
  StemFit& stem = result.stem;
  StemEvidence& evidence = result.evidence;
  const double band = std::max(2.5 * evidence.scatter_m, 0.015);
  const double within = -std::max(2.0 * band, 0.3 * stem.radius_m);
  ArcBins arc;
  std::set<int> slices;
  int inner = 0;
  int outer = 0;
  double squares = 0.0;
  stem.lowest_m = config.highest_m;
  stem.highest_m = 0.0;
  for (const SlicePoint& point : points) {
    const AxisPlace place = place_on(stem, point);
    const double e = surface_error(stem, place);
    if (e < within) ++evidence.inside;
    if (e > band && e < 3.0 * band) ++outer;
    if (e < -band && e > -3.0 * band) ++inner;
    if (std::abs(e) > band) continue;
    ++evidence.on;
    evidence.returns += static_cast<int>(point.returns);
    squares += e * e;
    arc.add(place.outward.x(), place.outward.y());
    slices.insert(static_cast<int>(point.height_m / config.slice_m));
    stem.lowest_m = std::min(stem.lowest_m, static_cast<double>(point.height_m));
    stem.highest_m = std::max(stem.highest_m, static_cast<double>(point.height_m));
  }
  evidence.slices = static_cast<int>(slices.size());
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
  evidence.even_arc_deg = arc.even_deg();
  stem.returns = evidence.returns;
  stem.rms_m = evidence.on > 0 ? std::sqrt(squares / evidence.on) : 0.0;
}

// Errors of a map are alike for neighbouring points (drift, ranging), so the number of independent
// measurements is that of patches on the surface, not of points.
int independent_patches(const std::vector<SlicePoint>& points, const StemFit& stem, double band,
                        double slice_m) {
  std::set<std::pair<int, std::size_t>> patches;
  for (const SlicePoint& point : points) {
    const AxisPlace place = place_on(stem, point);
    if (std::abs(surface_error(stem, place)) > band) continue;
    patches.insert({static_cast<int>(point.height_m / slice_m),
                    ArcBins::bin_of(place.outward.x(), place.outward.y()) / 3});
  }
  return static_cast<int>(patches.size());
}

}  // namespace

AxisPlace place_on(const StemFit& stem, const SlicePoint& point) {
  const double rise = static_cast<double>(point.height_m) - kBreastHeight;
  const Eigen::Vector3d axis = Eigen::Vector3d(stem.slope.x(), stem.slope.y(), 1.0) /
                               std::sqrt(1.0 + stem.slope.squaredNorm());
  const Eigen::Vector3d q(static_cast<double>(point.x) - stem.centre.x(),
                          static_cast<double>(point.y) - stem.centre.y(), rise);
  AxisPlace place;
  place.along_m = q.dot(axis);
  const Eigen::Vector3d out = q - place.along_m * axis;
  place.distance_m = out.norm();
  if (place.distance_m > 0.0) place.outward = out / place.distance_m;
  return place;
}

StemFitResult fit_stem(const std::vector<SlicePoint>& points, const StemFit& start,
                       const StemDetectorConfig& config) {
  StemFitResult result;
  StemFit& stem = result.stem;
  stem = start;
  stem.taper = kUsualTaper;
  const std::vector<SlicePoint> some = sample_of(points, stem);
  double scatter = std::max(0.015, scatter_of(some, stem, 0.05));
  System system;
  for (int iteration = 0; iteration < 25; ++iteration) {
    system = build_system(some, stem, start, scatter);
    if (system.used < 6) return result;
    const Vector6 step = -system.normal.ldlt().solve(system.gradient);
    if (!step.allFinite() || step.head<2>().norm() > 0.3) return result;
    stem.centre += step.head<2>();
    stem.slope += step.segment<2>(2);
    stem.radius_m += step[4];
    stem.taper += step[5];
    if (stem.radius_m < 0.3 * config.min_dbh_m || stem.radius_m > config.max_dbh_m) return result;
    if (iteration >= 3) scatter = scatter_of(some, stem, 0.05);
    if (iteration > 4 && step.norm() < 1e-4) break;
  }
  result.converged = true;
  result.evidence.scatter_m = scatter;
  judge(points, config, result);
  const int patches = std::max(1, independent_patches(points, stem, 3.0 * scatter, config.slice_m));
  const double thinning = std::max(1.0, system.weight / patches);
  const Matrix6 covariance = scatter * scatter * thinning * system.normal.inverse();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      stem.covariance(i, j) = covariance(i < 2 ? i : 4, j < 2 ? j : 4);
  }
  return result;
}

}  // namespace understory
