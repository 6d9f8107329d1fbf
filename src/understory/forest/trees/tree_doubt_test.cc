#include "understory/forest/trees/tree_doubt.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Tree tree_with_sd(double dbh_m, double dbh_sd_m, double height_m) {
  Tree tree;
  tree.dbh_m = dbh_m;
  tree.dbh_sd_m = dbh_sd_m;
  tree.height_m = height_m;
  return tree;
}

constexpr double kUnknown = Tree::kUnknown;

TEST(TreeDoubt, CountsWhatIsNotToBeTrusted) {
  const StandDoubts doubts =
      doubts_of({tree_with_sd(0.2, 0.059, 12.0), tree_with_sd(0.2, 0.061, 12.0),
                 tree_with_sd(0.3, 0.2, kUnknown), tree_with_sd(0.3, kUnknown, 9.0),
                 tree_with_sd(kUnknown, kUnknown, 20.0)});
  EXPECT_EQ(doubts.trees, 5U);
  EXPECT_EQ(doubts.diameters, 4U);
  EXPECT_EQ(doubts.weak_diameters, 2U) << "over 30 % of the diameter";
  EXPECT_EQ(doubts.without_height, 1U);
  EXPECT_EQ(doubts.by_crown, 1U);
}

TEST(TreeDoubt, QualityIsTheWorstThatIsKnownOfADiameter) {
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.01, 12.0), 200.0), "good");
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.01, kUnknown), kUnknown), "good")
      << "a height counts not";
  EXPECT_EQ(quality_of(tree_with_sd(0.2, kUnknown, 12.0), 180.0), "good");
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.01, 12.0), 179.0), "one_side");
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.01, 12.0), 100.0, 1.4), "one_side");
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.01, 12.0), 100.0, 1.6), "breast_height_hidden");
  EXPECT_EQ(quality_of(tree_with_sd(0.2, 0.061, 12.0), 100.0, 1.6), "weak_diameter");
  EXPECT_EQ(quality_of(tree_with_sd(kUnknown, kUnknown, 12.0), kUnknown), "no_diameter");
}

TEST(TreeDoubt, SortsByDiameterThenArcThenHeight) {
  const double good = doubt_of(tree_with_sd(0.3, 0.01, 20.0), 350.0);
  EXPECT_NEAR(good, 0.01 / 0.09, 1e-12);
  EXPECT_NEAR(doubt_of(tree_with_sd(0.3, 0.01, kUnknown), 350.0) - good, 0.5, 1e-12);
  EXPECT_NEAR(doubt_of(tree_with_sd(0.3, 0.01, 20.0), 90.0) - good, 0.5, 1e-12);
  EXPECT_NEAR(doubt_of(tree_with_sd(0.3, 0.01, 20.0), kUnknown), good, 1e-12);
  const double worst = doubt_of(tree_with_sd(0.1, 5.0, kUnknown), 0.0);
  EXPECT_GT(worst, doubt_of(tree_with_sd(0.1, 0.05, kUnknown), 60.0));
  EXPECT_GT(doubt_of(tree_with_sd(kUnknown, kUnknown, 20.0), kUnknown), worst);
}

}  // namespace
}  // namespace understory
