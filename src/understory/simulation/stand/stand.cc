#include "understory/simulation/stand/stand.h"

#include <algorithm>
#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/stand/stand_drawing.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kBreastHeight = GrownTree::kBreastHeight;

// Shape of the stem: the share of the diameter at a height, not yet scaled to the dbh. A power of
// the distance to the top, with a flare where the roots begin.
double taper(double height, double top) {
  if (height >= top) return 0.0;
  const double flare = 1.0 + 0.35 * std::exp(-std::max(height, 0.0) / 0.22);
  return flare * std::pow((top - height) / top, 0.8);
}

// Growth by an own stream, so that stands without them are what they were.
void draw_damage(const StandConfig& config, GrownTree& tree, Random& random) {
  if (!tree.cloud.empty()) return;  // as it was scanned
  if (random.uniform() < config.fork_share) {
    tree.fork_m = std::min(0.6 * tree.height_m, random.uniform(0.8, 6.0));
  }
  if (random.uniform() < config.broken_share) {
    tree.broken_m = std::max(2.0, tree.height_m * random.uniform(0.3, 0.8));
    tree.fork_m = 0.0;
  }
}

Species draw_species(const StandConfig& config, Random& random) {
  const double u = random.uniform();
  if (u < config.pine_share) return Species::kPine;
  return u < config.pine_share + config.spruce_share ? Species::kSpruce : Species::kBirch;
}

// Finds what lies near a place without looking at everything.
class Grid {
 public:
  Grid(double half_x, double half_y, double cell)
      : half_x_(half_x),
        half_y_(half_y),
        cell_(cell),
        columns_(static_cast<int>(2.0 * half_x / cell) + 3),
        cells_(static_cast<std::size_t>(columns_) *
               static_cast<std::size_t>(static_cast<int>(2.0 * half_y / cell) + 3)) {}
  void add(const Eigen::Vector2d& place) { cells_[index(place)].push_back(place); }
  [[nodiscard]] bool free(const Eigen::Vector2d& place, double distance) const {
    const int reach = static_cast<int>(std::ceil(distance / cell_));
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const Eigen::Vector2d near = place + cell_ * Eigen::Vector2d(dx, dy);
        if (std::abs(near.x()) > half_x_ + cell_ || std::abs(near.y()) > half_y_ + cell_) continue;
        for (const Eigen::Vector2d& other : cells_[index(near)]) {
          if ((other - place).norm() < distance) return false;
        }
      }
    }
    return true;
  }

 private:
  [[nodiscard]] std::size_t index(const Eigen::Vector2d& place) const {
    const auto i = static_cast<int>(std::floor((place.x() + half_x_) / cell_)) + 1;
    const auto j = static_cast<int>(std::floor((place.y() + half_y_) / cell_)) + 1;
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(i);
  }
  double half_x_;
  double half_y_;
  double cell_;
  int columns_;
  std::vector<std::vector<Eigen::Vector2d>> cells_;
};

Eigen::Vector2d draw_place(const StandConfig& config, Random& random) {
  const double x = random.uniform(-0.5, 0.5) * config.size_x_m;
  const double y = random.uniform(-0.5, 0.5) * config.size_y_m;
  return {x, y};
}

// Draws of which those outside of the stand are thrown away.
std::size_t count_of(double per_ha, const StandConfig& config) {
  return static_cast<std::size_t>(std::lround(per_ha * config.size_x_m * config.size_y_m / 1e4));
}

bool outside(const StandConfig& config, const Route& route, const Eigen::Vector2d& place) {
  return config.margin_m > 0.0 && !route.near(place, config.margin_m);
}

// Share of the rectangle that the stand fills, on a grid of 4 m.
double filled_share(const StandConfig& config, const Route& route) {
  if (config.margin_m <= 0.0) return 1.0;
  constexpr double kCell = 4.0;
  std::size_t all = 0;
  std::size_t inside = 0;
  for (double x = -0.5 * config.size_x_m + 0.5 * kCell; x < 0.5 * config.size_x_m; x += kCell) {
    for (double y = -0.5 * config.size_y_m + 0.5 * kCell; y < 0.5 * config.size_y_m; y += kCell) {
      ++all;
      inside += outside(config, route, {x, y}) ? 0 : 1;
    }
  }
  return static_cast<double>(inside) / static_cast<double>(std::max<std::size_t>(all, 1));
}

// Whether the carrier can pass. The bark must stay clear of the path at the height of the sensors,
// and no low crown may swallow them.
bool clear_of_route(const GrownTree& tree, const Eigen::Vector2d& foot, const StandConfig& config,
                    const CarrierConfig& carrier, const Route& route) {
  const double sensor = std::max(1.5, carrier.height_m);
  if (carrier.kind == "uav" && tree.height_m < sensor - 0.8) return true;  // it flies over it
  if (carrier.narrow_to > carrier.narrow_from &&
      route.distance_to(foot, carrier.narrow_from, carrier.narrow_to) <
          route.distance_to(foot) + 1e-9) {
    const double needed = config.narrow_clearance_m + 0.5 * tree.dbh_m;
    return route.distance_to(foot) > needed;
  }
  const Eigen::Vector2d there = foot + (tree.centre(sensor) - tree.foot).head<2>();
  double needed = config.path_clearance_m + 0.5 * tree.dbh_m;
  if (tree.crown_base_m < sensor + 0.8) {
    needed = std::max(needed, 0.75 * tree.crown_radius_m + 0.4);
  }
  return std::min(route.distance_to(foot), route.distance_to(there)) > needed;
}

bool on_edge(const StandConfig& config, const Eigen::Vector2d& place) {
  return config.edge_m > 0.0 && (std::abs(place.x()) > 0.5 * config.size_x_m - config.edge_m ||
                                 std::abs(place.y()) > 0.5 * config.size_y_m - config.edge_m);
}

// The trees of the border.
StandConfig edge_stand(const StandConfig& config) {
  StandConfig edge = config;
  edge.dbh_mean_m = config.edge_dbh_mean_m;
  edge.dbh_sd_m = 0.25 * config.edge_dbh_mean_m;
  edge.dbh_min_m = 0.5 * config.edge_dbh_mean_m;
  edge.dbh_max_m = 1.8 * config.edge_dbh_mean_m;
  edge.height_mean_m = config.edge_height_mean_m;
  edge.crown_base_share = 0.0;
  return edge;
}

std::vector<GrownTree> place_trees(const StandConfig& config, const CarrierConfig& carrier,
                                   const Terrain& terrain, const Route& route, Random& random) {
  const std::size_t drawn = count_of(config.trees_per_ha, config);
  const auto wanted = static_cast<std::size_t>(
      std::lround(static_cast<double>(drawn) * filled_share(config, route)));
  Grid grid(0.5 * config.size_x_m, 0.5 * config.size_y_m, std::max(1.0, config.spacing_m));
  std::vector<GrownTree> trees;
  const StandConfig edge = edge_stand(config);
  for (std::size_t attempt = 0; attempt < 40 * drawn && trees.size() < wanted; ++attempt) {
    GrownTree tree = draw_tree(config, random);
    const Eigen::Vector2d place = draw_place(config, random);
    if (outside(config, route, place)) continue;
    if (on_edge(config, place)) {
      // Tall trees need more room each.
      if (random.uniform() > 0.3) continue;
      tree = draw_tree(edge, random);
    }
    if (!grid.free(place, config.spacing_m + 2.0 * tree.dbh_m)) continue;
    if (!clear_of_route(tree, place, config, carrier, route)) continue;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.foot = {place.x(), place.y(), terrain.height(place.x(), place.y())};
    grid.add(place);
    trees.push_back(tree);
  }
  return trees;
}

void add_dead_wood(const StandConfig& config, const CarrierConfig& carrier, const Terrain& terrain,
                   const Route& route, Random& random, std::vector<Wood>& pieces) {
  for (std::size_t i = 0; i < count_of(config.stumps_per_ha, config); ++i) {
    const Eigen::Vector2d place = draw_place(config, random);
    if (outside(config, route, place) || route.distance_to(place) < 0.8) continue;
    const double ground = terrain.height(place.x(), place.y());
    const double radius = random.uniform(0.08, 0.2);
    pieces.push_back({{place.x(), place.y(), ground - 0.2},
                      {place.x(), place.y(), ground + random.uniform(0.15, 0.5)},
                      1.15 * radius,
                      radius});
  }
  for (std::size_t i = 0; i < count_of(config.logs_per_ha, config); ++i) {
    const Eigen::Vector2d place = draw_place(config, random);
    const double yaw = random.uniform(0.0, kTau);
    const double length = random.uniform(3.0, 11.0);
    const Eigen::Vector2d end = place + length * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
    const double thick = random.uniform(0.07, 0.16);
    if (outside(config, route, place)) continue;
    if (carrier.height_m < 1.0 && route.distance_to(0.5 * (place + end)) < 0.5 * length) continue;
    pieces.push_back(
        {{place.x(), place.y(), terrain.smooth_height(place.x(), place.y(), 0.5) + 0.8 * thick},
         {end.x(), end.y(), terrain.smooth_height(end.x(), end.y(), 0.5) + 0.5 * thick},
         thick,
         0.5 * thick});
  }
}

// Plants of one kind: how many a hectare, how tall, and how far from the route.
struct PlantLayer {
  PlantKind kind = PlantKind::kShrub;
  double per_ha = 0.0;
  double low_m = 0.0;  // heights are drawn evenly between low_m and high_m
  double high_m = 0.0;
  double clearance_m = 0.0;
};

void add_plants(const PlantLayer& layer, const StandConfig& config, const Terrain& terrain,
                const Route& route, Random& random, std::vector<Plant>& plants) {
  for (std::size_t i = 0; i < count_of(layer.per_ha, config); ++i) {
    const Eigen::Vector2d place = draw_place(config, random);
    const double height = random.uniform(layer.low_m, layer.high_m);
    const double yaw = random.uniform(0.0, kTau);
    if (outside(config, route, place) || route.distance_to(place) < layer.clearance_m) continue;
    plants.push_back(
        {layer.kind, {place.x(), place.y(), terrain.height(place.x(), place.y())}, height, yaw});
  }
}

void add_boulders(const StandConfig& config, const Terrain& terrain, const Route& route,
                  std::uint64_t seed, std::vector<Wood>& boulders) {
  Random random(hash_numbers(seed, stream_of(NoiseStream::kUndergrowth), 1));
  for (std::size_t i = 0; i < count_of(config.boulders_per_ha, config); ++i) {
    const Eigen::Vector2d place = draw_place(config, random);
    const double radius = 0.25 + random.exponential(0.3);
    const double yaw = random.uniform(0.0, kTau);
    const double sunk = random.uniform(-0.1, 0.5) * radius;
    if (outside(config, route, place) || radius > 2.0 || route.distance_to(place) < radius + 1.5)
      continue;
    const Eigen::Vector3d middle(place.x(), place.y(), terrain.height(place.x(), place.y()) - sunk);
    const Eigen::Vector3d along(std::cos(yaw), std::sin(yaw), 0.0);
    boulders.push_back(
        {middle - 0.4 * radius * along, middle + 0.4 * radius * along, radius, 0.75 * radius});
  }
}

// The first 12 m to the left of the route's start, the second to the right of its end. Trees make
// room.
void add_buildings(const StandConfig& config, const CarrierConfig& carrier, const Terrain& terrain,
                   const Route& route, Stand& stand) {
  for (int i = 0; i < config.buildings; ++i) {
    const double at = i == 0 ? 0.0 : route.length_m();
    const double yaw = route.heading(at);
    const double side = (i == 0 ? 1.0 : -1.0) * (9.0 + carrier.height_m);
    const Eigen::Vector2d place =
        route.place(at) + side * Eigen::Vector2d(-std::sin(yaw), std::cos(yaw));
    Building house;
    house.foot = {place.x(), place.y(), terrain.smooth_height(place.x(), place.y(), 3.0)};
    house.yaw_rad = yaw;
    const auto inside = [&](const Eigen::Vector3d& foot) {
      return (foot - house.foot).head<2>().norm() < 7.5;
    };
    stand.trees.erase(std::remove_if(stand.trees.begin(), stand.trees.end(),
                                     [&](const GrownTree& tree) { return inside(tree.foot); }),
                      stand.trees.end());
    stand.plants.erase(std::remove_if(stand.plants.begin(), stand.plants.end(),
                                      [&](const Plant& plant) { return inside(plant.foot); }),
                       stand.plants.end());
    stand.buildings.push_back(house);
  }
}

}  // namespace

void draw_crown(const StandConfig& config, GrownTree& tree, Random& random) {
  const double height = tree.height_m;
  switch (tree.species) {
    case Species::kPine:
      tree.crown_base_m = height * random.uniform(0.31, 0.55);
      tree.crown_radius_m = 0.55 + 4.6 * tree.dbh_m * random.uniform(0.8, 1.2);
      tree.bark_reflectivity = random.uniform(0.28, 0.45);
      break;
    case Species::kSpruce:
      tree.crown_base_m = std::min(0.5 * height, random.uniform(0.6, 4.5));
      tree.crown_radius_m = 0.6 + 5.0 * tree.dbh_m * random.uniform(0.8, 1.2);
      tree.bark_reflectivity = random.uniform(0.22, 0.38);
      break;
    case Species::kBirch:
      tree.crown_base_m = height * random.uniform(0.4, 0.55);
      tree.crown_radius_m = 0.6 + 6.0 * tree.dbh_m * random.uniform(0.8, 1.2);
      tree.bark_reflectivity = random.uniform(0.5, 0.75);
      break;
  }
  if (config.crown_base_share > 0.0) {
    tree.crown_base_m = std::min(0.95, config.crown_base_share * random.uniform(0.7, 1.3)) * height;
  }
}

// Heights rise with the diameter, ever more slowly (Naeslund's curve through the mean tree).
double height_of(double dbh_m, const StandConfig& config) {
  const double ratio = dbh_m / config.dbh_mean_m;
  const double curve = std::pow(ratio / (0.32 + 0.68 * ratio), 2.0);
  return kBreastHeight + (config.height_mean_m - kBreastHeight) * curve;
}

GrownTree draw_tree(const StandConfig& config, Random& random) {
  GrownTree tree;
  tree.species = draw_species(config, random);
  do {
    tree.dbh_m = random.normal(config.dbh_mean_m, config.dbh_sd_m);
  } while (tree.dbh_m < config.dbh_min_m || tree.dbh_m > config.dbh_max_m);
  tree.height_m = height_of(tree.dbh_m, config) * random.uniform(0.9, 1.1);
  tree.height_m = std::max(tree.height_m, config.height_min_m);
  const double lean_sd = std::tan(config.lean_sd_deg * kDegree);
  tree.lean = {random.normal(0.0, lean_sd), random.normal(0.0, lean_sd)};
  tree.sweep = {random.normal(0.0, config.sweep_m), random.normal(0.0, config.sweep_m)};
  tree.yaw_rad = random.uniform(0.0, kTau);
  draw_crown(config, tree, random);
  return tree;
}

std::string species_name(Species species) {
  switch (species) {
    case Species::kPine:
      return "pine";
    case Species::kSpruce:
      return "spruce";
    case Species::kBirch:
      return "birch";
  }
  return "unknown";
}

double GrownTree::diameter(double height_above_foot) const {
  return dbh_m * taper(height_above_foot, height_m) / taper(kBreastHeight, height_m);
}

Eigen::Vector3d GrownTree::centre(double height_above_foot) const {
  // A bow that begins straight at the foot and comes back at the top.
  const double u = std::clamp(height_above_foot / height_m, 0.0, 1.0);
  const double bow = 0.5 * (1.0 - std::cos(kTau * u));
  const Eigen::Vector2d side = lean * height_above_foot + sweep * bow;
  return foot + Eigen::Vector3d(side.x(), side.y(), height_above_foot);
}

GrownTree::Joint GrownTree::fork_joint(double height_above_foot) const {
  Joint twin = joint(height_above_foot);
  // It leaves at a slant and then grows up beside the first, a little thinner.
  const double above = std::max(0.0, height_above_foot - fork_m);
  const double aside = 0.9 * (1.0 - std::exp(-above / 2.0)) + 0.03 * above;
  twin.centre += aside * Eigen::Vector3d(std::cos(yaw_rad), std::sin(yaw_rad), 0.0);
  twin.radius_m *= 0.85;
  return twin;
}

std::vector<double> GrownTree::joints() const {
  std::vector<double> heights = {-0.3, 0.0, 0.12, 0.3, 0.6, 1.0, kBreastHeight};
  const double step = std::max(0.5, (height_m - kBreastHeight) / 26.0);
  for (double h = kBreastHeight + step; h < height_m - 0.2 * step; h += step)
    heights.push_back(h);
  heights.push_back(height_m);
  if (broken_m > 0.0) {
    heights.erase(std::upper_bound(heights.begin(), heights.end(), broken_m), heights.end());
    heights.push_back(broken_m);
  }
  return heights;
}

GrownTree::Joint GrownTree::joint(double height_above_foot) const {
  const double above = std::max(0.0, height_above_foot);
  Joint joint{centre(above), std::max(0.004, 0.5 * diameter(above))};
  joint.centre.z() = foot.z() + height_above_foot;
  return joint;
}

double GrownTree::lean_deg() const {
  const Eigen::Vector3d axis = centre(3.0) - centre(0.0);
  return std::atan2(axis.head<2>().norm(), axis.z()) / kDegree;
}

Stand grow_stand(const StandConfig& config, const CarrierConfig& carrier, const Terrain& terrain,
                 const Route& route, std::uint64_t seed) {
  Random tree_random(seed, stream_of(NoiseStream::kStand));
  Random random(seed, stream_of(NoiseStream::kUndergrowth));
  Stand stand;
  stand.trees = config.trees.empty() ? place_trees(config, carrier, terrain, route, tree_random)
                                     : read_trees(config.trees, config, terrain, seed);
  Random damage(hash_numbers(seed, stream_of(NoiseStream::kStand), 1));
  for (GrownTree& tree : stand.trees)
    draw_damage(config, tree, damage);
  add_dead_wood(config, carrier, terrain, route, random, stand.dead_wood);
  for (const PlantLayer& layer :
       {PlantLayer{PlantKind::kSeedling, config.seedlings_per_ha, 0.4, 2.2, 0.8},
        PlantLayer{PlantKind::kShrub, config.shrubs_per_ha, 0.5, 1.8, 0.8},
        PlantLayer{PlantKind::kGroundPlants, config.ground_plants_per_ha, 0.15, 0.45, 0.0}}) {
    add_plants(layer, config, terrain, route, random, stand.plants);
  }
  add_boulders(config, terrain, route, seed, stand.boulders);
  add_buildings(config, carrier, terrain, route, stand);
  return stand;
}

}  // namespace understory
