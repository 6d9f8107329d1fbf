#include "understory/forest/trees/tree_heights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/random.h"

namespace understory {
namespace {

StemFit stem_with_slope(double x, double y, double slope = 0.0) {
  StemFit stem;
  stem.centre = {x, y};
  stem.slope = {slope, 0.0};
  return stem;
}

// A crown of full metres over a place.
void add_crown(TreeColumns& columns, double x, double y, double from_m, double to_m) {
  for (double height = from_m; height <= to_m + 1e-9; height += 0.05)
    columns.add({x + 0.3 * std::sin(40.0 * height), y, height}, height);
}

TEST(TreeHeights, ATreeEndsAtItsHighestPoint) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(6.0, 0.0)};
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 18.35);
  add_crown(columns, 6.0, 0.0, 1.0, 11.0);
  EXPECT_NEAR(columns.top(0, 3.5), 18.35, 0.06);
  EXPECT_NEAR(columns.top(1, 3.5), 11.0, 0.06);
}

TEST(TreeHeights, ACrownOfTheNeighbourIsItsOwn) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(2.0, 0.0)};
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 9.0);
  add_crown(columns, 1.5, 0.0, 1.0, 20.0);  // nearer to the second stem
  EXPECT_NEAR(columns.top(0, 3.5), 9.0, 0.06);
  EXPECT_NEAR(columns.top(1, 3.5), 20.0, 0.06);
}

TEST(TreeHeights, ALeaningTreeIsFollowedToItsCrown) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0, 0.25)};
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  for (double height = 1.0; height <= 14.0; height += 0.05)
    columns.add({stem_place_at(stems[0], height).x(), 0.0, height}, height);
  EXPECT_NEAR(columns.top(0, 3.5), 14.0, 0.06);
  EXPECT_NEAR(stem_place_at(stems[0], 3.3).x(), 0.5, 1e-12);
  // Trees straighten: the lean of the foot is carried up by six metres.
  EXPECT_NEAR(stem_place_at(stems[0], 30.0).x(), 1.5, 1e-12);
}

// A thin tree of 8 m below the crown of a neighbour 2 m away, which begins at 7 m and reaches over
// it. Top of the thin tree.
double top_below_a_crown(double radius_m, double neighbour_radius_m, double crown_from_axis_m) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(2.0, 0.0)};
  stems[0].radius_m = radius_m;
  stems[1].radius_m = neighbour_radius_m;
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 8.0);
  add_crown(columns, crown_from_axis_m + 0.3, 0.0, 7.0, 15.0);
  add_crown(columns, 2.0, 0.0, 1.0, 15.0);
  return columns.top(0, 3.5);
}

TEST(TreeHeights, AThinTreeEndsBelowTheCrownOfAThickerNeighbour) {
  EXPECT_NEAR(top_below_a_crown(0.04, 0.10, 0.45), 8.0, 0.1);
}

TEST(TreeHeights, ACrownAboveATreeAsThickAsItsNeighboursIsItsOwn) {
  EXPECT_NEAR(top_below_a_crown(0.06, 0.06, 0.45), 15.0, 0.1);
}

TEST(TreeHeights, PointsAtTheAxisOfATreeAreItsOwn) {
  EXPECT_NEAR(top_below_a_crown(0.04, 0.10, 0.05), 15.0, 0.1);
}

TEST(TreeHeights, ATreeBelowANeighbourDoesNotBecomeStout) {
  // A stem of 17 cm that ends at 8 m has 47 times its diameter: its crown forks.
  EXPECT_NEAR(top_below_a_crown(0.085, 0.15, 0.45), 15.0, 0.1);
  EXPECT_NEAR(top_below_a_crown(0.075, 0.15, 0.45), 8.0, 0.1);
}

TEST(TreeHeights, ACrownThatGoesOnAtTheAxisBehindAGapIsItsOwn) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(2.0, 0.0)};
  stems[0].radius_m = 0.04;
  stems[1].radius_m = 0.10;
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 8.0);
  add_crown(columns, 0.0, 0.0, 9.0, 15.0);
  add_crown(columns, 0.8, 0.0, 7.0, 15.0);
  EXPECT_NEAR(columns.top(0, 3.5), 15.0, 0.1);
}

TEST(TreeHeights, AHighTreeThatBendsKeepsItsTop) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(3.0, 0.0)};
  stems[0].radius_m = 0.15;
  stems[1].radius_m = 0.25;
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 18.8);
  add_crown(columns, 0.8, 0.0, 17.0, 20.0);
  EXPECT_NEAR(columns.top(0, 3.5), 20.0, 0.1);
}

TEST(TreeHeights, FewPointsAtTheAxisDoNotEndATree) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(2.0, 0.0)};
  stems[0].radius_m = 0.03;
  stems[1].radius_m = 0.10;
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  for (double height = 1.0; height <= 12.0; height += 0.9)  // as a sparse lidar shows them
    columns.add({0.1, 0.0, height}, height);
  add_crown(columns, 0.8, 0.0, 5.0, 12.0);
  EXPECT_NEAR(columns.top(0, 3.5), 12.0, 0.1);
}

TEST(TreeHeights, OnlyPointsAtTheAxisTellWhetherATreeBelowANeighbourGoesOn) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(2.0, 0.0)};
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.8, 0.0, 8.0, 15.0);
  EXPECT_GT(columns.points_above(0, 8.0, 40), 20);
  EXPECT_EQ(columns.points_above(0, 8.0, 40, true), 0);
}

TEST(TreeHeights, NoTopIsInvented) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(10.0, 0.0),
                                      stem_with_slope(20.0, 0.0)};
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 1.0, 3.5);   // nothing above the slices
  add_crown(columns, 10.0, 0.0, 1.0, 4.4);  // cut off just above them
  add_crown(columns, 20.0, 0.0, 1.0, 6.0);
  add_crown(columns, 20.0, 0.0, 12.0, 15.0);  // of a tree behind: there is a gap
  EXPECT_TRUE(std::isnan(columns.top(0, 3.5)));
  EXPECT_TRUE(std::isnan(columns.top(1, 3.5)));
  EXPECT_NEAR(columns.top(2, 3.5), 6.0, 0.06);
}

TEST(TreeHeights, AThinTreeMayEndBelowTheSlicesOfACloudThatShowsAllHeights) {
  std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0), stem_with_slope(10.0, 0.0),
                                stem_with_slope(20.0, 0.0), stem_with_slope(30.0, 0.0),
                                stem_with_slope(40.0, 0.0)};
  for (StemFit& stem : stems) {
    stem.radius_m = 0.02;
    stem.in_foliage = true;
    stem.lowest_m = 0.6;
  }
  stems[3].in_foliage = false;
  stems[4].in_foliage = false;
  TreeColumns columns(stems, std::vector<double>(stems.size(), 0.0));
  add_crown(columns, 0.0, 0.0, 0.6, 2.63);
  add_crown(columns, 10.0, 0.0, 0.6, 3.1);
  add_crown(columns, 10.0, 0.0, 4.1, 14.0);  // a tree above it
  add_crown(columns, 20.0, 0.0, 0.6, 9.0);
  add_crown(columns, 30.0, 0.0, 0.6, 4.2);
  add_crown(columns, 40.0, 0.0, 0.6, 3.9);
  add_crown(columns, 40.0, 0.0, 5.1, 9.0);  // a part of the stem was not seen
  const std::vector<double> tops = {2.63, 3.1, 9.0, 4.2, 9.0};
  for (std::size_t i = 0; i < tops.size(); ++i)
    EXPECT_NEAR(columns.top(i, 3.5, true), tops[i], 0.06) << i;
  EXPECT_TRUE(std::isnan(columns.top(0, 3.5)));
  stems[3].radius_m = 0.1;  // no thick tree is so low
  EXPECT_TRUE(std::isnan(columns.top(3, 3.5, true)));
}

// A point of the crown a metre down a slope of 27 degrees stands 50 cm higher over its own ground.
TEST(TreeHeights, OnASlopeTheyCountFromTheFootOfTheTree) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0)};
  TreeColumns columns(stems, {100.0});
  for (double z = 101.0; z <= 112.0 + 1e-9; z += 0.05) {
    columns.add({0.0, 0.0, z}, z - 100.0);
    columns.add({1.0, 0.0, z}, z - 99.5);
  }
  EXPECT_NEAR(columns.top(0, 3.5), 12.0, 1e-4);
}

TEST(TreeHeights, PointsBelowATopAreCountedToHalfAMetre) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0)};
  TreeColumns columns(stems, {0.0});
  for (const double height : {5.0, 9.48, 9.62, 9.75, 10.04})
    columns.add({0.0, 0.0, height}, height);
  EXPECT_EQ(columns.points_below(0, 10.04, 5), 3);
  for (int i = 0; i < 1000; ++i)
    columns.add({0.0, 0.0, 10.0}, 10.0);
  EXPECT_EQ(columns.points_below(0, 10.04, 1), 255);
}

TEST(TreeHeights, PointsAboveATopAreCounted) {
  const std::vector<StemFit> stems = {stem_with_slope(0.0, 0.0)};
  TreeColumns columns(stems, {0.0});
  for (const double height : {9.95, 10.04, 10.12, 13.9, 14.05, 14.15, 70.0, 80.0})
    columns.add({0.0, 0.0, height}, height);
  EXPECT_EQ(columns.points_above(0, 10.04, 40), 3);  // not its own decimetre, and up to 14.1 m
  EXPECT_EQ(columns.points_above(0, 10.04, 39), 2);
  EXPECT_EQ(columns.points_above(0, 62.0, 80), 2);  // all above the last metre
  EXPECT_EQ(columns.points_above(0, 90.0, 80), 0);
}

// Defect: a crown that thins out upwards, as ever fewer beams reach it, was cut where ghosts would
// begin, and called seen to its top. Ghosts fill the sky far above as well.
TEST(TreeHeights, ATreeThatGoesOnInAFewPointsIsALowerBound) {
  const auto bound_with = [](const std::vector<double>& beyond, int ghosts) {
    TestPlot plot(29);
    plot.add_ground(20.0, 40);
    plot.add_stem({4.0, 10.0, 0.3});
    const double ground = plot.ground(4.0, 10.0);
    for (const double height : beyond)
      plot.cloud.emplace_back(4.0, 10.0, ground + height);
    for (int i = 0; i < ghosts; ++i)
      plot.cloud.emplace_back(4.2, 10.0, ground + 23.5 + 7.0 * i / ghosts);
    const Lookouts lookouts = [](const Eigen::Vector3d&) {
      return std::vector<Eigen::Vector3d>{{15.0, 10.0, 101.0}};
    };
    const InventoryResult result =
        take_inventory(blocks_of(plot.cloud), basic_inventory(), {}, lookouts);
    const Tree* tree = nearest(result.trees, 4.0, 10.0);
    if (tree == nullptr) return -1.0;
    EXPECT_NEAR(tree->height_m, 15.0, 0.3);
    return tree->height_is_lower_bound;
  };
  const std::vector<double> thinning = {15.3, 15.5, 15.7, 15.9, 16.3, 16.6, 16.9, 17.3, 17.7, 18.5};
  EXPECT_EQ(bound_with({}, 0), 0.0);
  EXPECT_EQ(bound_with({16.6}, 0), 0.0);  // a stray
  EXPECT_EQ(bound_with(thinning, 0), 1.0);
  EXPECT_EQ(bound_with(thinning, 20), 0.0);
}

// A second crown stands between the scanner and the top of the first tree.
TEST(TreeHeights, ATopBehindACrownIsALowerBound) {
  TestPlot plot(29);
  plot.add_ground(20.0, 40);
  plot.add_stem({4.0, 10.0, 0.3});
  plot.add_stem({14.0, 10.0, 0.3});
  Random random(30);
  for (int i = 0; i < 4000; ++i)
    plot.cloud.emplace_back(random.uniform(6.0, 18.0), random.uniform(8.0, 12.0),
                            plot.ground(10.0, 10.0) + random.uniform(14.5, 22.0));
  const auto seen_from = [&](double height_m) {
    const Lookouts lookouts = [&](const Eigen::Vector3d& place) {
      // The view ends above the first top where nothing is in the way.
      const bool low = place.z() < plot.ground(4.0, 10.0) + 15.0;
      std::vector<Eigen::Vector3d> from = {{21.0, 10.0, 100.0 + height_m}};
      if (low) from.push_back({-16.0, 10.0, 101.0});
      return from;
    };
    const InventoryResult result =
        take_inventory(blocks_of(plot.cloud), basic_inventory(), {}, lookouts);
    const Tree* tree = nearest(result.trees, 4.0, 10.0);
    return tree == nullptr ? Tree() : *tree;
  };
  const Tree over = seen_from(80.0);  // the other crown
  EXPECT_EQ(over.height_is_lower_bound, 0.0);
  EXPECT_NEAR(over.height_sd_m, 1.0, 0.05);  // from afar: poorly seen
  const Tree through = seen_from(16.5);
  EXPECT_EQ(through.height_is_lower_bound, 1.0);
  EXPECT_NEAR(through.height_sd_m, 2.0, 0.05);
}

}  // namespace
}  // namespace understory
