#include "understory/pipeline/georeferencing/methods/tree_placement.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/georeference/trees/tree_match.h"
#include "understory/pipeline/georeferencing/gnss_fixes.h"
#include "understory/pipeline/georeferencing/methods/run_tops.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using georeference_constants::tree_match::kFewestTrees;

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Where the run is looked for: near a place that was given, near its fixes, else everywhere.
TreeSearchArea area_of(const GeoreferenceRequest& request, const MovableRun& run,
                       const TreeTarget& target, const std::optional<RoughPlace>& rough) {
  TreeSearchArea area;
  area.radius_m = request.near_radius_m;
  area.source_point = middle_of_trees(run);
  if (target.near) {
    area.target_point = *target.near;
  } else if (rough && target.origin) {
    area.source_point = rough->point_in_world;
    area.target_point = EastNorthUp(*target.origin).from_place(rough->place).head<2>();
    area.radius_m = rough->radius_m.value_or(area.radius_m);
  } else {
    area.target_point = 0.5 * (target.low + target.high);
    area.radius_m = 0.5 * (target.high - target.low).norm();
    if (area.radius_m > TreeTargetConfig().widest_search_m)
      throw InputError(
          request.tree_map.string(), "",
          fmt::format("expected --near X Y: the map is {:.1f} km wide, and without a rough "
                      "position at most {:.1f} km are searched",
                      2e-3 * area.radius_m, 2e-3 * TreeTargetConfig().widest_search_m));
  }
  const Vector2d nearest = area.target_point.cwiseMax(target.low).cwiseMin(target.high);
  const double away = (nearest - area.target_point).norm();
  if (away > area.radius_m)
    throw InputError(
        request.tree_map.string(), "",
        fmt::format("expected a map of trees of the place: its nearest tree is {:.1f} km from the "
                    "rough position. Check --near and the coordinate systems",
                    1e-3 * away));
  return area;
}

double degrees(double radians) {
  return radians * 180.0 / std::numbers::pi;
}

std::map<std::string, Figure> figures_of(const TreeMatch& match, const TreeTarget& target) {
  std::map<std::string, Figure> figures{
      {"trees_of_map", static_cast<std::int64_t>(target.trees.size())},
      {"trees_searched", static_cast<std::int64_t>(match.searched_trees)},
      {"trees_paired", static_cast<std::int64_t>(match.pairs.size())},
      {"trees_paired_by_chance", match.expected_by_chance},
      {"trees_apart_rms_m", match.apart_rms_m},
      {"trees_noise_m", match.noise_m},
      {"trees_chance", match.chance},
      {"trees_score", match.score},
      {"trees_rival_score", match.rival_score},
      {"trees_yaw_deg", degrees(yaw_of(match.target_from_source))},
      {"trees_yaw_sd_deg", degrees(std::sqrt(match.covariance(0, 0)))},
      {"trees_place_sd_m", std::sqrt(match.covariance(1, 1) + match.covariance(2, 2))}};
  if (std::isfinite(match.height_sd_m)) figures["trees_height_sd_m"] = match.height_sd_m;
  return figures;
}

// Stems and tops are two views of one stand: the one that chance explains less counts.
bool likelier(const TreeMatch& one, const TreeMatch& other) {
  if (one.found != other.found) return one.found;
  if (one.trusted != other.trusted) return one.trusted;
  return one.found && one.score > other.score;
}

std::string summary_of(const FoundTrees& found) {
  const TreeMatch& match = found.match;
  std::string text = fmt::format(
      "{} of {} {} have a partner in the map, by chance {:.0f} would; pairs {:.2f} m apart (root "
      "mean square)\nplace to {:.2f} m, heading to {:.2f} degrees (one standard deviation)",
      match.pairs.size(), found.trees_of_run, found.by_tops ? "tops of the canopy" : "trees",
      match.expected_by_chance, match.apart_rms_m,
      std::sqrt(match.covariance(1, 1) + match.covariance(2, 2)),
      degrees(std::sqrt(match.covariance(0, 0))));
  text += std::isfinite(match.height_sd_m) ? fmt::format("; height to {:.2f} m by {} feet",
                                                         match.height_sd_m, match.heights_compared)
                                           : "; heights stay, since the map has no ground";
  return text;
}

}  // namespace

std::optional<RoughPlace> rough_place(const GeoreferenceRequest& request, const MovableRun& run,
                                      Log& log) {
  if (run.origin)
    return RoughPlace{run.enu_from_world.inverse().translation().head<2>(), *run.origin, {}};
  const fs::path file = request.run / "gnss.csv";
  if (!fs::exists(file)) return std::nullopt;
  std::vector<double> latitudes;
  std::vector<double> longitudes;
  for (const GnssFix& fix : read_fixes(file.string(), log)) {
    latitudes.push_back(fix.latitude_deg);
    longitudes.push_back(fix.longitude_deg);
  }
  std::vector<double> x;
  std::vector<double> y;
  for (const StampedPose& pose : run.trajectory) {
    x.push_back(pose.world_from_body.translation().x());
    y.push_back(pose.world_from_body.translation().y());
  }
  return RoughPlace{{upper_median(x), upper_median(y)},
                    {upper_median(latitudes), upper_median(longitudes), 0.0},
                    {}};
}

Vector2d middle_of_trees(const MovableRun& run) {
  std::vector<double> x;
  std::vector<double> y;
  for (const Tree& tree : run.trees) {
    x.push_back(tree.x);
    y.push_back(tree.y);
  }
  return {upper_median(x), upper_median(y)};
}

FoundTrees find_trees(const GeoreferenceRequest& request, const MovableRun& run,
                      const std::optional<RoughPlace>& rough, Log& log) {
  if (!run.has_trees || run.trees.empty())
    throw InputError(request.run.string(), "", "expected trees.csv with trees to look for");
  if (run.trees.size() < kFewestTrees)
    throw InputError(
        (request.run / "trees.csv").string(), "",
        fmt::format("expected {} trees at least, found {}", kFewestTrees, run.trees.size()));
  std::optional<GeodeticPlace> place;
  if (rough) place = rough->place;
  FoundTrees found;
  found.target = read_tree_target(request.tree_map, request.tree_map_system, request.near, place,
                                  {}, log, request.progress);
  const TreeSearchArea area = area_of(request, run, found.target, rough);
  const std::vector<Tree> tops = tops_of_run(request.run, run);
  const bool both = tops.size() >= kFewestTrees;
  TreeMatchConfig config = request.trees;
  if (both) config.most_chance /= 2.0;  // two searches, one of which chance may favour
  std::vector<Tree> stems = run.trees;
  if (found.target.from_cloud) {
    std::vector<Tree> seen = without_overtopped(run.trees);
    if (seen.size() >= kFewestTrees) stems = std::move(seen);
  }
  found.match = match_tree_maps(stems, found.target.trees, area, config, request.progress);
  found.trees_of_run = stems.size();
  if (both) {
    const TreeMatch match =
        match_tree_maps(tops, found.target.trees, area, config, request.progress);
    if (likelier(match, found.match)) {
      found.match = match;
      found.trees_of_run = tops.size();
      found.by_tops = true;
    }
  }
  if (!found.match.found) throw InputError(request.tree_map.string(), "", found.match.reason);
  return found;
}

void tell_trees(const GeoreferenceRequest& request, const FoundTrees& found, Placement& placement) {
  placement.figures.merge(figures_of(found.match, found.target));
  placement.figures["trees_by"] = std::string(found.by_tops ? "tops" : "stems");
  placement.summary += summary_of(found);
  if (!found.match.trusted)
    placement.doubt("the trees were not found in " + request.tree_map.filename().string() + ": " +
                    found.match.reason +
                    ". It may be of another forest, or --near or the coordinate system is wrong");
  placement.inputs.push_back(hash_input(request.tree_map, request.progress));
}

PlaceEvidence evidence_of_trees(const MovableRun& run, const TreeMatch& match, bool heights) {
  double ground = 0.0;
  for (const Tree& tree : run.trees)
    ground += tree.z / static_cast<double>(run.trees.size());
  const Eigen::Vector2d& centre = match.centre_in_source;
  PlaceEvidence evidence{match.target_from_source,
                         match.target_from_source * Vector3d(centre.x(), centre.y(), ground),
                         Matrix6d::Zero()};
  evidence.information.block<3, 3>(2, 2) = match.covariance.inverse();
  if (heights && std::isfinite(match.height_sd_m))
    evidence.information(5, 5) = 1.0 / (match.height_sd_m * match.height_sd_m);
  return evidence;
}

PlaceEvidence evidence_of_gravity(const Pose& target_from_world, const Vector3d& middle,
                                  double tilt_sd_deg) {
  PlaceEvidence evidence{target_from_world, middle, Matrix6d::Zero()};
  const double sd = tilt_sd_deg * std::numbers::pi / 180.0;
  evidence.information(0, 0) = evidence.information(1, 1) = 1.0 / (sd * sd);
  return evidence;
}

}  // namespace understory
