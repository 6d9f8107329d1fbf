#include "understory/forest/inventory.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "understory/forest/cell_grid.h"
#include "understory/forest/forest_constants.h"
#include "understory/forest/form/shared_feet.h"
#include "understory/forest/ground/uphill_side.h"
#include "understory/forest/inventory_remarks.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/tiles/stem_tiles.h"
#include "understory/forest/trees/double_images.h"
#include "understory/forest/trees/tree_crowns.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/forest/trees/tree_heights.h"

namespace understory {
namespace {

using namespace forest_constants::inventory;

// Area in which stems could be seen: squares of 2 m with points near breast height or on the
// ground. That is all in which the cloud holds anything.
double area_of(const Raster& canopy) {
  CellGrid<char> seen(kAreaCell);
  for (int row = 0; row < canopy.rows; ++row) {
    for (int column = 0; column < canopy.columns; ++column) {
      if (!std::isfinite(canopy.values[canopy.index(column, row)])) continue;
      seen.at((column + 0.5) * canopy.cell_m, (row + 0.5) * canopy.cell_m) = 1;
    }
  }
  std::size_t count = 0;
  seen.for_each([&](int, int, char cell) { count += cell != 0 ? 1 : 0; });
  return static_cast<double>(count) * kAreaCell * kAreaCell;
}

std::vector<Tree> trees_of(const InventoryResult& result, const std::vector<double>& heights) {
  std::vector<Tree> trees;
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    const StemFit& stem = result.stems[i];
    Tree tree;
    tree.id = static_cast<int>(i) + 1;
    // Down the centre line from breast height to the ground.
    const Eigen::Vector2d foot = stem.centre - kBreastHeight * stem.slope;
    tree.x = result.origin.x() + foot.x();
    tree.y = result.origin.y() + foot.y();
    tree.z = result.ground.terrain.interpolate(tree.x, tree.y);
    // At the uphill side breast height lies higher up the stem.
    const double rise = uphill_rise_m(result.ground.terrain, {tree.x, tree.y}, stem.radius_m);
    tree.dbh_m = 2.0 * (stem.radius_m + rise * stem.taper);
    tree.dbh_sd_m = 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
    tree.height_m = heights[i];
    tree.lean_deg = std::atan(stem.slope.norm()) * 180.0 / M_PI;
    tree.observations = stem.returns;
    tree.x_sd_m = std::sqrt(std::max(0.0, stem.foot_covariance(0, 0)));
    tree.y_sd_m = std::sqrt(std::max(0.0, stem.foot_covariance(1, 1)));
    trees.push_back(tree);
  }
  return trees;
}

// The radii with the sections at breast height. The search for stems compares those of whole stems.
void take_section_radii(InventoryResult& result) {
  for (StemFit& stem : result.stems)
    if (stem.section_radius_m > 0.0) stem.radius_m = stem.section_radius_m;
}

// Takes away what wide beams add to the radii, and says how sure these are.
void compensate_beams(const BeamConfig& config, const std::vector<Eigen::Vector3d>& scanner,
                      InventoryResult& result) {
  for (StemFit& stem : result.stems) {
    Eigen::Vector3d place = result.origin;
    place.head<2>() += stem.centre;
    place.z() = result.ground.terrain.interpolate(place.x(), place.y()) + kBreastHeight;
    const double range = mean_range_to(scanner, place);
    stem.beam = footprint_at(config, range);
    stem.beam_excess_m = excess_radius_m(stem.beam, stem.radius_m, stem.arc_deg);
    stem.radius_m -= stem.beam_excess_m;
    const double sd = diameter_sd_m(stem.spread_m, stem.arc_deg, range, stem.beam);
    const double foliage_sd_m = stem.in_foliage ? kFoliageRadiusSd : 0.0;
    stem.covariance(2, 2) =
        0.25 * sd * sd + stem.below_sd_m * stem.below_sd_m + foliage_sd_m * foliage_sd_m;
  }
}

// What the curves tell: volumes, and the forms of the stems.
void add_stem_forms(InventoryResult& result) {
  for (std::size_t i = 0; i < result.curves.size(); ++i) {
    Tree& tree = result.trees[i];
    const StemCurve& curve = result.curves[i];
    tree.stem_volume_m3 = curve.volume_m3;
    tree.stem_volume_sd_m3 = volume_sd_m3(curve, tree.dbh_sd_m / tree.dbh_m, tree.height_sd_m);
    tree.sweep_m = curve.sweep_m;
    if (curve.fork) tree.fork_m = curve.fork->height_m;
  }
  const std::vector<std::size_t> feet = shared_feet(result.stems);
  for (std::size_t i = 0; i < feet.size(); ++i)
    result.trees[i].foot_id = result.trees[feet[i]].id;
}

std::vector<OwnerTree> owner_trees(const InventoryResult& result, double slices_end_m) {
  std::vector<OwnerTree> trees;
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    const StemFit& stem = result.stems[i];
    OwnerTree tree;
    tree.radius_m = stem.radius_m;
    tree.height_m = result.trees[i].height_m;
    tree.seen_to_m = slices_end_m;
    if (std::isfinite(result.curves[i].measured_to_m))
      tree.seen_to_m = std::max(slices_end_m, result.curves[i].measured_to_m);
    for (const CurveSection& section : result.curves[i].sections)
      tree.centres.push_back(section.centre);
    if (tree.centres.empty()) {
      for (int decimetre = 0; decimetre < 100; ++decimetre)
        tree.centres.push_back(stem_place_at(stem, 0.1 * decimetre));
    }
    trees.push_back(std::move(tree));
  }
  return trees;
}

void find_crowns(const CrownTask& task, TileShelf<std::uint64_t>& cubes, InventoryResult& result) {
  const std::vector<OwnerTree> trees = owner_trees(result, task.slices_end_m);
  std::vector<TreeCrown> crowns;
  if (task.cloud.tiles().size() == 1) {
    result.owners = TreeOwners::of_cubes(cubes.take(0), {});
    result.owners->find(trees, task.progress);
    crowns = measure_crowns(*result.owners, trees);
  } else {
    result.owner_tiles = std::make_shared<OwnerTiles>(task.cloud, task.origin);
    crowns = result.owner_tiles->find(task, cubes, trees);
  }
  for (std::size_t i = 0; i < crowns.size(); ++i) {
    result.trees[i].crown_base_m = crowns[i].base_m;
    result.trees[i].crown_area_m2 = crowns[i].area_m2;
    result.trees[i].crown_volume_m3 = crowns[i].volume_m3;
    result.trees[i].snag = crowns[i].bare;
    for (Eigen::Vector2d& corner : crowns[i].outline)
      corner += result.origin.head<2>();
    result.crown_outlines.push_back(std::move(crowns[i].outline));
  }
}

// Half of the canopy that is higher than a breast is higher than this, metres above the ground; 0
// where there is none.
double canopy_height(const Raster& canopy) {
  std::vector<float> heights;
  for (const float height : canopy.values) {
    if (height > kBreastHeight) heights.push_back(height);
  }
  if (heights.empty()) return 0.0;
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return *middle;
}

// Whether the scanner was below a canopy of that height, at more than half of its places. World
// frame. A place without ground below does not count as such.
bool below_canopy(const std::vector<Eigen::Vector3d>& scanner, double canopy_m,
                  const InventoryResult& result) {
  std::size_t below = 0;
  for (const Eigen::Vector3d& place : scanner) {
    const double ground = result.ground.terrain.interpolate(place.x(), place.y());
    below += place.z() - ground < canopy_m ? 1 : 0;
  }
  return 2 * below > scanner.size();
}

void judge_density(const StemHarvest& gathered, const std::vector<Eigen::Vector3d>& scanner,
                   InventoryResult& result) {
  const auto returns = static_cast<double>(gathered.near_breast);
  result.too_sparse = returns < kSparse * std::max(1.0, result.area_m2);
  const bool few_low =
      result.too_sparse && returns < kFromAboveShare * static_cast<double>(result.points);
  const double canopy_m = canopy_height(result.canopy);
  const bool below = below_canopy(scanner, canopy_m, result);
  result.from_above = few_low && !below;
  // A cut at another height shows no stem, either.
  result.open_land = few_low && !result.stems.empty() && (below || canopy_m == 0.0) &&
                     result.thin.dense_share >= kDenseShare &&
                     result.thin.near_breast_per_m2 < kSparse;
  if (result.from_above) result.thin = {};  // no stem is looked for there
}

// Where stems could be seen. `scanner`: world frame.
VisibleArea seen_of(const SeenCells& cells, const std::vector<Eigen::Vector3d>& scanner,
                    double reach_m, const InventoryResult& result) {
  if (result.from_above) return {};
  std::vector<StemDisc> stems;
  for (const StemFit& stem : result.stems)
    stems.push_back({stem.centre, stem.radius_m});
  SeenFrom from;
  from.reach_m = reach_m;
  for (const Eigen::Vector3d& place : scanner)
    from.path.emplace_back((place - result.origin).head<2>());
  return find_seen_area(cells, result.origin.head<2>(), stems, from);
}

// Whether the stem of a listed tree stands below a crown's cells, or near its top.
std::vector<char> crowns_with_stems(const InventoryResult& result) {
  std::vector<char> taken(result.crowns->crowns.size(), 0);
  for (const Tree& tree : result.trees) {
    const std::int32_t crown = result.crowns->at({tree.x, tree.y});
    if (crown != CanopyCrowns::kNone) taken[static_cast<std::size_t>(crown)] = 1;
  }
  return taken;
}

// Trees whose stem was not seen, by their crowns.
void add_crowns(const InventoryConfig& config, InventoryResult& result) {
  if (config.crowns.search == CrownSearch::kNever ||
      (config.crowns.search == CrownSearch::kFromAbove && !result.from_above))
    return;
  result.crowns = find_canopy_crowns(result.canopy, config.crowns);
  const std::vector<char> with_stem = crowns_with_stems(result);
  for (std::size_t i = 0; i < with_stem.size(); ++i) {
    result.crown_ids.push_back(0);
    const CanopyCrown& crown = result.crowns->crowns[i];
    if (with_stem[i] != 0 || crown.cut) continue;
    Tree tree;
    tree.id = static_cast<int>(result.trees.size()) + 1;
    tree.x = crown.top.x();
    tree.y = crown.top.y();
    tree.z = result.ground.terrain.interpolate(tree.x, tree.y);
    tree.height_m = crown.height_m;
    tree.crown_area_m2 = crown.area_m2;
    result.crown_ids.back() = tree.id;
    result.trees.push_back(tree);
  }
}

}  // namespace

StemDetectorConfig search_of(StemDetectorConfig config, InventoryExtent extent) {
  if (config.min_dbh_m == 0.0) {
    config.min_dbh_m = kThinnestBasic;
    if (extent == InventoryExtent::kFull) config.thin_dbh_m = kThinnest;
  }
  config.min_dbh_m = std::max(config.min_dbh_m, kThinnest);
  return config;
}

void describe(ConfigTable& table, InventoryConfig& config) {
  table.add_enum(
      "extent", config.extent,
      {{"basic", InventoryExtent::kBasic}, {"full", InventoryExtent::kFull}},
      "basic: ground, stems, diameters, heights; full: stem curves, volumes, crowns and the "
      "tree of each point as well");
  table.section("curves", [&] {
    std::vector<std::pair<std::string, TaperSpecies>> names;
    for (const TaperSpecies species :
         {TaperSpecies::kUnknown, TaperSpecies::kPine, TaperSpecies::kSpruce, TaperSpecies::kBirch})
      names.emplace_back(taper_species_name(species), species);
    table.add_enum("species", config.curves.species, names,
                   "species of the stand: its taper curve stands where a stem was not seen");
  });
  table.section("beam", [&] { describe(table, config.beam); });
  table.section("crowns", [&] { describe(table, config.crowns); });
  table.section("dead_wood", [&] { describe(table, config.dead_wood); });
  table.section("ground", [&] { describe(table, config.ground); });
  table.section("stems", [&] { describe(table, config.stems); });
  table.section("stand", [&] { describe(table, config.stand); });
  table.add("canopy_cell_m", config.canopy_cell_m, {0.1, 10.0}, "m", "cell of the canopy model");
  table.add("segments", config.segments, {0, 50}, "",
            "number of trees that the report shows one by one");
}

namespace {

// Whether the cloud shows its stems twice: their diameters are less sure then, and the list is not
// to be trusted.
DoubleImages judge_images(InventoryResult& result) {
  DoubleImages images = find_double_images(result.stems);
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    const double too_thick = kThickPerApart * images.oval_m[i];
    result.stems[i].covariance(2, 2) += too_thick * too_thick;
  }
  result.two_images = complaint_of(images);
  return images;
}

// The words for each tree that are no measurement.
void describe_trees(const InventoryConfig& config, const DoubleImages& images,
                    InventoryResult& result) {
  const TaperSpecies species = config.curves.species != TaperSpecies::kUnknown
                                   ? config.curves.species
                                   : config.stand.species;
  for (std::size_t i = 0; i < result.trees.size(); ++i) {
    Tree& tree = result.trees[i];
    if (species != TaperSpecies::kUnknown) tree.species = taper_species_name(species);
    const bool stem = i < result.stems.size();
    tree.quality = stem ? quality_of(tree, result.stems[i].arc_deg, result.stems[i].lowest_m)
                        : quality_of(tree, Tree::kUnknown);
    if (stem && images.twice[i] != 0) tree.quality = "twice";
  }
}

// What is known of the scanner beside its points.
struct KnownScanner {
  const Lookouts& lookouts;
  const std::vector<Eigen::Vector3d>& places;
};

// Tops, heights, curves and crowns of the stems that were found, and the canopy.
void measure_above(const TiledCloud& cloud, const InventoryConfig& config,
                   const ProgressSink& progress, const KnownScanner& scanner,
                   const StemHarvest& gathered, InventoryResult& result) {
  const auto tell = [&](const char* stage, double done) {
    progress({stage, done, 8.0, "steps", ""});
  };
  const bool full = config.extent == InventoryExtent::kFull;
  const SlicesNear slices(result.slices, gathered.thinned, cloud, result.origin);
  const CrownTask task{cloud,
                       result.ground,
                       result.origin,
                       result.stems,
                       slices,
                       gathered.ceiling,
                       config.stems.highest_m,
                       scanner.lookouts || !gathered.low.end_in_a_cut(),
                       full,
                       static_cast<bool>(scanner.lookouts),
                       config.curves,
                       progress};
  tell("tops", 4.0);
  const auto listed = [&](std::size_t i, double top) {
    return listed_height(result, result.stems[i], top, scanner.lookouts);
  };
  StemTops tops = look_up(task, config.canopy_cell_m, listed);
  result.canopy = tops.canopy.raster(result.origin.x(), result.origin.y());
  result.area_m2 = area_of(result.canopy);
  judge_density(gathered, scanner.places, result);
  result.seen = seen_of(gathered.seen, scanner.places, config.stand.reach_m, result);
  const DoubleImages images = judge_images(result);
  std::vector<double> heights;
  for (std::size_t i = 0; i < result.stems.size(); ++i)
    heights.push_back(listed(i, tops.top_m[i]));
  result.trees = trees_of(result, heights);
  judge_tops(tops, scanner.lookouts, scanner.places, result);
  if (full) {
    result.curves = std::move(tops.curves);
    add_stem_forms(result);
    tell("crowns", 6.0);
    find_crowns(task, tops.cubes, result);
    add_crowns(config, result);
    result.dead_wood = find_dead_wood(
        {cloud, result.ground.terrain, result.origin, result.stems, config.dead_wood, progress},
        tops.low);
  }
  describe_trees(config, images, result);
  look_at_doubtful_trees(std::move(tops.sheets), result);
}

}  // namespace

InventoryResult take_inventory(const PointBlocks& cloud, const InventoryConfig& config,
                               const ProgressSink& progress, const Lookouts& lookouts,
                               const std::vector<Eigen::Vector3d>& scanner) {
  return take_inventory(WholeCloud(cloud), config, progress, lookouts, scanner);
}

InventoryResult take_inventory(const TiledCloud& cloud, const InventoryConfig& config,
                               const ProgressSink& progress, const Lookouts& lookouts,
                               const std::vector<Eigen::Vector3d>& scanner) {
  const PointBlocks unasked = [&](const PointVisitor& visit) { cloud.all(visit); };
  const auto tell = [&](const char* stage, double done) {
    progress({stage, done, 8.0, "steps", ""});
  };
  InventoryResult result;
  tell("ground", 0.0);
  result.ground = estimate_ground(unasked, config.ground, progress, cloud.level());
  if (result.ground.terrain.empty()) {
    result.remarks.emplace_back("The cloud holds no points.");
    return result;
  }
  const Raster& terrain = result.ground.terrain;
  // A multiple of the grids' cells, so that a clip of a cloud has the same cells.
  result.origin = {kOriginStep * std::floor(terrain.x0 / kOriginStep),
                   kOriginStep * std::floor(terrain.y0 / kOriginStep), terrain.z0};
  tell("stems", 2.0);
  StemHarvest gathered = find_stems(cloud, result.ground, result.origin,
                                    search_of(config.stems, config.extent), progress);
  result.points = gathered.points;
  result.slices = std::move(gathered.slices);
  result.stems = std::move(gathered.stems);
  result.range_noise_m = gathered.range_noise_m;
  result.blur_m = gathered.blur_m;
  drop_low_ends(SlicesNear(result.slices, gathered.thinned, cloud, result.origin), config.stems,
                lookouts, result);
  take_section_radii(result);
  compensate_beams(config.beam, scanner, result);
  result.thin = gathered.coverage.thin();
  measure_above(cloud, config, progress, {lookouts, scanner}, gathered, result);
  result.remarks = remarks_on(gathered, config, result);
  tell("segments", 7.0);
  result.segments = collect_segments(polled(unasked, progress), result.ground, result.trees,
                                     config.segments, kSegmentReach);
  tell("segments", 8.0);
  return result;
}

std::uint32_t tree_at(const InventoryResult& inventory, const Eigen::Vector3d& point,
                      double height_m) {
  return inventory.owners ? tree_at(inventory, *inventory.owners, point, height_m) : 0;
}

std::uint32_t tree_at(const InventoryResult& inventory, const TreeOwners& owners,
                      const Eigen::Vector3d& point, double height_m) {
  if (!(height_m > inventory.ground.config.class_m)) return 0;
  const Eigen::Vector2d place = (point - inventory.origin).head<2>();
  const std::int32_t owner = owners.owner(place, height_m);
  if (owner != TreeOwners::kNobody)
    return static_cast<std::uint32_t>(inventory.trees[static_cast<std::size_t>(owner)].id);
  if (!inventory.crowns || height_m < forest_constants::tree_owners::kUndergrowth) return 0;
  const std::int32_t crown = inventory.crowns->at(point.head<2>());
  if (crown == CanopyCrowns::kNone) return 0;
  return static_cast<std::uint32_t>(inventory.crown_ids[static_cast<std::size_t>(crown)]);
}

std::vector<Stem> stems_of(const InventoryResult& inventory, const Eigen::Vector3d& origin) {
  std::vector<Stem> stems;
  for (std::size_t i = 0; i < inventory.stems.size(); ++i) {
    const StemFit& fit = inventory.stems[i];
    const Tree& tree = inventory.trees[i];
    Stem stem;
    stem.point = (Eigen::Vector3d(tree.x, tree.y, tree.z) - origin).cast<float>();
    stem.axis = Eigen::Vector3d(fit.slope.x(), fit.slope.y(), 1.0).normalized().cast<float>();
    stem.length_m = static_cast<float>(fit.highest_m - fit.lowest_m);
    stem.dbh_m = static_cast<float>(tree.dbh_m);
    stem.radius_m = static_cast<float>(fit.radius_m);
    stem.radius_sd_m = static_cast<float>(0.5 * tree.dbh_sd_m);
    stem.xx = static_cast<float>(fit.foot_covariance(0, 0));
    stem.xy = static_cast<float>(fit.foot_covariance(0, 1));
    stem.yy = static_cast<float>(fit.foot_covariance(1, 1));
    stems.push_back(stem);
  }
  return stems;
}

}  // namespace understory
