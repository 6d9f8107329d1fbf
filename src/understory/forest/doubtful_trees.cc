#include "understory/forest/doubtful_trees.h"

#include <cmath>
#include <cstdint>
#include <utility>

#include "understory/forest/inventory.h"
#include "understory/forest/trees/look_again.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/forest/trees/tree_sheets.h"

namespace understory {
namespace {

// Points that hang together with another tree. `owner`: of a place and a height.
template <typename Owner>
void mark_strangers(const InventoryResult& result, const Owner& owner, TreeSheet& sheet) {
  const Eigen::Vector2d foot = stem_place_at(result.stems[sheet.tree], 0.0);
  for (TreeSheet::FrontPoint& point : sheet.front) {
    const auto height = static_cast<double>(point.place.z());
    if (!(height > result.ground.config.class_m)) continue;
    const std::int32_t found = owner(foot + point.place.head<2>().cast<double>(), height);
    if (found != TreeOwners::kNobody && found != OwnerTiles::kElsewhere)
      point.own = found == static_cast<std::int32_t>(sheet.tree);
  }
}

void mark_strangers(InventoryResult& result) {
  if (result.owners) {
    const auto owner = [&](const Eigen::Vector2d& place, double height) {
      return result.owners->owner(place, height);
    };
    for (TreeSheet& sheet : result.sheets)
      mark_strangers(result, owner, sheet);
  }
  if (!result.owner_tiles) return;
  for (std::size_t tile = 0; tile < result.owner_tiles->size(); ++tile) {
    const TreeOwners owners = result.owner_tiles->owners(tile);
    const auto owner = [&](const Eigen::Vector2d& place, double height) {
      return result.owner_tiles->owner_in(tile, owners, place, height);
    };
    for (TreeSheet& sheet : result.sheets)
      mark_strangers(result, owner, sheet);
  }
}

std::vector<StandingStem> standing_stems(const InventoryResult& result,
                                         const std::vector<SeenSides>& seen) {
  std::vector<StandingStem> stems;
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    const StemFit& stem = result.stems[i];
    // Noise as wide as a thin stem within foliage stays, from wherever it is seen.
    const bool weak = has_weak_diameter(result.trees[i]) && !stem.in_foliage;
    stems.push_back({stem.centre, stem.radius_m, weak, seen[i]});
  }
  return stems;
}

double ground_at(const InventoryResult& result, const Eigen::Vector2d& place) {
  const Eigen::Vector2d at = result.origin.head<2>() + place;
  return result.ground.terrain.interpolate(at.x(), at.y());
}

LookAgain described(const InventoryResult& result, const std::vector<StandingStem>& stems,
                    const LookPlace& found) {
  LookAgain look;
  look.place.head<2>() = result.origin.head<2>() + found.place;
  look.place.z() = ground_at(result, found.place);
  for (const std::size_t i : found.stems) {
    look.trees.push_back(result.trees[i].id);
    look.towards += (stems[i].place - found.place) / static_cast<double>(found.stems.size());
    look.unseen_sides += lacks_a_side(stems[i]) ? 1 : 0;
  }
  return look;
}

}  // namespace

std::string reason_of(const LookAgain& look) {
  const auto trees = static_cast<int>(look.trees.size());
  if (look.unseen_sides == trees) return "unseen side";
  return look.unseen_sides == 0 ? "few points" : "unseen side, few points";
}

void look_at_doubtful_trees(StemSheets sheets, InventoryResult& result) {
  const std::vector<StandingStem> stems = standing_stems(result, sheets.seen);
  const auto walkable = [&](const Eigen::Vector2d& place) {
    return std::isfinite(ground_at(result, place));
  };
  for (const LookPlace& found : places_to_look(stems, walkable))
    result.look_again.push_back(described(result, stems, found));
  result.sheets = std::move(sheets.sheets);
  mark_strangers(result);
}

}  // namespace understory
