#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>
#include <cmath>
#include <optional>

#include "understory/geometry/matrix_inverse.h"
#include "understory/georeference/combined_place.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/pipeline/georeferencing/gnss_fixes.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/georeferencing/methods/terrain_placement.h"
#include "understory/pipeline/georeferencing/methods/tree_placement.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::georeferencing;

using Eigen::Vector3d;

// What was gathered about the place of a run, source by source.
struct GatheredPlace {
  Placement placement;
  std::vector<std::string> methods;
  std::vector<PlaceEvidence> evidence;
  std::optional<Pose> by_fixes;  // where the fixes alone lay the run, if they tell its height
};

// Fixes that are named count even where they cannot be read: that is said then.
bool has_fixes(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  if (!request.gnss.empty() || !run.fixes.empty()) return true;
  if (!std::filesystem::exists(request.run / "gnss.csv")) return false;
  try {
    return !read_fixes((request.run / "gnss.csv").string(), log).empty();
  } catch (const InputError&) {
    return false;  // a table without a position
  }
}

Vector3d middle_of_path(const MovableRun& run, const Pose& target_from_world) {
  Vector3d middle = Vector3d::Zero();
  for (const StampedPose& pose : run.trajectory)
    middle += pose.world_from_body.translation() / static_cast<double>(run.trajectory.size());
  return target_from_world * middle;
}

// Heights of fixes do not count beside a terrain model: it may count heights from elsewhere.
PlaceEvidence evidence_of_fixes(const Placement& placed, const Vector3d& middle, bool heights) {
  PlaceEvidence evidence{placed.target_from_world, middle, Matrix6d::Zero()};
  if (!placed.covariance.allFinite()) return evidence;
  const Matrix6d spread = spread_from_right(placed.covariance, placed.target_from_world, middle);
  if (heights)
    evidence.information = inverse_matrix(spread);
  else
    evidence.information.topLeftCorner<5, 5>() = spread.topLeftCorner<5, 5>().inverse();
  return evidence;
}

// Of the height at the middle of the path; NaN where the method does not tell it.
double height_sd_m(const Placement& placed, const Vector3d& middle) {
  return std::sqrt(spread_from_right(placed.covariance, placed.target_from_world, middle)(5, 5));
}

void gather_fixes(const GeoreferenceRequest& request, const MovableRun& run, Log& log,
                  GatheredPlace& gathered) {
  gathered.placement = place_by_best(request, run, log);
  gathered.methods.push_back(gathered.placement.method);
  const Vector3d middle = middle_of_path(run, gathered.placement.target_from_world);
  if (height_sd_m(gathered.placement, middle) < kHeightsDifferM)
    gathered.by_fixes = gathered.placement.target_from_world;
  gathered.evidence.push_back(
      evidence_of_fixes(gathered.placement, middle, request.terrain_model.empty()));
  if (gathered.evidence.back().information.isZero())
    gathered.evidence.push_back(evidence_of_gravity(gathered.placement.target_from_world, middle,
                                                    tilt_sd_deg(request, run)));
}

// Near the place by the fixes, as far off as they may err.
std::optional<RoughPlace> place_near_fixes(const GeoreferenceRequest& request,
                                           const MovableRun& run, const Placement& placed) {
  if (run.trees.empty() || !placed.origin) return std::nullopt;
  RoughPlace rough;
  rough.point_in_world = middle_of_trees(run);
  const Vector3d at(rough.point_in_world.x(), rough.point_in_world.y(), 0.0);
  rough.place = EastNorthUp(*placed.origin).to_place(placed.target_from_world * at);
  if (std::isfinite(placed.expected_error_m))
    rough.radius_m = std::min(request.near_radius_m,
                              kSearchedSigmas * placed.expected_error_m + kSearchedAtLeastM);
  return rough;
}

void gather_trees(const GeoreferenceRequest& request, const MovableRun& run, Log& log,
                  GatheredPlace& gathered) {
  const bool first = gathered.evidence.empty();
  GeoreferenceRequest search = request;
  std::optional<RoughPlace> rough;
  if (first) {
    rough = rough_place(request, run, log);
  } else {
    search.near.reset();
    rough = place_near_fixes(request, run, gathered.placement);
  }
  FoundTrees found = find_trees(search, run, rough, log);
  if (!first && !found.target.origin)
    throw InputError(request.tree_map.string(), "",
                     "expected a coordinate system, to compare it with the fixes: --tree-map-crs");
  if (!first && !found.match.trusted) {
    log.warn("georeference.trees_not_found",
             fmt::format("{}: the trees were not found in it, and the place is that of the fixes: "
                         "{}",
                         request.tree_map.string(), found.match.reason));
    return;
  }
  // The target's frame has its origin where the search was; fixes have theirs.
  Pose into = Pose();
  Placement& placement = gathered.placement;
  if (first)
    placement.origin = found.target.origin;
  else
    into = change_of_frame(*found.target.origin, *placement.origin);
  found.match.target_from_source = into * found.match.target_from_source;
  const bool heights = first || placement.gnss.empty();
  gathered.evidence.push_back(
      evidence_of_trees(run, found.match, heights && request.terrain_model.empty()));
  if (first) {
    placement.target_from_world = found.match.target_from_source;
    gathered.evidence.push_back(evidence_of_gravity(
        placement.target_from_world, gathered.evidence.back().middle, tilt_sd_deg(request, run)));
  } else {
    placement.doubts.clear();  // what the fixes did not tell, the trees do
    placement.summary += "\n";
  }
  gathered.methods.emplace_back("trees");
  tell_trees(request, found, placement);
}

// The place by all that was gathered so far, and whether its sources agree.
CombinedPlace combine(GatheredPlace& gathered) {
  const CombinedPlace combined = combine_places(gathered.evidence);
  Placement& placement = gathered.placement;
  placement.target_from_world = combined.target_from_world;
  placement.covariance =
      right_from_spread(combined.spread, combined.target_from_world, combined.middle);
  placement.expected_error_m = std::numeric_limits<double>::quiet_NaN();
  placement.figures["sources_disagreement"] = combined.disagreement;
  if (combined.disagreement > kMostDisagreement)
    placement.doubt(fmt::format(
        "the fixes and the trees contradict each other: they lie {:.0f} standard deviations apart. "
        "Is the tree map of this forest, and in the coordinate system that it states?",
        std::sqrt(combined.disagreement)));
  return combined;
}

// The heights are those of the terrain model. Whoever knows the fixes' heights should know by how
// much they differ.
void compare_heights(const GeoreferenceRequest& request, const Vector3d& middle,
                     const Pose& by_fixes, Log& log, Placement& placement) {
  const Vector3d in_world = placement.target_from_world.inverse() * middle;
  const double above_m = middle.z() - (by_fixes * in_world).z();
  placement.figures["terrain_above_fixes_m"] = above_m;
  if (std::abs(above_m) < kHeightsDifferM) return;
  const std::string differ = fmt::format("{}: its heights are {:.1f} m {} those of the fixes",
                                         request.terrain_model.string(), std::abs(above_m),
                                         above_m < 0.0 ? "below" : "above");
  if (std::abs(above_m) > kMostGeoidM) {
    placement.doubt(differ +
                    ". No height system explains that: is it of this place, and in metres?");
    return;
  }
  log.warn("georeference.heights_differ",
           differ +
               ". The map has the heights of the model. They often count from the geoid, and "
               "those of fixes from the ellipsoid");
}

void lay_on_terrain(const GeoreferenceRequest& request, const MovableRun& run,
                    const CombinedPlace& combined, Log& log, GatheredPlace& gathered) {
  Placement& placement = gathered.placement;
  TerrainFitConfig config = request.terrain;
  Matrix6d information = inverse_matrix(combined.spread);
  config.known = PlaceEvidence{Pose(), combined.middle, information};
  const LevelledRun levelled =
      level_run(request, run, combined.target_from_world, placement.origin, config);
  placement.target_from_world = levelled.target_from_world;
  placement.covariance =
      right_from_spread(levelled.fit.spread, levelled.target_from_world, levelled.fit.middle);
  placement.summary += "\n";
  gathered.methods.emplace_back("terrain");
  tell_levelled(request, levelled, placement);
  if (gathered.by_fixes)
    compare_heights(request, levelled.fit.middle, *gathered.by_fixes, log, placement);
}

}  // namespace

Placement place_by_all(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  GatheredPlace gathered;
  if (has_fixes(request, run, log)) gather_fixes(request, run, log, gathered);
  if (!request.tree_map.empty()) gather_trees(request, run, log, gathered);
  if (gathered.evidence.empty())
    throw InputError(request.run.string(), "",
                     "expected fixes or --tree-map beside --dem: where the run lies on the terrain "
                     "model is not known");
  const CombinedPlace combined = combine(gathered);
  if (!request.terrain_model.empty()) lay_on_terrain(request, run, combined, log, gathered);
  gathered.placement.method = fmt::format("{}", fmt::join(gathered.methods, "+"));
  return gathered.placement;
}

}  // namespace understory
