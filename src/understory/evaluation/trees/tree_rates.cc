#include "understory/evaluation/trees/tree_rates.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/evaluation/alignment.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/symmetric_eigen.h"

namespace understory {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

PlaneGrid grid_of(const Trajectory& path) {
  SparsePoints points;
  for (const StampedPose& pose : path) {
    const Vector3d& at = pose.world_from_body.translation();
    // Who stands still is at one place.
    if (points.empty() || (at - points.back()).norm() > 0.1) points.push_back(at);
  }
  return PlaneGrid(points);
}

// Distance in the plane from the path; infinite beyond the reach.
double distance_m(const Tree& tree, const PlaneGrid& path, double reach_m) {
  const auto found = path.nearest({tree.x, tree.y, 0.0}, reach_m, 0.0);
  return found.index < 0 ? std::numeric_limits<double>::infinity() : std::sqrt(found.squared_m2);
}

// The ring around the path that each tree stands in; -1 beyond the reach.
std::vector<int> rings_of(const std::vector<Tree>& trees, const Trajectory& path, double bin_m,
                          double reach_m) {
  const PlaneGrid grid = grid_of(path);
  const int rings = static_cast<int>(std::ceil(reach_m / bin_m - 1e-9));
  std::vector<int> result;
  for (const Tree& tree : trees) {
    const double d = distance_m(tree, grid, reach_m);
    // Just below the reach a quotient may round up to the number of rings.
    result.push_back(d < reach_m ? std::min(rings - 1, static_cast<int>(d / bin_m)) : -1);
  }
  return result;
}

double share(std::size_t part, std::size_t whole) {
  return static_cast<double>(part) / static_cast<double>(whole);
}

// The direction in which a path reaches farthest.
Vector2d main_direction(const Trajectory& path) {
  Vector2d mean = Vector2d::Zero();
  for (const StampedPose& pose : path)
    mean += pose.world_from_body.translation().head<2>() / static_cast<double>(path.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const StampedPose& pose : path) {
    const Vector2d d = pose.world_from_body.translation().head<2>() - mean;
    scatter += d * d.transpose();
  }
  return symmetric_eigen(scatter).vectors.col(1);
}

}  // namespace

double consistency(std::size_t matches, std::size_t trees_a, std::size_t trees_b) {
  return static_cast<double>(matches) / (0.5 * static_cast<double>(trees_a + trees_b));
}

std::size_t matches_after_motion(std::vector<Tree> a, const std::vector<Tree>& b,
                                 double pairing_m) {
  for (const double factor : {4.0, 2.0, 1.0, 1.0}) {
    const std::vector<TreePair> pairs = match_trees(a, b, factor * pairing_m);
    if (pairs.size() < 3) break;
    std::vector<Vector3d> source;
    std::vector<Vector3d> target;
    for (const auto& [i, j] : pairs) {
      source.emplace_back(a[i].x, a[i].y, 0.0);
      target.emplace_back(b[j].x, b[j].y, 0.0);
    }
    a = moved(a, align_points_yaw(source, target).target_from_source);
  }
  return match_trees(a, b, pairing_m).size();
}

std::vector<DistanceRate> rates_over_distance(const std::vector<Tree>& a,
                                              const std::vector<Tree>& b,
                                              const std::vector<TreePair>& pairs,
                                              const Trajectory& path, double bin_m,
                                              double reach_m) {
  std::vector<char> matched_a(a.size(), 0);
  std::vector<char> matched_b(b.size(), 0);
  std::vector<char> felled(a.size(), 0);
  for (const auto& [i, j] : pairs) {
    matched_a[i] = matched_b[j] = 1;
    felled[i] = b[j].felled ? 1 : 0;
  }
  std::vector<DistanceRate> rates(static_cast<std::size_t>(std::ceil(reach_m / bin_m - 1e-9)));
  for (std::size_t k = 0; k < rates.size(); ++k) {
    rates[k].from_m = static_cast<double>(k) * bin_m;
    rates[k].to_m = std::min(reach_m, rates[k].from_m + bin_m);
  }
  const std::vector<int> rings_a = rings_of(a, path, bin_m, reach_m);
  const std::vector<int> rings_b = rings_of(b, path, bin_m, reach_m);
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (b[j].felled || rings_b[j] < 0) continue;
    DistanceRate& rate = rates[static_cast<std::size_t>(rings_b[j])];
    ++rate.expected;
    rate.found += matched_b[j] != 0 ? 1 : 0;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (felled[i] != 0 || rings_a[i] < 0) continue;
    DistanceRate& rate = rates[static_cast<std::size_t>(rings_a[i])];
    ++rate.reported;
    rate.right += matched_a[i] != 0 ? 1 : 0;
  }
  const std::vector<TreeErrors> errors =
      errors_by_group(a, b, pairs, rings_a, rings_b, rates.size());
  for (std::size_t k = 0; k < rates.size(); ++k) {
    rates[k].recall = share(rates[k].found, rates[k].expected);
    rates[k].precision = share(rates[k].right, rates[k].reported);
    rates[k].errors = errors[k];
  }
  return rates;
}

MapConsistency map_consistency(const std::vector<Tree>& a, const std::vector<Tree>& b,
                               const Trajectory& path_a, const Trajectory& path_b,
                               const MapConsistencyConfig& config) {
  const PlaneGrid grid_a = grid_of(path_a);
  const PlaneGrid grid_b = grid_of(path_b);
  const auto seen_by_both = [&](const std::vector<Tree>& trees) {
    std::vector<Tree> result;
    for (const Tree& tree : trees) {
      if (std::isfinite(distance_m(tree, grid_a, config.within_m)) &&
          std::isfinite(distance_m(tree, grid_b, config.within_m)))
        result.push_back(tree);
    }
    return result;
  };
  const std::vector<Tree> here = seen_by_both(a);
  const std::vector<Tree> there = seen_by_both(b);
  MapConsistency result;
  result.trees_a = here.size();
  result.trees_b = there.size();
  const auto of_all = [&](std::size_t matches) {
    return consistency(matches, here.size(), there.size());
  };
  result.as_placed = of_all(match_trees(here, there, config.pairing_m).size());
  result.moved = of_all(matches_after_motion(here, there, config.pairing_m));
  const Vector2d along = main_direction(path_a);
  const auto place = [&](const Tree& tree) { return along.dot(Vector2d(tree.x, tree.y)); };
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const auto* trees : {&here, &there}) {
    for (const Tree& tree : *trees) {
      low = std::min(low, place(tree));
      high = std::max(high, place(tree));
    }
  }
  if (here.empty() || there.empty()) return result;
  result.parts = static_cast<std::size_t>(std::max(1L, std::lround((high - low) / config.part_m)));
  const double length = (high - low) / static_cast<double>(result.parts);
  std::size_t matches = 0;
  for (std::size_t part = 0; part < result.parts; ++part) {
    const auto slice = [&](const std::vector<Tree>& trees) {
      std::vector<Tree> inside;
      for (const Tree& tree : trees) {
        const auto k = static_cast<std::size_t>(std::max(0.0, (place(tree) - low) / length));
        if (std::min(k, result.parts - 1) == part) inside.push_back(tree);
      }
      return inside;
    };
    matches += matches_after_motion(slice(here), slice(there), config.pairing_m);
  }
  result.in_parts = of_all(matches);
  return result;
}

}  // namespace understory
