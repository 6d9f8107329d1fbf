#include "understory/forest/trees/tree_crowns.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// A disc of points at a height, its middle beside the origin.
void add_disc(TreeOwners& owners, double radius_m, double height_m, double aside_m = 0.0) {
  for (double x = -radius_m; x <= radius_m; x += 0.1) {
    for (double y = -radius_m; y <= radius_m; y += 0.1)
      if (std::hypot(x, y) <= radius_m) owners.add({x + aside_m, y}, height_m);
  }
}

OwnerTree owner_tree(double height_m) {
  OwnerTree tree;
  tree.radius_m = 0.1;
  tree.height_m = height_m;
  tree.seen_to_m = 3.5;
  tree.centres.assign(100, Eigen::Vector2d::Zero());
  return tree;
}

// A stem with a crown of 2 m from 8 to 15 m, and a bush of 1.2 m around its foot.
TreeCrown crown_with_bush(double bush_m) {
  TreeOwners owners;
  for (double height = 0.3; height < 15.0; height += 0.1)
    add_disc(owners, 0.1, height);
  for (double height = 8.0; height < 15.0; height += 0.1)
    add_disc(owners, 2.0, height);
  for (double height = 1.6; height < bush_m; height += 0.1)
    add_disc(owners, 1.2, height);
  const std::vector<OwnerTree> trees = {owner_tree(15.0)};
  owners.find(trees, {});
  return measure_crowns(owners, trees)[0];
}

TEST(TreeCrowns, TheAreaIsThatOfTheConvexOutline) {
  const TreeCrown crown = crown_with_bush(0.0);
  EXPECT_NEAR(crown.area_m2, M_PI * 4.0, 0.06 * M_PI * 4.0);
  EXPECT_NEAR(crown.volume_m3, 7.0 * M_PI * 4.0, 0.15 * 7.0 * M_PI * 4.0);
}

// A stem with a crown of 2 m from 8 to 15 m.
TreeOwners stem_with_crown(double aside_m) {
  TreeOwners owners;
  for (double height = 0.3; height < 15.0; height += 0.1)
    add_disc(owners, 0.1, height);
  for (double height = 8.0; height < 15.0; height += 0.1)
    add_disc(owners, 2.0, height, aside_m);
  return owners;
}

TEST(TreeCrowns, BranchesOfANeighbourDoNotWidenTheOutline) {
  TreeOwners owners = stem_with_crown(0.0);
  // A branch of 0.6 m that leads from the crown to 4.5 m.
  for (double x = 0.0; x < 4.5; x += 0.1) {
    for (double y = -0.3; y <= 0.3; y += 0.1)
      for (double height = 10.0; height < 10.6; height += 0.1)
        owners.add({x, y}, height);
  }
  const std::vector<OwnerTree> trees = {owner_tree(15.0)};
  owners.find(trees, {});
  EXPECT_GT(owners.owner({4.2, 0.0}, 10.3), TreeOwners::kNobody);
  EXPECT_NEAR(measure_crowns(owners, trees)[0].area_m2, M_PI * 4.0, 0.16 * M_PI * 4.0);
}

// Two trees of one height, 3 m apart, whose crowns touch. One stem was measured into its crown, the
// other one far below. By ways from the measured stems alone, the first tree has both crowns.
TEST(TreeCrowns, ATreeWhoseStemWasSeenLowKeepsTheCrownAroundItsAxis) {
  TreeOwners owners;
  std::vector<OwnerTree> trees = {owner_tree(15.0), owner_tree(15.0)};
  trees[1].seen_to_m = 10.0;
  for (Eigen::Vector2d& centre : trees[1].centres)
    centre.x() = 3.0;
  for (double height = 0.3; height < 15.0; height += 0.1) {
    for (const double x : {0.0, 3.0})
      add_disc(owners, height < 8.0 ? 0.1 : 1.6, height, x);
  }
  owners.find(trees, {});
  for (const double height : {9.0, 11.0, 13.0}) {
    EXPECT_EQ(owners.owner({0.7, 0.0}, height), 0) << height;
    EXPECT_EQ(owners.owner({2.3, 0.0}, height), 1) << height;
  }
  for (const TreeCrown& crown : measure_crowns(owners, trees))
    EXPECT_NEAR(crown.area_m2, M_PI * 2.56, 0.25 * M_PI * 2.56);
}

// The same crown of fewer points is as large: what is missing at its edge is added.
TEST(TreeCrowns, FewPointsMakeACrownNoSmaller) {
  Random random(3);
  double area[2] = {0.0, 0.0};
  for (int k = 0; k < 2; ++k) {
    TreeOwners owners;
    for (double height = 0.3; height < 15.0; height += 0.1)
      add_disc(owners, 0.1, height);
    for (int i = 0; i < (k == 0 ? 40'000 : 250);) {
      const Eigen::Vector2d place(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0));
      if (place.norm() > 2.0) continue;
      owners.add(place, random.uniform(8.0, 15.0));
      ++i;
    }
    const std::vector<OwnerTree> trees = {owner_tree(15.0)};
    owners.find(trees, {});
    area[k] = measure_crowns(owners, trees)[0].area_m2;
    EXPECT_NEAR(area[k], M_PI * 4.0, 0.15 * M_PI * 4.0) << k;
  }
  EXPECT_GT(area[1], 0.95 * area[0]);
}

// Three quarters of a crown hide behind the rest.
TEST(TreeCrowns, ACrownSeenFromOneSideHasABaseAndNoArea) {
  TreeOwners owners;
  for (double height = 0.3; height < 15.0; height += 0.1)
    add_disc(owners, 0.1, height);
  for (double height = 8.0; height < 15.0; height += 0.1) {
    for (double x = 0.1; x < 2.0; x += 0.1) {
      for (double y = -2.0; y < 2.0; y += 0.1)
        if (std::hypot(x, y) <= 2.0 && std::abs(y) < x) owners.add({x + 0.1, y}, height);
    }
  }
  const std::vector<OwnerTree> trees = {owner_tree(15.0)};
  owners.find(trees, {});
  const TreeCrown crown = measure_crowns(owners, trees)[0];
  EXPECT_NEAR(crown.base_m, 8.0, 0.51);
  EXPECT_TRUE(std::isnan(crown.area_m2));
  EXPECT_TRUE(std::isnan(crown.volume_m3));
  EXPECT_TRUE(crown.outline.empty());
}

// A crown leans to the light.
TEST(TreeCrowns, ACrownBesideItsStemKeepsItsArea) {
  TreeOwners owners = stem_with_crown(1.5);
  const std::vector<OwnerTree> trees = {owner_tree(15.0)};
  owners.find(trees, {});
  EXPECT_NEAR(measure_crowns(owners, trees)[0].area_m2, M_PI * 4.0, 0.08 * M_PI * 4.0);
}

TEST(TreeCrowns, TheOutlineRunsAgainstTheClockRoundTheCrown) {
  const TreeCrown crown = crown_with_bush(0.0);
  EXPECT_NEAR(signed_area_m2(crown.outline), crown.area_m2, 1e-9);
  ASSERT_GT(crown.outline.size(), 8U);
  for (std::size_t i = 0; i < crown.outline.size(); ++i) {
    const Eigen::Vector2d& corner = crown.outline[i];
    EXPECT_NEAR(corner.norm(), 2.0, 0.18);
    const Eigen::Vector2d& next = crown.outline[(i + 1) % crown.outline.size()];
    const Eigen::Vector2d ahead = crown.outline[(i + 2) % crown.outline.size()] - next;
    const Eigen::Vector2d along = next - corner;
    EXPECT_GT(along.x() * ahead.y() - along.y() * ahead.x(), 0.0) << "convex, no corner twice";
  }
}

TEST(TreeCrowns, WhereNoCrownWasSeenThereIsNoOutline) {
  TreeOwners owners;
  for (double height = 0.3; height < 3.0; height += 0.1)
    add_disc(owners, 0.1, height);
  const std::vector<OwnerTree> trees = {owner_tree(15.0)};
  owners.find(trees, {});
  EXPECT_TRUE(measure_crowns(owners, trees)[0].outline.empty());
}

TEST(TreeCrowns, ASnagIsBareInItsUpperHalf) {
  TreeOwners owners;
  for (double height = 0.3; height < 9.0; height += 0.1)
    add_disc(owners, 0.1, height);
  for (double height = 1.0; height < 3.0; height += 0.1)
    add_disc(owners, 1.2, height);  // a bush at its foot
  std::vector<OwnerTree> trees = {owner_tree(9.0)};
  owners.find(trees, {});
  EXPECT_EQ(measure_crowns(owners, trees)[0].bare, 1.0);
  trees[0].height_m = std::nan("");
  EXPECT_TRUE(std::isnan(measure_crowns(owners, trees)[0].bare)) << "its top was not seen";
  EXPECT_EQ(crown_with_bush(0.0).bare, 0.0);
}

// Nothing says that a stem goes up there.
TEST(TreeCrowns, WhatWasHardlySeenIsNoSnag) {
  TreeOwners owners;
  for (double height = 0.3; height < 3.5; height += 0.1)
    add_disc(owners, 0.1, height);
  owners.add({0.0, 0.0}, 8.9);
  const std::vector<OwnerTree> trees = {owner_tree(9.0)};
  owners.find(trees, {});
  EXPECT_TRUE(std::isnan(measure_crowns(owners, trees)[0].bare));
}

TEST(TreeCrowns, ABushAtTheFootIsNotTheBase) {
  EXPECT_NEAR(crown_with_bush(0.0).base_m, 8.0, 0.51);
  EXPECT_NEAR(crown_with_bush(4.2).base_m, 8.0, 0.51);
}

// Branches or undergrowth all the way down. The base was 1.5 m once, where nobody saw one.
TEST(TreeCrowns, ATreeThatIsWideDownToTheUndergrowthHasAnAreaAndNoBase) {
  for (const double low : {0.4, 1.8, 2.6}) {
    TreeOwners owners;
    for (double height = 0.3; height < 15.0; height += 0.1)
      add_disc(owners, 0.1, height);
    for (double height = low; height < 15.0; height += 0.1)
      add_disc(owners, 2.0, height);
    const std::vector<OwnerTree> trees = {owner_tree(15.0)};
    owners.find(trees, {});
    const TreeCrown crown = measure_crowns(owners, trees)[0];
    EXPECT_NEAR(crown.area_m2, M_PI * 4.0, 0.15 * M_PI * 4.0) << low;
    if (low < 2.0) {
      EXPECT_TRUE(std::isnan(crown.base_m)) << low;
    } else {
      EXPECT_NEAR(crown.base_m, low, 0.51);
    }
  }
}

}  // namespace
}  // namespace understory
