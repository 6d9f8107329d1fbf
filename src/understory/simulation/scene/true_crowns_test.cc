#include "understory/simulation/scene/true_crowns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace understory {
namespace {

using Places = std::vector<Eigen::Vector2d>;

// The area of the convex outline by its support function h: half the integral of h^2 - h'^2.
double area_by_support(const Places& places) {
  constexpr int kSteps = 20'000;
  constexpr double kStep = 2.0 * std::numbers::pi / kSteps;
  const auto support = [&](double angle) {
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    double most = -1e9;
    for (const Eigen::Vector2d& place : places)
      most = std::max(most, place.dot(direction));
    return most;
  };
  double sum = 0.0;
  double last = support(-0.5 * kStep);
  for (int i = 0; i < kSteps; ++i) {
    const double next = support((i + 0.5) * kStep);
    const double middle = 0.5 * (last + next);
    sum += 0.5 * (middle * middle - std::pow((next - last) / kStep, 2)) * kStep;
    last = next;
  }
  return sum;
}

TEST(TrueCrowns, OutlineOfASquareWithPlacesInsideIsTheSquare) {
  const Places corners =
      convex_outline({{0, 0}, {2, 0}, {2, 2}, {0, 2}, {1, 1}, {1, 0}, {0.3, 1.2}, {2, 2}});
  EXPECT_EQ(corners.size(), 4U);
  EXPECT_DOUBLE_EQ(polygon_area(corners), 4.0);
  EXPECT_DOUBLE_EQ(polygon_area(convex_outline({{1, 1}, {2, 2}, {3, 3}})), 0.0);
  EXPECT_DOUBLE_EQ(polygon_area(convex_outline({})), 0.0);
}

GrownTree tree_of_species(Species species) {
  GrownTree tree;
  tree.species = species;
  tree.dbh_m = 0.2;
  tree.height_m = 16.0;
  tree.crown_base_m = 7.0;
  tree.crown_radius_m = 1.6;
  tree.lean = {0.05, -0.02};
  tree.yaw_rad = 2.0;
  return tree;
}

TEST(TrueCrowns, AreaIsThatOfTheLivingCrownSeenFromAbove) {
  const StandConfig config;
  const TrueCrowns crowns(config, 5);
  const std::vector<GrownCrown> grown = grow_shapes(config, 5).crowns;
  for (const Species species : {Species::kPine, Species::kSpruce, Species::kBirch}) {
    const GrownTree tree = tree_of_species(species);
    const GrownCrown& shape = grown[nearest_crown(grown, tree)];
    const double wide = tree.crown_radius_m / shape.size.crown_radius_m;
    const double high = tree.height_m / shape.size.height_m;
    Places places;
    double lowest = 1e9;
    for (const Eigen::Vector3f& vertex : shape.living.vertices) {
      const Eigen::Vector3d v = vertex.cast<double>();
      // A quarter turn: 2 rad lie between the first and the second.
      places.emplace_back(wide * Eigen::Vector2d(-v.y(), v.x()) + high * v.z() * tree.lean);
      lowest = std::min(lowest, high * v.z());
    }
    const TrueCrown crown = crowns.of(tree);
    EXPECT_NEAR(crown.area_m2, area_by_support(places), 0.02 * crown.area_m2);
    EXPECT_GT(crown.base_m, lowest);
    EXPECT_LT(crown.base_m, lowest + 2.0);
    // No larger than the cylinder that holds it, no smaller than a cone in it.
    const double cylinder = crown.area_m2 * (tree.height_m - lowest);
    EXPECT_LT(crown.volume_m3, cylinder);
    EXPECT_GT(crown.volume_m3, cylinder / 4.0);
  }
}

TEST(TrueCrowns, VolumeGrowsWithTheSquareOfTheRadiusAndWithTheHeight) {
  const TrueCrowns crowns({}, 5);
  GrownTree tree = tree_of_species(Species::kPine);
  const TrueCrown narrow = crowns.of(tree);
  tree.crown_radius_m *= 2.0;
  EXPECT_NEAR(crowns.of(tree).volume_m3, 4.0 * narrow.volume_m3, 1e-6 * narrow.volume_m3);
}

TEST(TrueCrowns, BrokenTreesHaveNone) {
  GrownTree tree = tree_of_species(Species::kPine);
  tree.broken_m = 5.0;
  EXPECT_TRUE(std::isnan(TrueCrowns({}, 5).of(tree).area_m2));
}

}  // namespace
}  // namespace understory
