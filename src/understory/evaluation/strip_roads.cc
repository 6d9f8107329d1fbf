#include "understory/evaluation/strip_roads.h"

#include <algorithm>
#include <cmath>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/evaluation/trees/tree_rates.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using Eigen::Vector2d;

std::vector<Vector2d> positions(const std::vector<Pose>& world_from_body) {
  std::vector<Vector2d> result;
  for (const Pose& pose : world_from_body)
    result.emplace_back(pose.translation().head<2>());
  return result;
}

// Direction of the way around each view, over `smoothed_m` of it; zero where it stands still.
std::vector<Vector2d> headings(const std::vector<Vector2d>& at, double smoothed_m) {
  std::vector<double> way(at.size(), 0.0);
  for (std::size_t i = 1; i < at.size(); ++i)
    way[i] = way[i - 1] + (at[i] - at[i - 1]).norm();
  std::vector<Vector2d> result;
  std::size_t behind = 0;
  std::size_t ahead = 0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    while (way[i] - way[behind] > 0.5 * smoothed_m)
      ++behind;
    while (ahead + 1 < at.size() && way[ahead] - way[i] < 0.5 * smoothed_m)
      ++ahead;
    const Vector2d d = at[ahead] - at[behind];
    result.push_back(d.norm() > 0.0 ? Vector2d(d.normalized()) : Vector2d::Zero());
  }
  return result;
}

// A road as a straight line.
struct Line {
  Vector2d middle;
  Vector2d along;
  double half_length;
};

Line line_of(const std::vector<Vector2d>& at, const StripRoad& road) {
  const Vector2d d = at[road.last] - at[road.first];
  Vector2d sum = Vector2d::Zero();
  for (std::size_t i = road.first; i <= road.last; ++i)
    sum += at[i];
  const Vector2d along = d.normalized();
  const Vector2d mean = sum / static_cast<double>(road.last - road.first + 1);
  // The mean across, the middle of the ends along: views need not lie evenly.
  const Vector2d ends = 0.5 * (at[road.first] + at[road.last]);
  const Vector2d across(-along.y(), along.x());
  return {ends + across * across.dot(mean - ends), along, 0.5 * d.norm()};
}

std::vector<Tree> trees_of_road(const std::vector<StemView>& views,
                                const std::vector<Pose>& world_from_body, const StripRoad& road,
                                const StemMapConfig& config) {
  const auto begin = static_cast<std::ptrdiff_t>(road.first);
  const auto end = static_cast<std::ptrdiff_t>(road.last) + 1;
  const std::vector<MappedStem> stems =
      build_stem_map({views.begin() + begin, views.begin() + end},
                     {world_from_body.begin() + begin, world_from_body.begin() + end}, config);
  std::vector<Tree> trees;
  for (const MappedStem& stem : stems) {
    Tree tree;
    tree.x = stem.point_in_world.x();
    tree.y = stem.point_in_world.y();
    tree.z = stem.point_in_world.z();
    trees.push_back(tree);
  }
  return trees;
}

// A stretch of the ground between two roads.
struct Region {
  Vector2d middle;
  Vector2d along;
  double begin_m;
  double end_m;
  double within_m;

  [[nodiscard]] double place(const Tree& tree) const {
    return along.dot(Vector2d(tree.x, tree.y) - middle);
  }
  [[nodiscard]] bool holds(const Tree& tree) const {
    const Vector2d d = Vector2d(tree.x, tree.y) - middle;
    const double t = along.dot(d);
    return t >= begin_m && t < end_m && (d - t * along).norm() <= within_m;
  }
  [[nodiscard]] std::vector<Tree> inside(const std::vector<Tree>& trees) const {
    std::vector<Tree> result;
    for (const Tree& tree : trees) {
      if (holds(tree)) result.push_back(tree);
    }
    return result;
  }
};

RoadConsistency compare(const std::vector<Tree>& a, const std::vector<Tree>& b,
                        const Region& region, const StripRoadConfig& config) {
  const std::vector<Tree> here = region.inside(a);
  const std::vector<Tree> there = region.inside(b);
  RoadConsistency result;
  result.trees = here.size();
  result.trees_other = there.size();
  const std::vector<TreePair> pairs = match_trees(here, there, config.pairing_m);
  double squares = 0.0;
  for (const auto& [i, j] : pairs)
    squares += std::pow(here[i].x - there[j].x, 2) + std::pow(here[i].y - there[j].y, 2);
  result.match_rms_m = std::sqrt(squares / static_cast<double>(pairs.size()));
  result.as_placed = consistency(pairs.size(), here.size(), there.size());
  result.moved =
      consistency(matches_after_motion(here, there, config.pairing_m), here.size(), there.size());
  std::size_t matches = 0;
  const double length = region.end_m - region.begin_m;
  const int parts = std::max(1, static_cast<int>(std::lround(length / config.part_m)));
  for (int part = 0; part < parts; ++part) {
    Region slice = region;
    slice.begin_m = region.begin_m + length * part / parts;
    slice.end_m = region.begin_m + length * (part + 1) / parts;
    matches += matches_after_motion(slice.inside(a), slice.inside(b), config.pairing_m);
  }
  result.in_parts = consistency(matches, here.size(), there.size());
  return result;
}

}  // namespace

std::vector<StripRoad> find_strip_roads(const std::vector<Pose>& world_from_body,
                                        const StripRoadConfig& config) {
  const std::vector<Vector2d> at = positions(world_from_body);
  const std::vector<Vector2d> heading = headings(at, config.smoothed_m);
  const double least = std::cos(config.straight_deg * M_PI / 180.0);
  std::vector<StripRoad> roads;
  std::size_t first = 0;
  Vector2d sum = Vector2d::Zero();
  for (std::size_t i = 0; i <= at.size(); ++i) {
    const bool goes_on = i < at.size() && (sum.norm() == 0.0 || heading[i].norm() == 0.0 ||
                                           heading[i].dot(sum.normalized()) >= least);
    if (goes_on) {
      sum += heading[i];
      continue;
    }
    if (i > first && (at[i - 1] - at[first]).norm() >= config.min_length_m)
      roads.push_back({first, i - 1});
    first = i;
    sum = i < at.size() ? heading[i] : Vector2d::Zero();
  }
  return roads;
}

std::vector<RoadConsistency> road_consistencies(const std::vector<StemView>& views,
                                                const std::vector<Pose>& world_from_body,
                                                const StripRoadConfig& config) {
  UNDERSTORY_CHECK(views.size() == world_from_body.size());
  const std::vector<StripRoad> roads = find_strip_roads(world_from_body, config);
  const std::vector<Vector2d> at = positions(world_from_body);
  std::vector<std::vector<Tree>> trees;
  for (const StripRoad& road : roads)
    trees.push_back(trees_of_road(views, world_from_body, road, config.map));
  std::vector<RoadConsistency> result;
  for (std::size_t a = 0; a < roads.size(); ++a) {
    for (std::size_t b = a + 1; b < roads.size(); ++b) {
      const Line p = line_of(at, roads[a]);
      const Line q = line_of(at, roads[b]);
      if (std::abs(p.along.dot(q.along)) < std::cos(config.straight_deg * M_PI / 180.0)) continue;
      const Vector2d apart = q.middle - p.middle;
      const double t = p.along.dot(apart);
      if ((apart - t * p.along).norm() > config.farthest_m) continue;
      const Vector2d middle = p.middle + 0.5 * (apart - t * p.along);
      const Region region{middle, p.along, std::max(-p.half_length, t - q.half_length),
                          std::min(p.half_length, t + q.half_length), config.within_m};
      if (region.end_m - region.begin_m < config.min_length_m) continue;
      RoadConsistency compared = compare(trees[a], trees[b], region, config);
      compared.road = a + 1;
      compared.other = b + 1;
      result.push_back(compared);
    }
  }
  return result;
}

}  // namespace understory
