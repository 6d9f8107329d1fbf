#include "understory/forest/tiles/crown_tiles.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "understory/forest/forest_constants.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_surroundings.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::crown_tiles;
using forest_constants::inventory::kHighest;

// A point over the canopy's ceiling, near a stem: part of that tree, or a ghost.
struct HeldBack {
  Eigen::Vector2f place;
  float height_m = 0.0F;
  float over_foot_m = 0.0F;  // above the ground at the stem
  std::uint32_t tree = 0;
};

// Decimetres.
constexpr int kHalfMetre = 5;
constexpr int kBeyond = 40;
constexpr int kSky = 80;
// m above a top.
constexpr double kSkyFrom = 8.0;

// Height of the ground at each stem over the origin.
std::vector<double> ground_at_stems(const CrownTask& task, const std::vector<StemFit>& stems) {
  std::vector<double> ground;
  for (const StemFit& stem : stems) {
    const Eigen::Vector2d foot = task.origin.head<2>() + stem.centre - kBreastHeight * stem.slope;
    ground.push_back(task.ground.terrain.interpolate(foot.x(), foot.y()) - task.origin.z());
  }
  return ground;
}

// Stems in an area: of each, its number and a copy. All in their order.
struct StemsNear {
  std::vector<std::size_t> numbers;
  std::vector<StemFit> stems;

  StemsNear(const std::vector<StemFit>& all, const GroundArea& area) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!area.contains(all[i].centre)) continue;
      numbers.push_back(i);
      stems.push_back(all[i]);
    }
  }
  // Of a value for each stem of all, those of these.
  [[nodiscard]] std::vector<char> of(const std::vector<char>& all) const {
    std::vector<char> some;
    for (const std::size_t i : numbers)
      some.push_back(all[i]);
    return some;
  }
};

// One tile on the way up.
class TileAbove {
 public:
  TileAbove(const CrownTask& task, std::size_t tile, double canopy_cell_m,
            const std::vector<char>& with_sheet)
      : task_(task),
        area_(task.cloud.tiles()[tile].moved(-task.origin.head<2>())),
        own_(task.stems, area_),
        around_(task.stems, area_.grown(kStemsBeyond)),
        columns_(around_.stems, ground_at_stems(task, around_.stems)),
        sheets_(own_.stems, task.slices.in(area_.grown(kSlicesBeyond)), own_.of(with_sheet)),
        canopy_(canopy_cell_m) {
    own_number_.assign(around_.stems.size(), -1);
    std::size_t own = 0;
    for (std::size_t i = 0; i < around_.stems.size(); ++i) {
      if (area_.contains(around_.stems[i].centre))
        own_number_[i] = static_cast<std::int32_t>(own++);
    }
    if (task.full) surroundings_.emplace(own_.stems, ground_at_stems(task, own_.stems));
  }

  void gather() {
    std::vector<double> heights;
    const GroundArea seen = area_.grown(kPointsBeyond);
    task_.cloud.in(seen.moved(task_.origin.head<2>()),
                   [&](std::span<const Eigen::Vector3d> points) {
                     task_.progress.poll();
                     task_.ground.heights_above(points, heights);
                     for (std::size_t i = 0; i < points.size(); ++i) {
                       if (heights[i] >= 0.0 && heights[i] <= kHighest)
                         add(points[i] - task_.origin, heights[i]);
                     }
                   });
    for (std::size_t i = 0; i < around_.stems.size(); ++i) {
      tops_.push_back(columns_.top(i, task_.slices_end_m, task_.low_tops));
      reached_.push_back(columns_.top_with_neighbours(i, task_.slices_end_m, task_.low_tops));
    }
    // Near a scanner the ground has a hundred times the points of a crown, and the ceiling may lie
    // under the crown. A point below the top of its tree, or of what reaches over it, is real.
    for (const HeldBack& point : held_back_) {
      if (static_cast<double>(point.over_foot_m) <= reached_[point.tree])
        canopy_.add(point.place.cast<double>(), static_cast<double>(point.height_m));
    }
  }

  // Curves of the tile's own stems need their heights.
  void finish(const ListedHeight& listed, StemTops& result) {
    std::vector<double>& tops = result.top_m;
    std::vector<StemCurve>& curves = result.curves;
    for (std::size_t i = 0; i < around_.numbers.size(); ++i) {
      if (!area_.contains(around_.stems[i].centre)) continue;
      const std::size_t stem = around_.numbers[i];
      tops[stem] = tops_[i];
      const double height = listed(stem, tops_[i]);
      if (!std::isfinite(height)) continue;
      result.top_points[stem] = columns_.points_below(i, height, kHalfMetre);
      result.top_metre_points[stem] = columns_.points_below(i, height, 2 * kHalfMetre);
      const bool overtopped = tops_[i] < reached_[i];
      result.beyond_points[stem] = columns_.points_above(i, height, kBeyond, overtopped);
      result.sky_points[stem] = columns_.points_above(i, height + kSkyFrom, kSky, overtopped);
    }
    if (!task_.full) return;
    std::vector<std::vector<SlicePoint>> points = surroundings_->take();
    parallel_for(points.size(), 4, [&](std::size_t i) {
      task_.progress.poll();
      const std::size_t stem = own_.numbers[i];
      curves[stem] = measure_stem_curve(std::move(points[i]), task_.stems[stem],
                                        listed(stem, tops[stem]), task_.curves);
    });
  }

  // By the numbers of all stems.
  [[nodiscard]] StemSheets take_sheets() {
    StemSheets sheets{sheets_.take(), sheets_.seen()};
    for (TreeSheet& sheet : sheets.sheets)
      sheet.tree = own_.numbers[sheet.tree];
    return sheets;
  }
  [[nodiscard]] const std::vector<std::size_t>& own_numbers() const { return own_.numbers; }
  [[nodiscard]] OccupiedSpace take_space() { return std::move(space_); }
  [[nodiscard]] CanopyGrid take_canopy() { return std::move(canopy_); }
  [[nodiscard]] std::vector<std::uint64_t> take_cubes() { return owners_.take_cubes(); }
  [[nodiscard]] std::vector<SlicePoint> take_low() { return low_.take(); }

 private:
  void add(const Eigen::Vector3d& point, double height) {
    const Eigen::Vector2d place = point.head<2>();
    const std::size_t tree = columns_.add(point, height);
    if (tree != TreeColumns::kNone && own_number_[tree] >= 0)
      sheets_.add(static_cast<std::size_t>(own_number_[tree]), place, height);
    if (area_.contains(place)) {
      if (task_.space) space_.add(place, height);
      if (task_.ceiling.holds(place, height)) {
        canopy_.add(place, height);
      } else if (tree != TreeColumns::kNone) {
        held_back_.push_back({place.cast<float>(), static_cast<float>(height),
                              static_cast<float>(point.z() - columns_.ground_m(tree)),
                              static_cast<std::uint32_t>(tree)});
      }
    }
    if (!task_.full) return;
    surroundings_->add(point);
    if (LowPoints::holds(height) && area_.contains(low_.corner_of(place))) low_.add(place, height);
    if (height > task_.ground.config.class_m && area_.contains(TreeOwners::corner_of(place)))
      owners_.add(place, height);
  }

  const CrownTask& task_;
  GroundArea area_;  // relative to the origin
  StemsNear own_;
  StemsNear around_;
  TreeColumns columns_;
  SheetCollector sheets_;                 // of own_
  std::vector<std::int32_t> own_number_;  // in own_, of each in around_; -1: beside the tile
  std::optional<StemSurroundings> surroundings_;  // in a full inventory
  CanopyGrid canopy_;
  OccupiedSpace space_;
  TreeOwners owners_;
  LowPoints low_;
  std::vector<HeldBack> held_back_;
  std::vector<double> tops_;     // of around_
  std::vector<double> reached_;  // the same, with the crowns of neighbours above them
};

}  // namespace

StemTops look_up(const CrownTask& task, double canopy_cell_m, const ListedHeight& listed) {
  const std::size_t tiles = task.cloud.tiles().size();
  StemTops result{std::vector<double>(task.stems.size()),
                  std::vector<int>(task.stems.size(), 0),
                  std::vector<int>(task.stems.size(), 0),
                  std::vector<int>(task.stems.size(), 0),
                  std::vector<int>(task.stems.size(), 0),
                  {},
                  {{}, std::vector<SeenSides>(task.stems.size())},
                  CanopyGrid(canopy_cell_m),
                  {},
                  TileShelf<std::uint64_t>(tiles, task.cloud.scratch()),
                  TileShelf<SlicePoint>(tiles, task.cloud.scratch())};
  if (task.full) result.curves.resize(task.stems.size());
  std::vector<std::optional<CanopyGrid>> canopies(tiles);
  std::vector<OccupiedSpace> spaces(tiles);
  std::vector<std::vector<TreeSheet>> sheets(tiles);
  const std::vector<char> with_sheet = most_doubtful(task.stems);
  for_tiles(task.cloud, [&](std::size_t tile) {
    TileAbove above(task, tile, canopy_cell_m, with_sheet);
    above.gather();
    above.finish(listed, result);
    StemSheets own = above.take_sheets();
    for (std::size_t i = 0; i < own.seen.size(); ++i)
      result.sheets.seen[above.own_numbers()[i]] = own.seen[i];
    sheets[tile] = std::move(own.sheets);
    canopies[tile] = above.take_canopy();
    spaces[tile] = above.take_space();
    result.cubes.put(tile, above.take_cubes());
    result.low.put(tile, above.take_low());
  });
  for (std::optional<CanopyGrid>& canopy : canopies) {
    result.canopy.add(*canopy);
    canopy.reset();
  }
  for (OccupiedSpace& space : spaces) {
    result.space.add(space);
    space = {};
  }
  for (std::vector<TreeSheet>& part : sheets)
    result.sheets.sheets.insert(result.sheets.sheets.end(), std::make_move_iterator(part.begin()),
                                std::make_move_iterator(part.end()));
  std::sort(result.sheets.sheets.begin(), result.sheets.sheets.end(),
            [](const TreeSheet& a, const TreeSheet& b) { return a.tree < b.tree; });
  return result;
}

OwnerTiles::OwnerTiles(const TiledCloud& cloud, const Eigen::Vector3d& origin)
    : origin_(origin),
      cubes_(cloud.tiles().size(), cloud.scratch()),
      owners_(cloud.tiles().size(), cloud.scratch()) {
  for (const GroundArea& tile : cloud.tiles())
    areas_.push_back(tile.moved(-origin.head<2>()));
}

std::int32_t OwnerTiles::owner_in(std::size_t tile, const TreeOwners& owners,
                                  const Eigen::Vector2d& place, double height_m) const {
  if (!areas_[tile].contains(TreeOwners::corner_of(place))) return kElsewhere;
  return owners.owner(place, height_m);
}

std::vector<TreeCrown> OwnerTiles::find(const CrownTask& task, TileShelf<std::uint64_t>& cubes,
                                        const std::vector<OwnerTree>& trees) {
  std::vector<TreeCrown> crowns(trees.size());
  for_tiles(task.cloud, [&](std::size_t tile) {
    const GroundArea around = areas_[tile].grown(kCrownsBeyond);
    const StemsNear near(task.stems, around);
    std::vector<OwnerTree> near_trees;
    for (const std::size_t i : near.numbers)
      near_trees.push_back(trees[i]);
    TreeOwners owners;
    for (const std::size_t other : tiles_touching(task.cloud, around.moved(origin_.head<2>())))
      owners.add_cubes(cubes.copy(other), around);
    owners.find(near_trees, task.progress);
    const std::vector<TreeCrown> found = measure_crowns(owners, near_trees);
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (areas_[tile].contains(near.stems[i].centre)) crowns[near.numbers[i]] = found[i];
    }
    auto [own_cubes, own_owners] = owners.owned_in(areas_[tile]);
    for (std::int32_t& owner : own_owners) {
      if (owner != TreeOwners::kNobody)
        owner = static_cast<std::int32_t>(near.numbers[static_cast<std::size_t>(owner)]);
    }
    cubes_.put(tile, std::move(own_cubes));
    owners_.put(tile, std::move(own_owners));
  });
  return crowns;
}

TreeOwners OwnerTiles::owners(std::size_t tile) const {
  return TreeOwners::of_cubes(cubes_.copy(tile), owners_.copy(tile));
}

bool OwnerTiles::holds(std::size_t tile, const Eigen::Vector3d& point) const {
  return areas_[tile].contains(TreeOwners::corner_of((point - origin_).head<2>()));
}

}  // namespace understory
