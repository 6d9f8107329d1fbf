#include "understory/forest/trees/tree_owners.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/forest/trees/tree_crowns.h"
#include "understory/util/random.h"

namespace understory {
namespace {

OwnerTree upright(double x, double height_m) {
  OwnerTree tree;
  tree.centres.assign(static_cast<std::size_t>(10.0 * height_m) + 1, {x, 0.0});
  tree.radius_m = 0.15;
  tree.seen_to_m = 3.5;
  tree.height_m = height_m;
  return tree;
}

void add_line(TreeOwners& owners, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const int steps = static_cast<int>((to - from).norm() / 0.02);
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector3d p = from + (to - from) * (static_cast<double>(i) / steps);
    owners.add(p.head<2>(), p.z());
  }
}

TEST(TreeOwners, ABranchBelongsToTheTreeThatItGrowsFrom) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 12.0});
  add_line(owners, {2.5, 0.1, 0.3}, {2.5, 0.1, 12.0});
  add_line(owners, {0.1, 0.1, 6.0}, {1.9, 0.1, 6.0});  // ends beside the other stem
  owners.find({upright(0.1, 12.0), upright(2.5, 12.0)});
  EXPECT_EQ(owners.owner({0.1, 0.1}, 11.0), 0);
  EXPECT_EQ(owners.owner({2.5, 0.1}, 11.0), 1);
  EXPECT_EQ(owners.owner({1.1, 0.1}, 6.0), 0);
  EXPECT_EQ(owners.owner({1.9, 0.1}, 6.0), 0);
}

TEST(TreeOwners, CrownsThatTouchAreCutWhereTheWaysFromBothStemsAreAlike) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 12.0});
  add_line(owners, {3.1, 0.1, 0.3}, {3.1, 0.1, 12.0});
  add_line(owners, {0.1, 0.1, 8.0}, {3.1, 0.1, 8.0});
  owners.find({upright(0.1, 12.0), upright(3.1, 12.0)});
  EXPECT_EQ(owners.owner({1.2, 0.1}, 8.0), 0);
  EXPECT_EQ(owners.owner({2.0, 0.1}, 8.0), 1);
}

TEST(TreeOwners, ACrownOverAGapBelongsToTheStemBelow) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 5.0});
  add_line(owners, {0.1, 0.1, 5.9}, {0.1, 0.1, 9.0});
  add_line(owners, {0.1, 0.1, 7.0}, {1.1, 0.1, 7.0});
  owners.find({upright(0.1, 9.0)});
  EXPECT_EQ(owners.owner({0.1, 0.1}, 8.0), 0);
  EXPECT_EQ(owners.owner({1.1, 0.1}, 7.0), 0);
}

TEST(TreeOwners, UndergrowthTopsOfOthersAndFarThingsBelongToNobody) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 9.0});
  add_line(owners, {0.1, 0.1, 0.9}, {1.1, 0.1, 0.9});   // a bush beside the stem
  add_line(owners, {0.1, 0.1, 9.0}, {0.1, 0.1, 14.0});  // over its top
  add_line(owners, {0.1, 0.1, 6.0}, {7.1, 0.1, 6.0});   // much wider than a crown
  owners.find({upright(0.1, 9.0)});
  EXPECT_EQ(owners.owner({0.1, 0.1}, 0.9), 0);
  EXPECT_EQ(owners.owner({1.0, 0.1}, 0.9), TreeOwners::kNobody);
  EXPECT_EQ(owners.owner({0.1, 0.1}, 12.0), TreeOwners::kNobody);
  EXPECT_EQ(owners.owner({6.9, 0.1}, 6.0), TreeOwners::kNobody);
  EXPECT_EQ(owners.owner({50.0, 50.0}, 6.0), TreeOwners::kNobody);  // no point there
}

TEST(TreeOwners, WithoutTreesNothingHasAnOwner) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 9.0});
  owners.find({});
  EXPECT_EQ(owners.owner({0.1, 0.1}, 5.0), TreeOwners::kNobody);
  EXPECT_GT(owners.size(), 30U);
}

TEST(TreeCrowns, BaseAreaAndVolumeOfACylinder) {
  TreeOwners owners;
  Random random(1);
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 10.0});
  for (int i = 0; i < 60'000; ++i) {
    const double r = 1.6 * std::sqrt(random.uniform());
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    owners.add({0.1 + r * std::cos(turn), 0.1 + r * std::sin(turn)}, random.uniform(5.0, 10.0));
  }
  // One dead branch far below the crown.
  add_line(owners, {0.1, 0.1, 2.6}, {1.2, 0.1, 2.6});
  const std::vector<OwnerTree> trees = {upright(0.1, 10.0)};
  owners.find(trees);
  const std::vector<TreeCrown> crowns = measure_crowns(owners, trees);
  ASSERT_EQ(crowns.size(), 1U);
  EXPECT_NEAR(crowns[0].base_m, 5.0, 0.26);
  const double area = M_PI * 1.6 * 1.6;
  EXPECT_NEAR(crowns[0].area_m2, area, 0.12 * area);
  EXPECT_NEAR(crowns[0].volume_m3, 5.0 * area, 0.6 * area);
}

TEST(TreeCrowns, AStemWithoutBranchesHasNone) {
  TreeOwners owners;
  add_line(owners, {0.1, 0.1, 0.3}, {0.1, 0.1, 10.0});
  const std::vector<OwnerTree> trees = {upright(0.1, 10.0), upright(9.0, 10.0)};
  owners.find(trees);
  for (const TreeCrown& crown : measure_crowns(owners, trees)) {
    EXPECT_TRUE(std::isnan(crown.base_m));
    EXPECT_TRUE(std::isnan(crown.area_m2));
    EXPECT_TRUE(std::isnan(crown.volume_m3));
  }
}

}  // namespace
}  // namespace understory
