#include "understory/map/stem_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <tuple>
#include <unordered_map>

#include "understory/geometry/plane/alpha_shape.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/graph/loops/view_cone.h"
#include "understory/map/map_constants.h"
#include "understory/map/upright_views.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace map_constants::stem_map;

// One stem of a view, in the world.
struct StemSight {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double dbh_m = 0.0;
  double dbh_own_m2 = 0.0;  // variance of the diameter, as the detector states it
  double range_m = 0.0;     // from the body, in the plane
  int view = 0;
};

// A tree while it is gathered (Welford's running moments).
struct Gathered {
  MappedStem stem;
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  Eigen::Vector3d axes = Eigen::Vector3d::Zero();
  std::vector<int> views;  // that saw it, ascending
};

// Both as one (Chan et al. 1983 for the moments).
void merge(Gathered& tree, const Gathered& other) {
  MappedStem& a = tree.stem;
  const MappedStem& b = other.stem;
  const double n = a.sights;
  const double m = b.sights;
  const Eigen::Vector3d d = b.point_in_world - a.point_in_world;
  a.point_in_world += d * m / (n + m);
  tree.squares += other.squares + d.head<2>().cwiseAbs2() * n * m / (n + m);
  tree.axes += other.axes;
  tree.stem.axis_sights += other.stem.axis_sights;
  if (b.dbh_sights > 0) {
    const double k = a.dbh_sights;
    const double l = b.dbh_sights;
    const double mean = k > 0.0 ? a.dbh_m : b.dbh_m;
    const double e = b.dbh_m - mean;
    a.dbh_m = mean + e * l / (k + l);
    a.dbh_squares_m2 += b.dbh_squares_m2 + e * e * k * l / (k + l);
    const auto mean_of_both = [&](double mine, double its) {
      return k > 0.0 ? mine + (its - mine) * l / (k + l) : its;
    };
    a.dbh_own_m2 = mean_of_both(a.dbh_own_m2, b.dbh_own_m2);
    a.dbh_range_m = mean_of_both(a.dbh_range_m, b.dbh_range_m);
    a.dbh_sights += b.dbh_sights;
  }
  a.sights += b.sights;
  a.first_view = std::min(a.first_view, b.first_view);
  a.last_view = std::max(a.last_view, b.last_view);
  std::vector<int> views;
  std::set_union(tree.views.begin(), tree.views.end(), other.views.begin(), other.views.end(),
                 std::back_inserter(views));
  tree.views = std::move(views);
}

// One more sight.
void update(Gathered& tree, const StemSight& sight) {
  MappedStem& stem = tree.stem;
  ++stem.sights;
  stem.last_view = sight.view;
  if (tree.views.empty() || tree.views.back() != sight.view) tree.views.push_back(sight.view);
  const Eigen::Vector3d d = sight.point - stem.point_in_world;
  stem.point_in_world += d / stem.sights;
  tree.squares += d.head<2>().cwiseProduct((sight.point - stem.point_in_world).head<2>());
  if (sight.axis.allFinite()) {
    tree.axes += sight.axis.z() < 0.0 ? Eigen::Vector3d(-sight.axis) : sight.axis;
    ++stem.axis_sights;
  }
  if (!std::isfinite(sight.dbh_m)) return;
  if (stem.dbh_sights == 0) stem.dbh_m = stem.dbh_own_m2 = stem.dbh_range_m = 0.0;
  ++stem.dbh_sights;
  const double e = sight.dbh_m - stem.dbh_m;
  stem.dbh_m += e / stem.dbh_sights;
  stem.dbh_squares_m2 += e * (sight.dbh_m - stem.dbh_m);
  stem.dbh_own_m2 += (sight.dbh_own_m2 - stem.dbh_own_m2) / stem.dbh_sights;
  stem.dbh_range_m += (sight.range_m - stem.dbh_range_m) / stem.dbh_sights;
}

class Gatherer {
 public:
  explicit Gatherer(double merge_m) : merge_m_(merge_m) {}

  void add(const StemSight& sight) {
    const int found = nearest(sight.point);
    if (found < 0) {
      cells_[key(sight.point.x(), sight.point.y(), 0, 0)].push_back(
          static_cast<int>(trees_.size()));
      trees_.emplace_back();
      trees_.back().stem.first_view = sight.view;
      update(trees_.back(), sight);
      return;
    }
    Gathered& tree = trees_[static_cast<std::size_t>(found)];
    const Eigen::Vector3d before = tree.stem.point_in_world;
    update(tree, sight);
    move(found, before, tree.stem.point_in_world);
  }

  [[nodiscard]] std::vector<Gathered> trees() && { return std::move(trees_); }

 private:
  [[nodiscard]] std::uint64_t key(double x, double y, int dx, int dy) const {
    const auto cell = [this](double v) {
      return static_cast<std::int64_t>(std::floor(v / merge_m_));
    };
    return (static_cast<std::uint64_t>(cell(x) + dx) << 32) ^
           (static_cast<std::uint64_t>(cell(y) + dy) & 0xffffffffU);
  }

  [[nodiscard]] int nearest(const Eigen::Vector3d& point) const {
    int best = -1;
    double best_squared = merge_m_ * merge_m_;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const auto at = cells_.find(key(point.x(), point.y(), dx, dy));
        if (at == cells_.end()) continue;
        for (const int i : at->second) {
          const double squared = (trees_[static_cast<std::size_t>(i)].stem.point_in_world - point)
                                     .head<2>()
                                     .squaredNorm();
          if (squared > best_squared || (squared == best_squared && i > best)) continue;
          best = i;
          best_squared = squared;
        }
      }
    }
    return best;
  }

  void move(int tree, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    const std::uint64_t before = key(from.x(), from.y(), 0, 0);
    const std::uint64_t after = key(to.x(), to.y(), 0, 0);
    if (before == after) return;
    std::vector<int>& old = cells_[before];
    old.erase(std::find(old.begin(), old.end(), tree));
    cells_[after].push_back(tree);
  }

  double merge_m_;
  std::vector<Gathered> trees_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

// visit(sight) of every stem, in the order of the views.
template <typename Visit>
void for_each_sight(const std::vector<StemView>& views, const std::vector<Pose>& world_from_body,
                    const Visit& visit) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Matrix3d rotation = world_from_body[i].rotation_matrix();
    for (const Stem& stem : views[i].stems) {
      const Eigen::Vector3d from_body = rotation * stem.point.cast<double>();
      const double dbh_own_m = 2.0 * static_cast<double>(stem.radius_sd_m);
      visit(StemSight{from_body + world_from_body[i].translation(),
                      rotation * stem.axis.cast<double>(), static_cast<double>(stem.dbh_m),
                      dbh_own_m * dbh_own_m, from_body.head<2>().norm(), static_cast<int>(i)});
    }
  }
}

std::vector<Gathered> gathered(const std::vector<StemView>& views,
                               const std::vector<Pose>& world_from_body, double merge_m) {
  Gatherer gatherer(merge_m);
  for_each_sight(views, world_from_body, [&](const StemSight& sight) { gatherer.add(sight); });
  return std::move(gatherer).trees();
}

// A tree per cluster, in the order of the views; what lies outside every shape is of no tree.
std::vector<Gathered> gathered_by_shape(const std::vector<StemView>& views,
                                        const std::vector<Pose>& world_from_body, double radius_m) {
  std::vector<Eigen::Vector2d> places;
  for_each_sight(views, world_from_body,
                 [&](const StemSight& sight) { places.emplace_back(sight.point.head<2>()); });
  const std::vector<int> cluster_of = alpha_clusters(places, radius_m);
  std::vector<Gathered> trees;
  std::size_t number = 0;
  for_each_sight(views, world_from_body, [&](const StemSight& sight) {
    const int cluster = cluster_of[number++];
    if (cluster < 0) return;
    const auto c = static_cast<std::size_t>(cluster);
    if (c >= trees.size()) trees.resize(c + 1);
    if (trees[c].stem.sights == 0) trees[c].stem.first_view = sight.view;
    update(trees[c], sight);
  });
  return trees;
}

SparsePoints places_of(const std::vector<Gathered>& trees) {
  SparsePoints places;
  for (const Gathered& tree : trees)
    places.push_back(tree.stem.point_in_world);
  return places;
}

// In how many views each tree lies within the sector that the views usually see.
std::vector<int> chances(const std::vector<Gathered>& trees, const std::vector<StemView>& views,
                         const std::vector<Pose>& world_from_body) {
  const UprightViews upright = upright_views(views, world_from_body);
  const ConeOverlap sector(estimate_view_cone(upright.points));
  const PlaneGrid grid(places_of(trees));
  std::vector<int> count(trees.size(), 0);
  for (const Pose& pose : upright.world_from_view) {
    const Pose view_from_world = pose.inverse();
    grid.around(pose.translation(), sector.cone().range_m, [&](int t) {
      const auto k = static_cast<std::size_t>(t);
      if (sector.holds(view_from_world * trees[k].stem.point_in_world)) ++count[k];
    });
  }
  return count;
}

// Two trees side by side are seen together now and then. The two images of one tree that a bent
// path makes are not, as a view has only one of them.
bool same_tree(const Gathered& a, const Gathered& b, int chances) {
  const double expected = static_cast<double>(a.views.size()) *
                          static_cast<double>(b.views.size()) / std::max(1, chances);
  if (expected < kEnoughViews) return false;
  std::vector<int> both;
  std::set_intersection(a.views.begin(), a.views.end(), b.views.begin(), b.views.end(),
                        std::back_inserter(both));
  return static_cast<double>(both.size()) < kFew * expected;
}

// Joins the nearest pairs first; the earlier tree stays.
void join_duplicates(std::vector<Gathered>& trees, const std::vector<int>& chance,
                     double duplicate_m) {
  struct Near {
    double squared;
    std::size_t a;
    std::size_t b;
  };
  std::vector<Near> pairs;
  const PlaneGrid grid(places_of(trees));
  for (std::size_t a = 0; a < trees.size(); ++a) {
    grid.around(trees[a].stem.point_in_world, duplicate_m, [&](int found) {
      const auto b = static_cast<std::size_t>(found);
      if (b <= a) return;
      const double squared =
          (trees[a].stem.point_in_world - trees[b].stem.point_in_world).head<2>().squaredNorm();
      if (squared <= duplicate_m * duplicate_m) pairs.push_back({squared, a, b});
    });
  }
  std::sort(pairs.begin(), pairs.end(), [](const Near& p, const Near& q) {
    return std::tie(p.squared, p.a, p.b) < std::tie(q.squared, q.a, q.b);
  });
  for (const Near& pair : pairs) {
    Gathered& a = trees[pair.a];
    Gathered& b = trees[pair.b];
    if (a.stem.sights == 0 || b.stem.sights == 0) continue;
    if (!same_tree(a, b, std::max(chance[pair.a], chance[pair.b]))) continue;
    merge(a, b);
    b.stem.sights = 0;
  }
}

MappedStem finished(const Gathered& tree) {
  MappedStem stem = tree.stem;
  stem.variance_m2 = tree.squares / std::max(1, stem.sights - 1);
  if (tree.axes.norm() > 0.0) stem.axis_in_world = tree.axes.normalized();
  if (stem.axis_sights > 1) {
    // Of unit vectors near their mean, the mean's shortness is half the mean square angle.
    const double shortness = 1.0 - tree.axes.norm() / stem.axis_sights;
    stem.axis_noise_rad =
        std::sqrt(2.0 * std::max(0.0, shortness) * stem.axis_sights / (stem.axis_sights - 1));
  }
  return stem;
}

}  // namespace

void describe(ConfigTable& table, StemMapConfig& config) {
  table.add("alpha_radius_m", config.alpha_radius_m, {0.0, 5.0}, "m",
            "radius of alpha shapes that make trees of sights, for instance 0.5; 0: sights are "
            "gathered about their mean");
  table.add("min_sights", config.min_sights, {1, 100'000}, "", "fewest sights of a listed tree");
  table.add("min_presence", config.min_presence, {0.0, 1.0}, "",
            "least share of the views in whose sector a listed tree lies that show it");
}

StemMapConfig tree_list_config() {
  StemMapConfig config;
  config.min_presence = kListedPresence;
  config.duplicate_m = kListedDuplicate;
  return config;
}

std::vector<MappedStem> build_stem_map(const std::vector<StemView>& views,
                                       const std::vector<Pose>& world_from_body,
                                       const StemMapConfig& config) {
  UNDERSTORY_CHECK(views.size() == world_from_body.size());
  std::vector<Gathered> trees =
      config.alpha_radius_m > 0.0 ? gathered_by_shape(views, world_from_body, config.alpha_radius_m)
                                  : gathered(views, world_from_body, config.merge_m);
  std::erase_if(trees, [&](const Gathered& t) { return t.stem.sights < config.min_sights; });
  std::vector<int> chance(trees.size(), 0);
  if (config.min_presence > 0.0 || config.duplicate_m > 0.0)
    chance = chances(trees, views, world_from_body);
  if (config.duplicate_m > 0.0) join_duplicates(trees, chance, config.duplicate_m);
  std::vector<MappedStem> result;
  for (std::size_t k = 0; k < trees.size(); ++k) {
    if (trees[k].stem.sights == 0) continue;  // joined to another
    MappedStem stem = finished(trees[k]);
    if (chance[k] > 0)
      stem.presence =
          std::min(1.0, static_cast<double>(trees[k].views.size()) / std::max(1, chance[k]));
    if (config.min_presence > 0.0 && chance[k] > 0 && stem.presence < config.min_presence) continue;
    result.push_back(stem);
  }
  return result;
}

double dbh_sd_m(const MappedStem& stem, double excess_m) {
  if (stem.dbh_sights == 0) return std::numeric_limits<double>::quiet_NaN();
  const bool own = std::isfinite(stem.dbh_own_m2);
  const double stated = own ? kStatedSights : 0.0;
  // 0 / 0 where one sight is all there is.
  const double of_sight = (stem.dbh_squares_m2 + (own ? stated * stem.dbh_own_m2 : 0.0)) /
                          (stem.dbh_sights - 1 + stated);
  return std::hypot(std::sqrt(of_sight / stem.dbh_sights), kOval * stem.dbh_m,
                    kBeamShare * excess_m);
}

}  // namespace understory
