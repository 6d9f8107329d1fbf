#include "understory/forest/top_judgement.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "understory/forest/forest_constants.h"
#include "understory/forest/inventory.h"
#include "understory/forest/stems/not_a_tree.h"
#include "understory/forest/trees/occupied_space.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/forest/trees/view_limit.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::top_judgement;

// On the stem, `height_m` above the ground, world frame.
Eigen::Vector3d place_on(const InventoryResult& result, const StemFit& stem, double height_m) {
  Eigen::Vector3d place = result.origin;
  place.head<2>() += stem_place_at(stem, height_m);
  place.z() = result.ground.terrain.interpolate(place.x(), place.y()) + height_m;
  return place;
}

PlaceAbove above_ground(const InventoryResult& result, const Eigen::Vector3d& place) {
  const double ground = result.ground.terrain.interpolate(place.x(), place.y());
  return {(place - result.origin).head<2>(),
          std::isfinite(ground) ? place.z() - ground : kScannerHeight};
}

// How well a height of a stem was seen.
double view_at(const SightLines& sight, const InventoryResult& result, const StemFit& stem,
               double height_m, const Lookouts& lookouts) {
  const Eigen::Vector3d place = place_on(result, stem, height_m);
  const std::vector<Eigen::Vector3d> all = lookouts(place);
  const std::size_t step = all.size() / kMostLookouts + 1;  // evenly chosen
  std::vector<PlaceAbove> from;
  for (std::size_t i = 0; i < all.size(); i += step)
    from.push_back(above_ground(result, all[i]));
  const double chosen = static_cast<double>(std::max<std::size_t>(1, from.size()));
  return sight.view_of(above_ground(result, place), from) * static_cast<double>(all.size()) /
         chosen;
}

// Whether points above a top hang together with it. Ghosts are there as well farther up.
bool goes_on(const StemTops& tops, std::size_t stem) {
  const double beyond = tops.beyond_points[stem];
  return beyond >= kLeastBeyond && beyond >= kBeyondShare * tops.top_metre_points[stem] &&
         beyond > kGhosts * tops.sky_points[stem];
}

// How well the top of a tree was seen.
enum class TopView : char { kWell, kPoorly, kNot };

// Tops are not seen where trees go on above them, or would show too few points there.
std::vector<TopView> top_views(const StemTops& tops, const Lookouts& lookouts,
                               const InventoryResult& result) {
  const SightLines sight(tops.space);
  std::vector<TopView> views(result.stems.size(), TopView::kWell);
  parallel_for(views.size(), 16, [&](std::size_t i) {
    const double height = result.trees[i].height_m;
    if (!std::isfinite(height)) return;
    const StemFit& stem = result.stems[i];
    const double below = view_at(sight, result, stem, height - kBeside, lookouts);
    const double above = view_at(sight, result, stem, height + kBeside, lookouts);
    const double expected = below > 0.0 ? tops.top_metre_points[i] * above / below : 0.0;
    if (expected < kLeastExpected || goes_on(tops, i)) {
      views[i] = TopView::kNot;
    } else if (expected < kWellExpected || tops.top_points[i] < kTopPoints) {
      views[i] = TopView::kPoorly;
    }
  });
  return views;
}

// Distance from the path, or what grows with it.
double farness_of(const InventoryResult& result, std::size_t tree,
                  const std::vector<Eigen::Vector3d>& scanner) {
  if (scanner.empty())
    return -static_cast<double>(result.stems[tree].returns) / result.trees[tree].dbh_m;
  const Eigen::Vector2d place(result.trees[tree].x, result.trees[tree].y);
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& from : scanner)
    least = std::min(least, (from.head<2>() - place).squaredNorm());
  return std::sqrt(least);
}

double sd_of(TopView view) {
  switch (view) {
    case TopView::kWell:
      return kHeightSd;
    case TopView::kPoorly:
      return kPoorSd;
    case TopView::kNot:
      break;
  }
  return kBoundSd;
}

// The same where the view is not known. Tops are not seen where they show too few points, or end
// with what was seen of others.
std::vector<TopView> likely_top_views(const StemTops& tops,
                                      const std::vector<Eigen::Vector3d>& scanner,
                                      const InventoryResult& result) {
  std::vector<TreeInView> trees;
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    // Of trees without a height, too: their tops tell where the view ends.
    trees.push_back({tops.top_m[i], result.trees[i].dbh_m, farness_of(result, i, scanner)});
  }
  std::vector<char> ends(result.stems.size(), 0);
  if (!result.from_above) ends = ends_with_the_view(trees);
  std::vector<TopView> views;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const bool seen = tops.top_points[i] >= kTopPoints && ends[i] == 0;
    views.push_back(seen ? TopView::kWell : TopView::kNot);
  }
  return views;
}

// Whether the stem ends where it was seen to end.
bool is_seen_to_end_low(const StemFit& stem, const SlicesNear& slices,
                        const StemDetectorConfig& config, const Lookouts& lookouts,
                        const InventoryResult& result) {
  if (stem.in_foliage || stem.highest_m > config.highest_m - kHalfMetre) return false;
  const PointsNear near = [&](const Eigen::Vector2d& centre, double reach,
                              const std::function<void(const SlicePoint&)>& visit) {
    slices.visit(GroundArea{centre, centre}.grown(reach), visit);
  };
  const int below = points_before_sudden_end(stem, near, config);
  if (below == 0) return false;
  OccupiedSpace space;
  slices.visit(GroundArea{stem.centre, stem.centre}.grown(kHidesWithin),
               [&](const SlicePoint& point) {
                 space.add({static_cast<double>(point.x), static_cast<double>(point.y)},
                           static_cast<double>(point.height_m));
               });
  const SightLines sight(space);
  const double seen = view_at(sight, result, stem, stem.highest_m - 0.5 * kHalfMetre, lookouts);
  const double above = view_at(sight, result, stem, stem.highest_m + kHalfMetre, lookouts);
  return seen > 0.0 && below * above / seen >= kSureExpected;
}

}  // namespace

void drop_low_ends(const SlicesNear& slices, const StemDetectorConfig& config,
                   const Lookouts& lookouts, InventoryResult& result) {
  if (!lookouts) return;
  std::erase_if(result.stems, [&](const StemFit& stem) {
    return is_seen_to_end_low(stem, slices, config, lookouts, result);
  });
}

double listed_height(const InventoryResult& result, const StemFit& stem, double top_m,
                     const Lookouts& lookouts) {
  if (!lookouts || !std::isfinite(top_m)) return top_m;
  const bool in_view = !lookouts(place_on(result, stem, top_m + kMargin)).empty();
  return in_view ? top_m : std::numeric_limits<double>::quiet_NaN();
}

void judge_tops(const StemTops& tops, const Lookouts& lookouts,
                const std::vector<Eigen::Vector3d>& scanner, InventoryResult& result) {
  const std::vector<TopView> views =
      lookouts ? top_views(tops, lookouts, result) : likely_top_views(tops, scanner, result);
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    Tree& tree = result.trees[i];
    if (std::isnan(tree.height_m)) continue;
    tree.height_is_lower_bound = views[i] == TopView::kNot ? 1.0 : 0.0;
    tree.height_sd_m = std::hypot(sd_of(views[i]), result.ground.unseen.sd_m(tree.x, tree.y));
  }
}

}  // namespace understory
