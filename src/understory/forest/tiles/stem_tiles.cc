#include "understory/forest/tiles/stem_tiles.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "understory/forest/forest_constants.h"
#include "understory/forest/slice/shadowed_points.h"
#include "understory/forest/slice/slice_thinner.h"
#include "understory/forest/stems/blurred_stems.h"
#include "understory/forest/stems/range_noise.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/tiles/tile_shelf.h"

namespace understory {
namespace {

using namespace forest_constants::stem_tiles;
using forest_constants::inventory::kHighest;

// Of one tile.
struct GatheredTile {
  CanopyCeiling ceiling;
  LowHeights low;
  CoverageGrid coverage;
  SeenCells seen;
  std::uint64_t points = 0;
  std::uint64_t without_ground = 0;
  std::uint64_t near_breast = 0;
  std::vector<SlicePoint> slices;
};

// The points of an area, which is relative to the origin.
std::vector<SlicePoint> points_in(const TileShelf<SlicePoint>& slices, const TiledCloud& cloud,
                                  const Eigen::Vector3d& origin, const GroundArea& area) {
  std::vector<SlicePoint> points;
  for (const std::size_t tile : tiles_touching(cloud, area.moved(origin.head<2>()))) {
    for (const SlicePoint& point : slices.copy(tile)) {
      if (area.contains({static_cast<double>(point.x), static_cast<double>(point.y)}))
        points.push_back(point);
    }
  }
  return points;
}

class StemTiles {
 public:
  StemTiles(const TiledCloud& cloud, const GroundModel& ground, const Eigen::Vector3d& origin,
            const StemDetectorConfig& config, const ProgressSink& progress)
      : cloud_(cloud),
        ground_(ground),
        origin_(origin),
        config_(config),
        progress_(progress),
        slices_(cloud.tiles().size(), cloud.scratch()),
        above_(cloud.tiles().size(), cloud.scratch()) {}

  StemHarvest run() {
    StemHarvest harvest;
    std::vector<GatheredTile> gathered(cloud_.tiles().size());
    for_tiles(cloud_, [&](std::size_t tile) { gathered[tile] = gather(tile); });
    for (std::size_t tile = 0; tile < gathered.size(); ++tile) {
      GatheredTile& part = gathered[tile];
      harvest.ceiling.add(part.ceiling);
      harvest.low.add(part.low);
      harvest.coverage.add(part.coverage);
      harvest.seen.add(part.seen);
      harvest.points += part.points;
      harvest.without_ground += part.without_ground;
      harvest.near_breast += part.near_breast;
    }
    harvest.ceiling.settle();
    if (gathered.size() == 1) {
      harvest.slices = slices_.take(0);
      harvest.stems = detect_stems(harvest.slices, config_, {{}, origin_.head<2>()}, progress_,
                                   &harvest.blur_m);
      const std::vector<SlicePoint> above = above_.take(0);
      for (const HeightRange& heights : hidden_stem_heights(config_)) {
        std::vector<SlicePoint> points =
            points_over_shadows(harvest.slices, above, heights.lowest_m, heights.highest_m);
        add(detect_hidden_stems(heights, points, harvest.stems, config_, {{}, origin_.head<2>()},
                                progress_),
            harvest.stems);
      }
      if (config_.thin_dbh_m > 0.0) {
        add(detect_stems_in_cut(StemCut::kThinnest, harvest.slices, harvest.stems, config_,
                                {{}, origin_.head<2>()}, progress_),
            harvest.stems);
      }
      measure(harvest);
      return harvest;
    }
    for (const StemCut cut : {StemCut::kThin, StemCut::kThick})
      search_cut(cut, harvest.stems);
    harvest.blur_m = add_blurred_stems(
        config_,
        [&](StemCut cut, const StemDetectorConfig& config) { return find_in_cut(cut, config, {}); },
        harvest.stems);
    search_cut(StemCut::kFoliage, harvest.stems);
    for (const HeightRange& heights : hidden_stem_heights(config_)) {
      const auto find = [&](const Nearby& nearby, const StemSearchArea& where) {
        const std::vector<SlicePoint> above = points_in(above_, cloud_, origin_, nearby.around);
        std::vector<SlicePoint> points =
            points_over_shadows(nearby.slices, above, heights.lowest_m, heights.highest_m);
        return detect_hidden_stems(heights, points, nearby.stems, config_, where, progress_);
      };
      add(find_in_tiles(harvest.stems, stem_search_reach(config_) + shadow_reach_m(), find),
          harvest.stems);
    }
    if (config_.thin_dbh_m > 0.0) search_cut(StemCut::kThinnest, harvest.stems);
    measure(harvest);
    add_shown(harvest.slices);
    harvest.thinned = std::move(slices_);
    return harvest;
  }

 private:
  [[nodiscard]] GroundArea local(std::size_t tile) const {
    return cloud_.tiles()[tile].moved(-origin_.head<2>());
  }

  GatheredTile gather(std::size_t tile) {
    GatheredTile part;
    SliceThinner thinner(config_.thin_m);
    SliceThinner above(config_.thin_m);
    double highest_searched = config_.highest_m;
    for (const HeightRange& heights : hidden_stem_heights(config_))
      highest_searched = std::max(highest_searched, heights.highest_m);
    const GroundArea area = local(tile);
    std::vector<double> heights;
    // A cube at the border belongs to the tile that holds its corner.
    cloud_.in(cloud_.tiles()[tile].grown(kCubeReach), [&](std::span<const Eigen::Vector3d> points) {
      progress_.poll();
      ground_.heights_above(points, heights);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector2d place = (points[i] - origin_).head<2>();
        const bool here = area.contains(place);
        const double height = heights[i];
        part.points += here ? 1 : 0;
        part.without_ground += here && std::isnan(height) ? 1 : 0;
        if (here && height < config_.highest_m) part.seen.add(place, height);
        if (!(height >= 0.0 && height <= kHighest)) continue;
        if (here) part.ceiling.count(place, height);
        if (here) part.low.add(height);
        const bool near_breast = height >= config_.lowest_m && height < config_.highest_m;
        if (here && height < config_.highest_m) part.coverage.add(place, near_breast);
        if (!(height >= config_.lowest_m && height < highest_searched)) continue;
        part.near_breast += here && near_breast ? 1 : 0;
        if (area.contains(thinner.corner_of(place.x(), place.y())))
          (near_breast ? thinner : above).add(place.x(), place.y(), height);
      }
    });
    slices_.put(tile, thinner.take());
    above_.put(tile, above.take());
    return part;
  }

  // What lies in and around a tile.
  struct Nearby {
    GroundArea around;
    std::vector<SlicePoint> slices;
    std::vector<StemFit> stems;  // that are known
  };

  // The stems that `find` finds in each tile, in which it is told of the known ones. `reach_m`: how
  // much around a tile it has to know.
  template <typename Find>
  std::vector<StemFit> find_in_tiles(const std::vector<StemFit>& known, double reach_m,
                                     const Find& find) {
    std::vector<std::vector<StemFit>> found(cloud_.tiles().size());
    for_tiles(cloud_, [&](std::size_t tile) {
      progress_.poll();
      const GroundArea area = local(tile);
      Nearby nearby{area.grown(reach_m), {}, {}};
      nearby.slices = points_in(slices_, cloud_, origin_, nearby.around);
      for (const StemFit& stem : known) {
        if (nearby.around.contains(stem.centre)) nearby.stems.push_back(stem);
      }
      found[tile] = find(std::move(nearby), {area, origin_.head<2>()});
    });
    std::vector<StemFit> all;
    for (std::vector<StemFit>& part : found)
      add(std::move(part), all);
    return all;
  }

  std::vector<StemFit> find_in_cut(StemCut cut, const StemDetectorConfig& config,
                                   const std::vector<StemFit>& known) {
    return find_in_tiles(
        known, stem_search_reach(config), [&](Nearby nearby, const StemSearchArea& where) {
          return detect_stems_in_cut(cut, nearby.slices, nearby.stems, config, where, progress_);
        });
  }

  void search_cut(StemCut cut, std::vector<StemFit>& stems) {
    add(find_in_cut(cut, config_, stems), stems);
  }

  static void add(std::vector<StemFit> found, std::vector<StemFit>& stems) {
    stems.insert(stems.end(), std::make_move_iterator(found.begin()),
                 std::make_move_iterator(found.end()));
    sort_by_place(stems);
  }

  // Calls visit(place in the list, points around it) for some of the stems, several at once.
  template <typename Visit>
  void visit_stems(const std::vector<std::size_t>& some, StemHarvest& harvest, const Visit& visit) {
    const std::vector<StemFit> found = harvest.stems;  // before they are measured
    const auto visit_all = [&](const std::vector<std::size_t>& here, const StemPoints& points) {
      parallel_for(here.size(), 1, [&](std::size_t i) {
        progress_.poll();
        visit(here[i], points.around(found[here[i]]));
      });
    };
    if (cloud_.tiles().size() == 1) return visit_all(some, StemPoints(harvest.slices, found));
    for_tiles(cloud_, [&](std::size_t tile) {
      const GroundArea area = local(tile);
      std::vector<std::size_t> here;
      for (const std::size_t i : some) {
        if (area.contains(found[i].centre)) here.push_back(i);
      }
      if (here.empty()) return;
      std::vector<SlicePoint> points =
          points_in(slices_, cloud_, origin_, area.grown(kMeasuredBeyond));
      visit_all(here, StemPoints(points, found));
    });
  }

  // The noise along the beams, and the stems measured with it. Those whose foot is hidden are
  // measured already, and those within foliage stay as they are.
  void measure(StemHarvest& harvest) {
    const std::vector<std::size_t> best = stems_for_range_noise(harvest.stems);
    std::vector<std::optional<RangeNoiseFits>> fits(harvest.stems.size());
    visit_stems(best, harvest, [&](std::size_t i, const std::vector<SlicePoint>& points) {
      fits[i] = fit_range_noise(points, harvest.stems[i]);
    });
    std::vector<RangeNoiseFits> told;
    for (const std::optional<RangeNoiseFits>& fit : fits) {
      if (fit) told.push_back(*fit);
    }
    harvest.range_noise_m = range_noise_of(told);
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < harvest.stems.size(); ++i) {
      if (!harvest.stems[i].in_foliage && harvest.stems[i].below_sd_m == 0.0) all.push_back(i);
    }
    visit_stems(all, harvest, [&](std::size_t i, const std::vector<SlicePoint>& points) {
      measure_at_breast_height(points, harvest.range_noise_m, harvest.stems[i]);
    });
    sort_by_place(harvest.stems);
  }

  // A cloud of any size has no more than so many for the report.
  void add_shown(std::vector<SlicePoint>& shown) {
    for (std::size_t tile = 0; tile < cloud_.tiles().size(); ++tile) {
      std::vector<SlicePoint> points = slices_.copy(tile);
      std::erase_if(points, [](const SlicePoint& point) {
        return std::abs(static_cast<double>(point.height_m) - kBreastHeight) > kShownReach;
      });
      const std::size_t step = points.size() * cloud_.tiles().size() / kMostShown + 1;
      for (std::size_t i = 0; i < points.size(); i += step)
        shown.push_back(points[i]);
    }
  }

  const TiledCloud& cloud_;
  const GroundModel& ground_;
  Eigen::Vector3d origin_;
  const StemDetectorConfig& config_;
  const ProgressSink& progress_;
  TileShelf<SlicePoint> slices_;
  TileShelf<SlicePoint> above_;  // of the heights over them, for stems whose foot is hidden
};

}  // namespace

std::vector<SlicePoint> SlicesNear::in(const GroundArea& area) const {
  return thinned_ ? points_in(*thinned_, cloud_, origin_, area) : whole_;
}

void SlicesNear::visit(const GroundArea& area,
                       const std::function<void(const SlicePoint&)>& visitor) const {
  const auto visit_those_of = [&](const std::vector<SlicePoint>& points) {
    for (const SlicePoint& point : points) {
      if (area.contains({static_cast<double>(point.x), static_cast<double>(point.y)}))
        visitor(point);
    }
  };
  if (thinned_) return visit_those_of(points_in(*thinned_, cloud_, origin_, area));
  visit_those_of(whole_);
}

StemHarvest find_stems(const TiledCloud& cloud, const GroundModel& ground,
                       const Eigen::Vector3d& origin, const StemDetectorConfig& config,
                       const ProgressSink& progress) {
  return StemTiles(cloud, ground, origin, config, progress).run();
}

}  // namespace understory
