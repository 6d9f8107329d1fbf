#include "understory/map/felled_trees.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/graph/loops/view_cone.h"
#include "understory/map/map_constants.h"
#include "understory/map/upright_views.h"

namespace understory {
namespace {

using namespace map_constants::felled_trees;

// What one view says of one tree.
struct Sight {
  int view;
  bool seen;
  bool tells;  // near, in the sector and nothing before it
};

// Whether a stem of the view stands before the place, near the line of sight. Level enough: seen
// from above in the frame of an upright view.
bool hidden(const SparsePoints& stems, const Eigen::Vector3d& place, double clearance_m) {
  const Eigen::Vector2d line = place.head<2>();
  const double distance = line.norm();
  const Eigen::Vector2d along = line / distance;
  for (const Eigen::Vector3d& stem : stems) {
    const double before = along.dot(stem.head<2>());
    if (before <= 0.0 || before > distance - 0.5) continue;
    if ((stem.head<2>() - before * along).norm() < clearance_m) return true;
  }
  return false;
}

// Places in the plane from which a tree was seen within reach.
std::vector<Eigen::Vector2d> seen_from(const std::vector<Sight>& sights,
                                       const std::vector<Pose>& world_from_body) {
  std::vector<Eigen::Vector2d> places;
  for (const Sight& sight : sights) {
    if (sight.seen && sight.tells)
      places.emplace_back(
          world_from_body[static_cast<std::size_t>(sight.view)].translation().head<2>());
  }
  return places;
}

// Misses from places that never showed the tree tell nothing, if the configuration says so.
std::vector<Sight> telling(std::vector<Sight> sights, const std::vector<Pose>& world_from_body,
                           const FelledConfig& config) {
  if (config.same_place_m <= 0.0) return sights;
  const std::vector<Eigen::Vector2d> places = seen_from(sights, world_from_body);
  const double near = config.same_place_m * config.same_place_m;
  for (Sight& sight : sights) {
    const Eigen::Vector2d at =
        world_from_body[static_cast<std::size_t>(sight.view)].translation().head<2>();
    sight.tells = sight.tells && std::any_of(places.begin(), places.end(), [&](const auto& place) {
                    return (place - at).squaredNorm() <= near;
                  });
  }
  return sights;
}

std::optional<FelledTree> judged(std::size_t tree, const std::vector<Sight>& sights,
                                 const FelledConfig& config) {
  FelledTree felled;
  felled.tree = tree;
  felled.last_seen = -1;
  for (const Sight& sight : sights) {
    if (sight.seen) felled.last_seen = sight.view;
  }
  int seen = 0;
  int missed_before = 0;
  for (const Sight& sight : sights) {
    if (!sight.tells) continue;
    if (sight.view <= felled.last_seen) {
      ++(sight.seen ? seen : missed_before);
    } else if (felled.missed++ == 0) {
      felled.first_missed = sight.view;
    }
  }
  if (seen < config.min_seen || felled.missed < config.min_missed) return std::nullopt;
  const double miss = (missed_before + 1.0) / (seen + missed_before + 2.0);
  if (std::pow(miss, felled.missed) > config.chance) return std::nullopt;
  return felled;
}

}  // namespace

FelledConfig FelledConfig::unattended() {
  FelledConfig config;
  config.same_place_m = kSamePlaceM;
  return config;
}

std::vector<FelledTree> felled_trees(const std::vector<StemView>& views,
                                     const std::vector<Pose>& world_from_body,
                                     const std::vector<MappedStem>& trees,
                                     const FelledConfig& config) {
  const auto [points, world_from_view] = upright_views(views, world_from_body);
  SparsePoints places;
  for (const MappedStem& tree : trees)
    places.push_back(tree.point_in_world);
  const ConeOverlap sector(estimate_view_cone(points));
  const PlaneGrid grid(places);
  std::vector<std::vector<Sight>> sights(trees.size());
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::vector<char> seen(trees.size(), 0);
    for (const Eigen::Vector3d& point : points[v]) {
      const auto found = grid.nearest(world_from_view[v] * point, kSameTreeM, 0.0);
      if (found.index >= 0) seen[static_cast<std::size_t>(found.index)] = 1;
    }
    const Pose view_from_world = world_from_view[v].inverse();
    for (std::size_t t = 0; t < trees.size(); ++t) {
      const Eigen::Vector3d place = view_from_world * places[t];
      const double distance = place.head<2>().norm();
      const bool tells = distance > config.nearest_m && distance < config.reach_m &&
                         sector.holds(place) && !hidden(points[v], place, config.clearance_m);
      if (tells || seen[t] != 0) sights[t].push_back({static_cast<int>(v), seen[t] != 0, tells});
    }
  }
  std::vector<FelledTree> result;
  for (std::size_t t = 0; t < trees.size(); ++t) {
    const auto felled = judged(t, telling(std::move(sights[t]), world_from_body, config), config);
    if (felled) result.push_back(*felled);
  }
  return result;
}

}  // namespace understory
