#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <unordered_map>
#include <vector>

#include "understory/sensor/tree.h"
#include "understory/util/random.h"

namespace understory {

// A made-up forest, for tests and benchmarks of what finds a map by its trees.
struct ForestPlan {
  double side_m = 400.0;
  double per_ha = 400.0;   // dominant trees
  double clumping = 0.5;   // standard deviation of the logarithm of the density
  double spacing_m = 2.0;  // no two trees closer
  double row_m = 0.0;      // planted in rows so far apart, 0 = wild
};

// A smooth random field of mean 0 and standard deviation 1: waves of 15 to 150 m.
class DensityWaves {
 public:
  explicit DensityWaves(Random& random) {
    for (Wave& wave : waves_) {
      const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
      const double number =
          2.0 * std::numbers::pi / (15.0 * std::pow(10.0, random.uniform(0.0, 1.0)));
      wave = {number * std::cos(angle), number * std::sin(angle),
              random.uniform(0.0, 2.0 * std::numbers::pi)};
    }
  }
  [[nodiscard]] double at(double x, double y) const {
    double sum = 0.0;
    for (const Wave& wave : waves_)
      sum += std::cos(wave.x * x + wave.y * y + wave.phase);
    return sum * std::sqrt(2.0 / static_cast<double>(waves_.size()));
  }

 private:
  struct Wave {
    double x = 0.0;
    double y = 0.0;
    double phase = 0.0;
  };
  std::array<Wave, 16> waves_;
};

// Places that keep their distance.
class SpacedPlaces {
 public:
  explicit SpacedPlaces(double spacing_m) : cell_m_(std::max(0.1, spacing_m)) {}
  bool add(const Eigen::Vector2d& place) {
    const long column = std::lround(std::floor(place.x() / cell_m_));
    const long row = std::lround(std::floor(place.y() / cell_m_));
    for (long r = row - 1; r <= row + 1; ++r) {
      for (long c = column - 1; c <= column + 1; ++c) {
        const auto found = cells_.find(key(c, r));
        if (found != cells_.end() && (found->second - place).norm() < cell_m_) return false;
      }
    }
    return cells_.emplace(key(column, row), place).second;
  }

 private:
  static std::int64_t key(long column, long row) {
    return static_cast<std::int64_t>(row) * 1'000'003 + column;
  }
  double cell_m_;
  std::unordered_map<std::int64_t, Eigen::Vector2d> cells_;
};

// The places of trees in rows `row_m` apart, `spacing_m` along the row, some missing.
inline std::vector<Eigen::Vector2d> planted_places(const ForestPlan& plan, Random& random) {
  const Eigen::Rotation2Dd turn(random.uniform(0.0, 1.0));
  const double share = std::min(1.0, plan.per_ha * plan.row_m * plan.spacing_m / 1e4);
  const int rows = static_cast<int>(plan.side_m / plan.row_m);
  const int columns = static_cast<int>(plan.side_m / plan.spacing_m);
  std::vector<Eigen::Vector2d> places;
  for (int row = -rows; row <= rows; ++row) {
    for (int column = -columns; column <= columns; ++column) {
      const Eigen::Vector2d at =
          turn * Eigen::Vector2d(column * plan.spacing_m + 0.15 * random.normal(),
                                 row * plan.row_m + 0.15 * random.normal());
      if (random.chance(share) && at.cwiseAbs().maxCoeff() < 0.5 * plan.side_m)
        places.push_back(at);
    }
  }
  return places;
}

// Places at random, denser in clumps.
inline std::vector<Eigen::Vector2d> random_places(const ForestPlan& plan, Random& random) {
  const DensityWaves waves(random);
  SpacedPlaces spaced(plan.spacing_m);
  const auto count = static_cast<std::size_t>(plan.per_ha * plan.side_m * plan.side_m / 1e4);
  std::vector<Eigen::Vector2d> places;
  for (std::size_t tried = 0; places.size() < count && tried < 100 * count; ++tried) {
    const Eigen::Vector2d at(random.uniform(-0.5, 0.5) * plan.side_m,
                             random.uniform(-0.5, 0.5) * plan.side_m);
    if (random.uniform() * 4.0 > std::exp(plan.clumping * waves.at(at.x(), at.y()))) continue;
    if (spaced.add(at)) places.push_back(at);
  }
  return places;
}

// The dominant trees, around the origin.
inline std::vector<Tree> make_forest(const ForestPlan& plan, Random& random) {
  const DensityWaves growth(random);
  std::vector<Tree> trees;
  for (const Eigen::Vector2d& at :
       plan.row_m > 0.0 ? planted_places(plan, random) : random_places(plan, random)) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = at.x();
    tree.y = at.y();
    tree.z = 100.0 + 0.03 * at.x();
    tree.height_m = 18.0 + 2.0 * growth.at(at.x(), at.y()) + 2.5 * random.normal();
    tree.dbh_m = std::max(0.08, 0.013 * tree.height_m * std::exp(0.12 * random.normal()));
    trees.push_back(tree);
  }
  return trees;
}

// What an aircraft makes of a forest.
struct AirView {
  double complete = 0.65;
  double false_share = 0.10;  // of the trees listed
  double noise_m = 0.7;       // of a top, along each axis
  double height_noise_m = 1.0;
};

inline std::vector<Tree> seen_from_air(const std::vector<Tree>& forest, const ForestPlan& plan,
                                       const AirView& view, Random& random) {
  std::vector<Tree> list;
  for (const Tree& tree : forest) {
    if (!random.chance(view.complete)) continue;
    Tree seen = tree;
    seen.x += view.noise_m * random.normal();
    seen.y += view.noise_m * random.normal();
    seen.height_m += view.height_noise_m * random.normal();
    seen.dbh_m = Tree::kUnknown;
    list.push_back(seen);
  }
  const auto strange = static_cast<std::size_t>(view.false_share / (1.0 - view.false_share) *
                                                static_cast<double>(list.size()));
  for (std::size_t k = 0; k < strange; ++k) {
    Tree tree;
    tree.x = random.uniform(-0.5, 0.5) * plan.side_m;
    tree.y = random.uniform(-0.5, 0.5) * plan.side_m;
    tree.z = 100.0 + 0.03 * tree.x;
    tree.height_m = 18.0 + 4.0 * random.normal();
    list.push_back(tree);
  }
  return list;
}

// A map made on the ground: the trees of an ellipse, in a frame of their own.
struct GroundView {
  std::vector<Tree> trees;
  Eigen::Vector2d centre_in_forest = Eigen::Vector2d::Zero();
  Eigen::Vector2d centre_in_map = Eigen::Vector2d::Zero();
  double yaw_rad = 0.0;  // forest from map
};

inline GroundView seen_from_below(const std::vector<Tree>& forest, const ForestPlan& plan,
                                  std::size_t count, Random& random) {
  GroundView view;
  const double room = 0.5 * plan.side_m - 100.0;
  view.centre_in_forest = {random.uniform(-room, room), random.uniform(-room, room)};
  view.centre_in_map = {random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0)};
  view.yaw_rad = random.uniform(-std::numbers::pi, std::numbers::pi);
  const double ratio = random.uniform(1.0, 2.5);
  const Eigen::Rotation2Dd axis(random.uniform(0.0, std::numbers::pi));
  std::vector<std::pair<double, Tree>> all;
  for (const Tree& tree : forest) {
    Eigen::Vector2d at = Eigen::Vector2d(tree.x, tree.y) - view.centre_in_forest;
    if (at.norm() > 100.0) continue;
    at = axis * at;
    all.emplace_back(std::hypot(at.x() / ratio, at.y()), tree);
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  all.resize(std::min(all.size(), count));
  const Eigen::Rotation2Dd map_from_forest(-view.yaw_rad);
  for (auto& [distance, tree] : all) {
    const Eigen::Vector2d at =
        view.centre_in_map +
        map_from_forest * (Eigen::Vector2d(tree.x, tree.y) - view.centre_in_forest);
    tree.x = at.x() + 0.05 * random.normal();
    tree.y = at.y() + 0.05 * random.normal();
    tree.z -= 90.0;
    tree.height_m += -1.0 + 1.5 * random.normal();
    tree.dbh_m *= 1.0 + 0.05 * random.normal();
    view.trees.push_back(tree);
  }
  return view;
}

inline void forget_sizes(std::vector<Tree>& trees) {
  for (Tree& tree : trees)
    tree.height_m = tree.dbh_m = Tree::kUnknown;
}

}  // namespace understory
