#include "understory/forest/slice/slice_stems.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "understory/forest/search/circle_search.h"
#include "understory/forest/slice_constants.h"
#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace stem_constants::slice_stems;
using stem_constants::surface_band::kBandScatters;

std::vector<Circle> circles_of(const std::vector<SlicePoint>& points,
                               const StemDetectorConfig& config, const ProgressSink& progress) {
  std::vector<std::vector<Eigen::Vector2f>> slice(1);
  for (const SlicePoint& point : points)
    slice[0].emplace_back(point.x, point.y);
  std::vector<Circle> all;
  for (const double band_m : kBands) {
    CircleSearchConfig search;
    search.min_radius_m = kLeastRadiusShare * config.min_dbh_m;
    search.max_radius_m = 0.5 * config.max_dbh_m;
    search.reach_m = kReach;
    search.band_m = band_m;
    search.whole_groups = true;
    const std::vector<Circle> found =
        find_circles(slice, search, hash_numbers(1, 0), progress).front();
    all.insert(all.end(), found.begin(), found.end());
  }
  return all;
}

StemFitResult start_of(const Circle& circle) {
  StemFitResult start;
  start.converged = true;
  start.stem.centre = circle.centre;
  start.stem.radius_m = circle.radius_m;
  start.stem.arc_deg = circle.arc_deg;
  start.evidence.scatter_m = std::max(circle.rms_m, kLeastScatter);
  start.evidence.even_arc_deg = circle.even_deg;
  start.evidence.fill = 1.0;
  return start;
}

// Whether a straight line suits the points on the surface as well as the circle does, or the
// outline goes on beside it. Then it is a wall or a buttress.
bool is_piece_of_outline(const std::vector<SlicePoint>& points, const StemFitResult& fit) {
  if (fit.stem.arc_deg > kWallArcDeg) return false;
  const StemAxis axis(fit.stem);
  const double band = kBandScatters * std::max(fit.evidence.scatter_m, kLeastScatter);
  double count = 0.0;
  double near = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (const SlicePoint& point : points) {
    const double error = axis.surface_error(point);
    if (error < kOutlineReach) near += 1.0;
    if (std::abs(error) > band) continue;
    const Eigen::Vector2d at(static_cast<double>(point.x) - fit.stem.centre.x(),
                             static_cast<double>(point.y) - fit.stem.centre.y());
    count += 1.0;
    sum += at;
    squares += at * at.transpose();
  }
  if (count < 3.0 || count < kOutlineShare * near) return true;
  const Eigen::Matrix2d spread = squares / count - sum * sum.transpose() / (count * count);
  // The smaller eigenvalue of a symmetric matrix.
  const double half = 0.5 * (spread(0, 0) + spread(1, 1));
  const double off = std::hypot(0.5 * (spread(0, 0) - spread(1, 1)), spread(0, 1));
  return fit.stem.rms_m > kLineTimes * std::sqrt(std::max(0.0, half - off));
}

bool is_stem(const StemFitResult& fit, const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  const double dbh = 2.0 * stem.radius_m;
  const double clutter = e.inside_ratio + e.outside_ratio;
  if (e.scatter_m > kNoisyShare * stem.radius_m && clutter > kNoisyClutter) return false;
  return fit.converged && dbh >= config.min_dbh_m && dbh <= config.max_dbh_m &&
         e.returns >= config.min_returns && stem.arc_deg >= config.min_arc_deg &&
         e.even_arc_deg >= kEvenArcShare * stem.arc_deg && kInsideTimes * e.inside <= e.on &&
         e.inside_ratio <= kMostInside && clutter <= kMostClutter &&
         e.scatter_m <= std::max(kMostScatter, kMostScatterShare * stem.radius_m);
}

// Points on the surface by steps of distance from it, both sides.
class RadialProfile {
 public:
  RadialProfile(const std::vector<SlicePoint>& points, const StemFit& stem) {
    const StemAxis axis(stem);
    for (const SlicePoint& point : points) {
      const double step = std::floor((axis.surface_error(point) + kProfileReach) / kProfileStep);
      if (step >= 0.0 && step < static_cast<double>(kSteps))
        counts_[static_cast<std::size_t>(step)] += static_cast<double>(point.returns);
    }
  }

  // Metres between the two highest summits with a valley between them; 0 if there is one summit.
  [[nodiscard]] double summits_apart() const {
    std::array<double, kSteps> smooth{};
    for (std::size_t i = 1; i + 1 < kSteps; ++i)
      smooth[i] = 0.25 * counts_[i - 1] + 0.5 * counts_[i] + 0.25 * counts_[i + 1];
    const auto first =
        static_cast<std::size_t>(std::max_element(smooth.begin(), smooth.end()) - smooth.begin());
    double apart = 0.0;
    double best = 0.0;
    for (std::size_t i = 0; i < kSteps; ++i) {
      const std::size_t low = std::min(i, first);
      const std::size_t high = std::max(i, first);
      const double valley =
          *std::min_element(smooth.begin() + static_cast<std::ptrdiff_t>(low),
                            smooth.begin() + static_cast<std::ptrdiff_t>(high) + 1);
      if (smooth[i] <= best || smooth[i] < kSecondSummit * smooth[first] ||
          valley > kValley * smooth[i])
        continue;
      best = smooth[i];
      apart = kProfileStep * static_cast<double>(high - low);
    }
    return apart;
  }

 private:
  static constexpr auto kSteps = static_cast<std::size_t>(2.0 * kProfileReach / kProfileStep);
  std::array<double, kSteps> counts_{};
};

// `points` by ascending x.
std::vector<SlicePoint> near_of(const std::vector<SlicePoint>& points, const Circle& circle) {
  std::vector<SlicePoint> near;
  const double reach = circle.radius_m + kFitReach;
  const auto first = std::lower_bound(
      points.begin(), points.end(), circle.centre.x() - reach,
      [](const SlicePoint& point, double x) { return static_cast<double>(point.x) < x; });
  for (auto point = first; point != points.end(); ++point) {
    const Eigen::Vector2d at(static_cast<double>(point->x), static_cast<double>(point->y));
    if (at.x() > circle.centre.x() + reach) break;
    if ((at - circle.centre).squaredNorm() < reach * reach) near.push_back(*point);
  }
  return near;
}

struct Candidate {
  bool accepted = false;
  StemFitResult fit;
  double rings_apart_m = 0.0;
};

Candidate measure(const std::vector<SlicePoint>& points, const Circle& circle,
                  const StemDetectorConfig& config) {
  const std::vector<SlicePoint> near = near_of(points, circle);
  Candidate candidate;
  candidate.fit = refine_stem(near, start_of(circle), config);
  candidate.fit.stem.slope.setZero();
  candidate.accepted = is_stem(candidate.fit, config) && !is_piece_of_outline(near, candidate.fit);
  if (!candidate.accepted) return candidate;
  StemFit& stem = candidate.fit.stem;
  candidate.rings_apart_m = RadialProfile(near, stem).summits_apart();
  // Which of the rings is the stem is not known.
  stem.covariance(2, 2) += 0.25 * candidate.rings_apart_m * candidate.rings_apart_m;
  return candidate;
}

}  // namespace

std::vector<SliceStem> measure_slice(std::vector<SlicePoint>& points,
                                     const StemDetectorConfig& config,
                                     const ProgressSink& progress) {
  for (SlicePoint& point : points)
    point.height_m = static_cast<float>(kBreastHeight);
  std::sort(points.begin(), points.end(), [](const SlicePoint& a, const SlicePoint& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.returns < b.returns;
  });
  const std::vector<Circle> circles = circles_of(points, config, progress);
  std::vector<Candidate> found(circles.size());
  parallel_for(circles.size(), 1, [&](std::size_t i) {
    progress.poll();
    found[i] = measure(points, circles[i], config);
  });
  std::erase_if(found, [](const Candidate& candidate) { return !candidate.accepted; });
  sort_stably(found, [](const Candidate& a, const Candidate& b) {
    const double qa = a.fit.evidence.even_arc_deg * a.fit.evidence.returns;
    const double qb = b.fit.evidence.even_arc_deg * b.fit.evidence.returns;
    return qa > qb;
  });
  std::vector<SliceStem> stems;
  for (const Candidate& candidate : found) {
    const StemFit& stem = candidate.fit.stem;
    const bool taken = std::any_of(stems.begin(), stems.end(), [&](const SliceStem& other) {
      const double apart = (other.stem.centre - stem.centre).norm();
      return apart < kLeastApart * (other.stem.radius_m + stem.radius_m);
    });
    if (!taken) stems.push_back({stem, candidate.rings_apart_m});
  }
  std::sort(stems.begin(), stems.end(), [](const SliceStem& a, const SliceStem& b) {
    const Eigen::Vector2d& ca = a.stem.centre;
    const Eigen::Vector2d& cb = b.stem.centre;
    return ca.x() != cb.x() ? ca.x() < cb.x() : ca.y() < cb.y();
  });
  return stems;
}

}  // namespace understory
