#include "understory/forest/dead_wood/stump_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>

#include "understory/forest/dead_wood_constants.h"
#include "understory/forest/search/circle_search.h"
#include "understory/forest/search/point_groups.h"
#include "understory/forest/stems/arc_bins.h"
#include "understory/forest/stems/point_index.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::stump_search;

// Those in which circles are searched.
constexpr auto kSlices = static_cast<std::size_t>(kHighestCircle / kSlice);

struct SlicedCircle {
  Circle circle;
  std::size_t slice = 0;
};

double height_of(std::size_t slice) {
  return kSlice * (static_cast<double>(slice) + 0.5);
}

// By x of their centres.
std::vector<SlicedCircle> circles_in(const std::vector<SlicePoint>& points,
                                     const StemSearchArea& where, const ProgressSink& progress) {
  std::vector<std::vector<Eigen::Vector2f>> slices(kSlices);
  for (const SlicePoint& point : points) {
    const auto slice = static_cast<std::size_t>(static_cast<double>(point.height_m) / kSlice);
    if (slice < slices.size()) slices[slice].emplace_back(point.x, point.y);
  }
  CircleSearchConfig search;
  search.min_radius_m = kThinnestStump;
  search.max_radius_m = kThickestStump;
  search.min_points = kLeastPoints;
  search.min_arc_deg = kLeastArc;
  search.area = where.area;
  search.origin = where.origin;
  const std::vector<std::vector<Circle>> found = find_circles(slices, search, kStumpSeed, progress);
  std::vector<SlicedCircle> circles;
  for (std::size_t slice = 0; slice < found.size(); ++slice) {
    for (const Circle& circle : found[slice])
      circles.push_back({circle, slice});
  }
  std::sort(circles.begin(), circles.end(), [](const SlicedCircle& a, const SlicedCircle& b) {
    const Eigen::Vector2d& ca = a.circle.centre;
    const Eigen::Vector2d& cb = b.circle.centre;
    return std::tuple(ca.x(), ca.y(), a.slice) < std::tuple(cb.x(), cb.y(), b.slice);
  });
  return circles;
}

bool alike(const Circle& a, const Circle& b) {
  return (a.centre - b.centre).norm() < kApart &&
         std::abs(a.radius_m - b.radius_m) < kUnlike * std::max(a.radius_m, b.radius_m);
}

// The circles of one stem, above each other.
struct Stack {
  std::vector<std::size_t> circles;  // numbers of all that are alike
  StemFit start;
  bool stands = false;  // enough slices, the lowest near the ground
};

Stack stack_on(std::size_t first, const std::vector<SlicedCircle>& all) {
  const Circle& circle = all[first].circle;
  Stack stack;
  std::vector<char> slices(kSlices, 0);
  std::size_t lowest = all[first].slice;
  auto other = std::lower_bound(
      all.begin(), all.end(), circle.centre.x() - kApart,
      [](const SlicedCircle& one, double low) { return one.circle.centre.x() < low; });
  for (; other != all.end() && other->circle.centre.x() < circle.centre.x() + kApart; ++other) {
    if (!alike(circle, other->circle)) continue;
    stack.circles.push_back(static_cast<std::size_t>(other - all.begin()));
    slices[other->slice] = 1;
    lowest = std::min(lowest, other->slice);
  }
  const auto shown = static_cast<std::size_t>(std::count(slices.begin(), slices.end(), 1));
  stack.stands = shown >= kLeastSlices && height_of(lowest) <= kLowestCircle;
  stack.start.centre = circle.centre;
  stack.start.radius_m = circle.radius_m;
  return stack;
}

bool is_foot(const StemFit& start, const std::vector<StemFit>& stems) {
  return std::any_of(stems.begin(), stems.end(), [&](const StemFit& stem) {
    return (stem_place_at(stem, 0.0) - start.centre).norm() < stem.radius_m + start.radius_m;
  });
}

// Height of the top: nearly all points over the circle lie below it. NaN where they go on.
double top_of(const StemFit& start, const PointIndex& index,
              const std::vector<SlicePoint>& points) {
  std::vector<float> heights;
  index.near(start.centre, start.radius_m + kStumpBand, [&](std::size_t i) {
    const Eigen::Vector2d place(points[i].x, points[i].y);
    if ((place - start.centre).norm() < start.radius_m + kStumpBand)
      heights.push_back(points[i].height_m);
  });
  if (heights.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(heights.begin(), heights.end());
  // The lowest height above which a stump's height of air holds few of them.
  for (std::size_t i = heights.size() / 2; i < heights.size(); ++i) {
    const auto top = static_cast<double>(heights[i]);
    const auto end =
        std::upper_bound(heights.begin(), heights.end(), static_cast<float>(top + kClearAbove));
    const auto above = static_cast<double>(end - heights.begin()) - static_cast<double>(i + 1);
    if (above <= kAboveShare * static_cast<double>(i + 1)) return top;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double diameter_sd(const StemFit& stem) {
  return 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
}

// What surrounds a stump at its own heights, thinned points.
struct StumpSight {
  int on = 0;
  int inside = 0;
  int around = 0;
  double arc_deg = 0.0;
  int returns = 0;
};

StumpSight look_at(const StemFit& fit, double top_m, const PointIndex& index,
                   const std::vector<SlicePoint>& points) {
  StumpSight sight;
  ArcBins bins;
  const double reach = fit.radius_m + kSurrounding;
  index.near(fit.centre, reach, [&](std::size_t i) {
    const SlicePoint& point = points[i];
    const auto height = static_cast<double>(point.height_m);
    if (height > kWallShare * top_m) return;
    const Eigen::Vector2d off = Eigen::Vector2d(point.x, point.y) - fit.centre;
    const double radius = fit.radius_m + fit.taper * (height + kFitRise - kBreastHeight);
    const double out = off.norm() - radius;
    if (std::abs(out) < kStumpBand) {
      ++sight.on;
      sight.returns += static_cast<int>(point.returns);
      bins.add(off.x(), off.y());
    } else if (out < 0.0) {
      ++sight.inside;
    } else if (out < kSurrounding) {
      ++sight.around;
    }
  });
  sight.arc_deg = bins.covered_deg();
  return sight;
}

// Whether a fit shows a stump of this height.
bool is_stump(const StemFitResult& fit, double top_m, const StumpSight& sight) {
  const double diameter = 2.0 * fit.stem.radius_m;
  return top_m <= kSlenderest * diameter && sight.returns >= kLeastReturns &&
         sight.arc_deg >= kLeastStumpArc && sight.inside <= kMostInside * sight.on &&
         sight.around <= kMostAround * sight.on && fit.evidence.scatter_m <= kMostScatterStump &&
         fit.evidence.outside_ratio <= kMostOutsideStump &&
         (fit.evidence.outside_ratio <= kFewOutsideStump ||
          sight.around <= kFewAround * sight.on) &&
         diameter_sd(fit.stem) <= kMostSdStump * diameter;
}

std::optional<StumpFit> fit_stump(const StemFit& start, const PointIndex& index,
                                  const std::vector<SlicePoint>& points) {
  const double top = top_of(start, index, points);
  if (!(top >= kLowestStump && top <= kHighestStump)) return std::nullopt;
  std::vector<SlicePoint> near;
  index.near(start.centre, start.radius_m + kSurrounding, [&](std::size_t i) {
    SlicePoint point = points[i];
    if (static_cast<double>(point.height_m) > kWallShare * top) return;
    point.height_m += static_cast<float>(kFitRise);
    near.push_back(point);
  });
  const StemDetectorConfig config;
  StemFitResult fit = fit_stem(near, start, config);
  if (!fit.converged || fit.evidence.outside_ratio > kFarOutside) return std::nullopt;
  const StemFitResult finer = refine_stem(near, fit, config);
  if (finer.converged) fit = finer;
  const StemFit& stem = fit.stem;
  const StumpSight sight = look_at(stem, top, index, points);
  if (!is_stump(fit, top, sight)) return std::nullopt;
  StumpFit stump;
  const auto at = [&](double height) {
    return stem.centre + (height + kFitRise - kBreastHeight) * stem.slope;
  };
  const auto diameter_at = [&](double height) {
    return 2.0 * (stem.radius_m + (height + kFitRise - kBreastHeight) * stem.taper);
  };
  stump.centre = at(0.0);
  stump.top = at(top);
  stump.height_m = top;
  stump.diameter_m = diameter_at(0.0);
  stump.diameter_to_m = diameter_at(top);
  stump.diameter_sd_m = diameter_sd(stem);
  stump.returns = sight.returns;
  return stump;
}

}  // namespace

std::vector<StumpFit> find_stumps(std::vector<SlicePoint>& points,
                                  const std::vector<StemFit>& stems, const StemSearchArea& where,
                                  const ProgressSink& progress) {
  const PointIndex index(points);
  const std::vector<SlicedCircle> circles = circles_in(points, where, progress);
  std::vector<std::size_t> best_first(circles.size());
  std::iota(best_first.begin(), best_first.end(), std::size_t{0});
  sort_stably(best_first, [&](std::size_t a, std::size_t b) {
    return circles[a].circle.on * circles[a].circle.even_deg >
           circles[b].circle.on * circles[b].circle.even_deg;
  });
  std::vector<StumpFit> stumps;
  std::vector<char> tried(circles.size(), 0);
  for (const std::size_t i : best_first) {
    if (tried[i] != 0) continue;
    const Circle& circle = circles[i].circle;
    const bool known = std::any_of(stumps.begin(), stumps.end(), [&](const StumpFit& stump) {
      return (stump.centre - circle.centre).norm() < 0.5 * stump.diameter_m + circle.radius_m;
    });
    if (known) continue;
    const Stack stack = stack_on(i, circles);
    if (!stack.stands || is_foot(stack.start, stems)) continue;
    for (const std::size_t other : stack.circles)
      tried[other] = 1;
    if (const std::optional<StumpFit> stump = fit_stump(stack.start, index, points))
      stumps.push_back(*stump);
  }
  std::erase_if(stumps, [&](const StumpFit& stump) { return !where.area.contains(stump.centre); });
  std::sort(stumps.begin(), stumps.end(), [](const StumpFit& a, const StumpFit& b) {
    return a.centre.x() != b.centre.x() ? a.centre.x() < b.centre.x() : a.centre.y() < b.centre.y();
  });
  return stumps;
}

double stump_search_reach() {
  return group_reach_m(kThickestStump, CircleSearchConfig().band_m) + kApart + kSurrounding;
}

}  // namespace understory
