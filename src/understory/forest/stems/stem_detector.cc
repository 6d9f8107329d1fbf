#include "understory/forest/stems/stem_detector.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "understory/forest/blur_constants.h"
#include "understory/forest/search/circle_search.h"
#include "understory/forest/search/foliage_columns.h"
#include "understory/forest/search/point_groups.h"
#include "understory/forest/search/ring_linker.h"
#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/blurred_stems.h"
#include "understory/forest/stems/breast_height_sections.h"
#include "understory/forest/stems/not_a_tree.h"
#include "understory/forest/stems/point_index.h"
#include "understory/forest/stems/stem_criteria.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/forest/stems/surface_band.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace blur_constants;
using namespace stem_constants::stem_detector;

std::vector<Ring> find_rings(const std::vector<SlicePoint>& points,
                             const std::vector<char>& explained, const SliceCut& cut,
                             const StemDetectorConfig& config, const StemSearchArea& where,
                             const ProgressSink& progress) {
  const double span = config.highest_m - config.lowest_m;
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(span / cut.thickness_m)));
  std::vector<std::vector<Eigen::Vector2f>> slices(count);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (explained[i] != 0) continue;
    const double above = static_cast<double>(points[i].height_m) - config.lowest_m;
    if (above < 0.0 || above >= span) continue;
    const auto slice =
        std::min(count - 1, static_cast<std::size_t>(above / span * static_cast<double>(count)));
    slices[slice].emplace_back(points[i].x, points[i].y);
  }
  CircleSearchConfig search;
  search.min_radius_m = kLeastRadiusShare * config.min_dbh_m;
  search.max_radius_m = 0.5 * config.max_dbh_m;
  search.reach_m = cut.reach_m;
  search.band_m = cut.band_m;
  search.area = where.area.grown(kRingsBeyond);
  search.origin = where.origin;
  std::vector<Ring> rings;
  const std::vector<std::vector<Circle>> circles =
      find_circles(slices, search, hash_numbers(count, 0), progress);
  for (std::size_t s = 0; s < count; ++s) {
    const double middle =
        config.lowest_m + (static_cast<double>(s) + 0.5) * span / static_cast<double>(count);
    for (const Circle& circle : circles[s])
      rings.push_back({circle, middle, static_cast<int>(s)});
  }
  return rings;
}

bool same_stem(const StemFit& a, const StemFit& b) {
  const double larger = std::max(a.radius_m, b.radius_m);
  const double smaller = std::min(a.radius_m, b.radius_m);
  // Stems do not overlap; what does so by more than the fits' errors is one stem.
  return (a.centre - b.centre).norm() <
         std::max(kSameOfBoth * (larger + smaller), larger + kSameOfSmaller * smaller);
}

// A fit, and the points that it was made of.
struct StemCandidate {
  StemFitResult fit;
  std::vector<SlicePoint> near;
};

// Those whose radius the first fit told, then by support: many returns, evenly on the parts that
// were seen.
void sort_by_support(std::vector<StemCandidate>& fits) {
  sort_stably(fits, [](const StemCandidate& first, const StemCandidate& second) {
    const StemFitResult& a = first.fit;
    const StemFitResult& b = second.fit;
    if (a.flat != b.flat) return b.flat;
    const double qa = a.evidence.patches * a.evidence.fill;
    const double qb = b.evidence.patches * b.evidence.fill;
    if (qa != qb) return qa > qb;
    const Eigen::Vector2d& ca = a.stem.centre;
    const Eigen::Vector2d& cb = b.stem.centre;
    return ca.x() != cb.x() ? ca.x() < cb.x() : ca.y() < cb.y();
  });
}

// Returns on the stem's surface that no better stem has taken.
int unclaimed_returns(const StemFitResult& fit, const PointIndex& index,
                      const std::vector<SlicePoint>& points, const std::vector<char>& explained) {
  const StemAxis axis(fit.stem);
  const double band = surface_band_m(fit.evidence.scatter_m);
  std::uint64_t returns = 0;
  index.near(fit.stem.centre, fit.stem.radius_m + kLeanReach, [&](std::size_t i) {
    if (explained[i] == 0 && std::abs(axis.surface_error(points[i])) <= band)
      returns += points[i].returns;
  });
  return static_cast<int>(returns);
}

bool is_tree(const StemFit& stem, const PointIndex& index, const std::vector<SlicePoint>& points,
             const StemDetectorConfig& config) {
  const PointsNear near = [&](const Eigen::Vector2d& centre, double reach,
                              const std::function<void(const SlicePoint&)>& visit) {
    index.near(centre, reach, [&](std::size_t i) { visit(points[i]); });
  };
  return doubt_of(stem, near, config) == TreeDoubt::kNone;
}

// Marks what belongs to a stem: surface, inside, and a margin.
void mark_explained(const StemFit& stem, const PointIndex& index,
                    const std::vector<SlicePoint>& points, std::vector<char>& explained) {
  const StemAxis axis(stem);
  index.near(stem.centre, stem.radius_m + kLeanReach, [&](std::size_t i) {
    if (axis.place(points[i]).distance_m <= stem.radius_m + kExplainedMargin) explained[i] = 1;
  });
}

double blurred_band_m(const StemDetectorConfig& config) {
  return std::max(kThickBand, kBlurredBand * config.blur_m);
}

SliceCut cut_of(StemCut cut, const StemDetectorConfig& config) {
  if (cut == StemCut::kThin) return {config.slice_m, config.min_slices, kThinReach, kThinBand};
  if (cut == StemCut::kBlurred) {
    return {kBlurredSlices * config.slice_m, config.min_slices,
            std::max(kThickReach, kBlurredReach * config.blur_m), blurred_band_m(config),
            config.blur_m};
  }
  return {kThickSlices * config.slice_m, kLeastThickSlices, kThickReach, kThickBand};
}

// The stem in a frame whose heights are less by `rise_m`: what was so much higher is at breast
// height.
StemFit seen_from_above(StemFit stem, double rise_m) {
  stem.centre += rise_m * stem.slope;
  stem.radius_m += rise_m * stem.taper;
  return stem;
}

// The way back. The diameter at breast height then has the error of the usual taper, and the foot
// that of the lean.
StemFit seen_from_below(StemFit stem, double rise_m) {
  stem.centre -= rise_m * stem.slope;
  stem.radius_m -= rise_m * stem.taper;
  if (stem.section_radius_m > 0.0) stem.section_radius_m -= rise_m * stem.taper;
  stem.below_sd_m = rise_m * kTaperSdBelow;
  stem.covariance(2, 2) += stem.below_sd_m * stem.below_sd_m;
  // The centre line's covariance grows with the square of the way to the foot.
  const double longer = (kBreastHeight + rise_m) / kBreastHeight;
  stem.foot_covariance *= longer * longer;
  stem.lowest_m += rise_m;
  stem.highest_m += rise_m;
  for (StemSlice& slice : stem.slices)
    slice.height_m += static_cast<float>(rise_m);
  return stem;
}

// The thinned points, and which of them the stems found so far explain.
struct Search {
  explicit Search(std::vector<SlicePoint>& all)
      : index(all), points(all), explained(all.size(), 0) {}
  PointIndex index;
  const std::vector<SlicePoint>& points;
  std::vector<char> explained;
  std::vector<StemFit> stems;

  // After stems were replaced.
  void know_anew() {
    explained.assign(points.size(), 0);
    for (const StemFit& stem : stems)
      mark_explained(stem, index, points, explained);
  }
  void know(const StemFit& stem) {
    stems.push_back(stem);
    mark_explained(stem, index, points, explained);
  }
};

// A thick circle with many points that only the fewest thick slices showed: two whorls make one.
// Where points are few, a far stem shows in no more.
bool is_of_whorls(const StemFit& start, const StemEvidence& evidence, const SliceCut& cut,
                  const StemDetectorConfig& config) {
  return cut.min_slices < config.min_slices &&
         start.slices.size() <= static_cast<std::size_t>(cut.min_slices) &&
         start.radius_m > kMostOfFewThickSlices &&
         evidence.on > kDensePointsPerSlice * evidence.slices;
}

// The points near a stem that no other one explains.
std::vector<SlicePoint> unexplained_near(const Search& search, const StemFit& stem,
                                         const StemDetectorConfig& config) {
  const double reach =
      stem.radius_m + kStartReach + stem.slope.norm() * (config.highest_m - kBreastHeight);
  std::vector<SlicePoint> near;
  const StemAxis axis(stem);
  const double within = stem.radius_m + kFitReach;
  search.index.near(stem.centre, reach, [&](std::size_t k) {
    const SlicePoint& point = search.points[k];
    if (search.explained[k] == 0 && axis.may_be_within(point, within) &&
        axis.place(point).distance_m < within)
      near.push_back(point);
  });
  return near;
}

// A fit that is a stem by itself, or has not converged.
StemCandidate fit_start(const Search& search, const StemFit& start, const SliceCut& cut,
                        const StemDetectorConfig& config) {
  std::vector<SlicePoint> near = unexplained_near(search, start, config);
  StemFitResult fit = fit_stem(near, start, config);
  const bool plain = is_stem(fit, cut, config);
  if (plain || is_flat_column(fit, cut, config)) {
    fit = refine_stem(near, fit, config);
    fit.flat = !plain;
    if (is_stem_still(fit, cut, config) && !is_of_whorls(start, fit.evidence, cut, config) &&
        is_tree(fit.stem, search.index, search.points, config))
      return {fit, std::move(near)};
  }
  fit.converged = false;
  return {fit, {}};
}

// Fits of all starts by `fit`, without those that are no stems.
template <typename Fit>
std::vector<StemCandidate> fit_all(const std::vector<StemFit>& starts, const ProgressSink& progress,
                                   const Fit& fit) {
  std::vector<StemCandidate> fits(starts.size());
  parallel_for(starts.size(), 1, [&](std::size_t i) {
    progress.poll();
    fits[i] = fit(starts[i]);
  });
  std::erase_if(fits, [](const StemCandidate& result) { return !result.fit.converged; });
  return fits;
}

// A thin stem within foliage: neither does its surface stand clear, nor is its inside empty.
bool is_foliage_stem(const StemFitResult& fit, const std::vector<SlicePoint>& near,
                     const Search& search, const StemDetectorConfig& config) {
  const StemFit& stem = fit.stem;
  return fit.converged && 2.0 * stem.radius_m >= config.min_dbh_m &&
         2.0 * stem.radius_m <= kFoliageDbh && fit.evidence.returns >= config.min_returns &&
         lean_deg_of(stem) <= kAloneLeanDeg && !is_too_stout(stem, config.highest_m) &&
         stands_in_foliage(near, stem) && is_tree(stem, search.index, search.points, config);
}

// Adds what no better stem explains. `sections`: the radius is told by them, too.
void add_unclaimed(std::vector<StemCandidate> fits, bool sections, const StemDetectorConfig& config,
                   Search& search) {
  const std::size_t known = search.stems.size();
  std::vector<std::vector<SlicePoint>> near;
  for (StemCandidate& candidate : fits) {
    const StemFitResult& fit = candidate.fit;
    const auto overlaps = [&](const StemFit& other) { return same_stem(fit.stem, other); };
    if (std::any_of(search.stems.begin(), search.stems.end(), overlaps)) continue;
    // A stem beside another must not live on the other's points.
    if (unclaimed_returns(fit, search.index, search.points, search.explained) <
        std::max(config.min_returns, fit.evidence.returns * 2 / 3)) {
      continue;
    }
    search.know(fit.stem);
    near.push_back(std::move(candidate.near));
  }
  if (!sections) return;
  parallel_for(near.size(), 1, [&](std::size_t i) {
    StemFit& stem = search.stems[known + i];
    stem.section_radius_m = radius_with_sections(near[i], stem);
  });
}

// A fit to a thin column that is a stem thinner than `most_m`, or has not converged. It stands
// clear or within foliage.
StemCandidate fit_column(const Search& search, const StemFit& column, double most_m,
                         const StemDetectorConfig& config) {
  const auto is_thinner = [&](const StemFitResult& fit) {
    return fit.converged && 2.0 * fit.stem.radius_m < most_m;
  };
  StemCandidate clear = fit_start(search, column, cut_of(StemCut::kThin, config), config);
  if (is_thinner(clear.fit)) return clear;
  const std::vector<SlicePoint> near = unexplained_near(search, column, config);
  StemFitResult fit = fit_in_foliage(near, column, config);
  fit.stem.in_foliage = true;
  fit.converged = is_thinner(fit) && is_foliage_stem(fit, near, search, config);
  return {fit, {}};
}

// Stems of config.min_dbh_m and more, but thinner than `most_m`, that show as thin columns.
void add_thin_stems(double most_m, const StemDetectorConfig& config, const StemSearchArea& where,
                    const ProgressSink& progress, Search& search) {
  const std::vector<StemFit> columns =
      find_foliage_columns(search.points, search.explained, config, where, progress);
  add_unclaimed(
      fit_all(columns, progress,
              [&](const StemFit& column) { return fit_column(search, column, most_m, config); }),
      false, config, search);
}

void add_foliage_stems(const StemDetectorConfig& config, const StemSearchArea& where,
                       const ProgressSink& progress, Search& search) {
  add_thin_stems(std::numeric_limits<double>::infinity(), config, where, progress, search);
}

// Those that the search before left out as too thin.
void add_thinnest_stems(const StemDetectorConfig& config, const StemSearchArea& where,
                        const ProgressSink& progress, Search& search) {
  StemDetectorConfig thin = config;
  thin.min_dbh_m = config.thin_dbh_m;
  add_thin_stems(config.min_dbh_m, thin, where, progress, search);
}

void add_stems(const SliceCut& cut, const StemDetectorConfig& config, const StemSearchArea& where,
               const ProgressSink& progress, Search& search) {
  const std::vector<Ring> rings =
      find_rings(search.points, search.explained, cut, config, where, progress);
  std::vector<StemFit> starts = link_rings(rings, cut.min_slices, config.max_lean_deg);
  const GroundArea fitted = where.area.grown(kFitsBeyond);
  std::erase_if(starts, [&](const StemFit& start) { return !fitted.contains(start.centre); });
  std::vector<StemCandidate> fits = fit_all(starts, progress, [&](const StemFit& start) {
    return fit_start(search, start, cut, config);
  });
  sort_by_support(fits);
  add_unclaimed(std::move(fits), cut.only_clear, config, search);
}

}  // namespace

std::vector<StemFit> detect_stems(std::vector<SlicePoint>& points, const StemDetectorConfig& config,
                                  const StemSearchArea& where, const ProgressSink& progress,
                                  double* blur_m) {
  Search search(points);
  for (const StemCut cut : {StemCut::kThin, StemCut::kThick})
    add_stems(cut_of(cut, config), config, where, progress, search);
  const double blur = add_blurred_stems(
      config,
      [&](StemCut cut, const StemDetectorConfig& blurred) {
        return detect_stems_in_cut(cut, points, {}, blurred, where, progress);
      },
      search.stems);
  if (blur_m != nullptr) *blur_m = blur;
  search.know_anew();
  add_foliage_stems(config, where, progress, search);
  sort_by_place(search.stems);
  return search.stems;
}

std::vector<StemFit> detect_stems_in_cut(StemCut cut, std::vector<SlicePoint>& points,
                                         const std::vector<StemFit>& known,
                                         const StemDetectorConfig& config,
                                         const StemSearchArea& where,
                                         const ProgressSink& progress) {
  Search search(points);
  for (const StemFit& stem : known)
    search.know(stem);
  if (cut == StemCut::kThinnest)
    add_thinnest_stems(config, where, progress, search);
  else if (cut == StemCut::kFoliage)
    add_foliage_stems(config, where, progress, search);
  else
    add_stems(cut_of(cut, config), config, where, progress, search);
  std::vector<StemFit> stems(search.stems.begin() + static_cast<std::ptrdiff_t>(known.size()),
                             search.stems.end());
  std::erase_if(stems, [&](const StemFit& stem) { return !where.area.contains(stem.centre); });
  return stems;
}

std::vector<HeightRange> hidden_stem_heights(const StemDetectorConfig& config) {
  std::vector<HeightRange> heights;
  for (const double rise : kHiddenRises)
    heights.push_back({kHiddenLowest + rise, kHiddenHighest + rise});
  // A shadow shows only where there are heights below.
  std::erase_if(heights, [&](const HeightRange& range) {
    return range.lowest_m < config.lowest_m + kShadowHeight;
  });
  return heights;
}

std::vector<StemFit> detect_hidden_stems(
    const HeightRange& heights, std::vector<SlicePoint>& points, const std::vector<StemFit>& known,
    const StemDetectorConfig& config, const StemSearchArea& where, const ProgressSink& progress) {
  const double rise = heights.lowest_m - kHiddenLowest;
  for (SlicePoint& point : points)
    point.height_m -= static_cast<float>(rise);
  Search search(points);
  for (const StemFit& stem : known)
    search.know(seen_from_above(stem, rise));
  SliceCut cut = cut_of(StemCut::kThin, config);
  cut.only_clear = true;
  StemDetectorConfig lowered = config;
  lowered.lowest_m = kHiddenLowest;
  lowered.highest_m = kHiddenHighest;
  add_stems(cut, lowered, where, progress, search);
  std::vector<StemFit> stems;
  for (std::size_t i = known.size(); i < search.stems.size(); ++i) {
    StemFit stem = seen_from_below(search.stems[i], rise);
    const double dbh = 2.0 * stem.radius_m;
    if (dbh < config.min_dbh_m || dbh > config.max_dbh_m) continue;
    if (where.area.contains(stem.centre)) stems.push_back(std::move(stem));
  }
  return stems;
}

double stem_search_reach(const StemDetectorConfig& config) {
  const double radius = 0.5 * config.max_dbh_m;
  return kRingsBeyond + group_reach_m(radius, std::max(kThinBand, blurred_band_m(config)));
}

void sort_by_place(std::vector<StemFit>& stems) {
  std::sort(stems.begin(), stems.end(), [](const StemFit& a, const StemFit& b) {
    return a.centre.x() != b.centre.x() ? a.centre.x() < b.centre.x() : a.centre.y() < b.centre.y();
  });
}

}  // namespace understory
