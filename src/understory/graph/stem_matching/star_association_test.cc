#include "understory/graph/stem_matching/star_association.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

SparsePoints spaced_trees(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> side(-25.0, 25.0);
  SparsePoints trees;
  while (trees.size() < 120) {
    const Eigen::Vector3d tree(side(random), side(random), 0.0);
    bool free = true;
    for (const Eigen::Vector3d& other : trees)
      free &= (tree - other).norm() > 2.0;
    if (free) trees.push_back(tree);
  }
  return trees;
}

// A fifth of the trees missed, the others with noise.
SparsePoints seen_trees(const SparsePoints& trees, const Pose& view_from_world, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.07);
  SparsePoints result;
  for (const Eigen::Vector3d& tree : trees) {
    if (unit(random) < 0.2) continue;
    result.push_back(view_from_world * tree + Eigen::Vector3d(noise(random), noise(random), 0.0));
  }
  return result;
}

Pose at(double yaw, double x, double y) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(x, y, 0.0)};
}

TEST(StarAssociation, StemsOfOnePlaceFindTheirPartnersAndThoseOfAnotherDoNot) {
  const SparsePoints trees = spaced_trees(1);
  const Pose a_from_world = at(0.3, 1.0, 2.0);
  const Pose b_from_world = at(-0.8, -2.0, 0.5);
  const StarView a = stars_of(seen_trees(trees, a_from_world, 2));
  const StarView b = stars_of(seen_trees(trees, b_from_world, 3));
  const StarView stranger = stars_of(seen_trees(spaced_trees(9), b_from_world, 4));
  const Pose a_from_b = a_from_world * b_from_world.inverse();
  // Two thirds of the trees are in both; with a guess that may be a metre off.
  const double same = associated_stems(a, b, a_from_b, 1.0, {});
  EXPECT_GT(same, 55.0);
  EXPECT_LT(same, 85.0);
  EXPECT_LT(associated_stems(a, stranger, a_from_b, 1.0, {}), 0.35 * same);
  // A guess that is off by more than it says, or turned, tells less.
  EXPECT_LT(associated_stems(a, b, at(0.0, 2.0, 0.0) * a_from_b, 0.05, {}), 0.35 * same);
  EXPECT_LT(associated_stems(a, b, at(0.4, 0.0, 0.0) * a_from_b, 1.0, {}), 0.35 * same);
}

// It is the stars that tell neighbours apart where the guess is worth little.
TEST(StarAssociation, StarsTellWhatPlacesCannot) {
  const SparsePoints trees = spaced_trees(5);
  const StarView a = stars_of(seen_trees(trees, Pose(), 6));
  StarView b = stars_of(seen_trees(trees, Pose(), 7));
  const double with_stars = associated_stems(a, b, Pose(), 2.0, {});
  for (auto& star : b.stars)
    star.clear();
  EXPECT_LT(associated_stems(a, b, Pose(), 2.0, {}), 0.6 * with_stars);
  EXPECT_EQ(associated_stems(a, stars_of({}), Pose(), 2.0, {}), 0.0);
  EXPECT_EQ(associated_stems(stars_of({}), a, Pose(), 2.0, {}), 0.0);
}

}  // namespace
}  // namespace understory
