#include "understory/forest/stand/expected_diameters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "understory/forest/stand/height_curve.h"
#include "understory/forest/stand/stand_trees.h"
#include "understory/forest/stand/test_heights.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using test::true_height;

// 60 sure stems whose tops were not seen, and 200 far ones with height, whose diameters are 4 cm
// off.
std::vector<Tree> stand_with_noisy_far_stems(std::vector<double>& true_dbh_m) {
  Random random(3);
  std::vector<Tree> trees;
  for (int i = 0; i < 260; ++i) {
    const double dbh = std::max(0.1, random.normal(0.25, 0.05));
    const bool far = i >= 60;
    Tree tree;
    tree.dbh_sd_m = far ? 0.04 : 0.004;
    tree.dbh_m = std::max(0.05, dbh + random.normal(0.0, tree.dbh_sd_m));
    tree.height_m = far ? true_height(dbh) + random.normal(0.0, 0.5) : NAN;
    trees.push_back(tree);
    true_dbh_m.push_back(dbh);
  }
  return trees;
}

TEST(ExpectedDiameters, LieBetweenTheMeasuredOneAndTheMeanOfTheSureStems) {
  std::vector<double> truth;
  const std::vector<Tree> trees = stand_with_noisy_far_stems(truth);
  const std::vector<double> expected = expected_diameters(trees, 0.05);
  ASSERT_EQ(expected.size(), trees.size());
  double measured = 0.0;
  double better = 0.0;
  for (std::size_t i = 60; i < trees.size(); ++i) {
    measured += std::pow(trees[i].dbh_m - truth[i], 2);
    better += std::pow(expected[i] - truth[i], 2);
  }
  // 1 / (1 / 4^2 + 1 / 5^2) = 9.8 cm2 instead of 16.
  EXPECT_NEAR(better / measured, 9.8 / 16.0, 0.1);
  EXPECT_NEAR(expected[0], trees[0].dbh_m, 0.002) << "a sure one stays";
}

TEST(ExpectedDiameters, StayAsMeasuredWhereFewStemsAreSureOrNothingIsKnown) {
  std::vector<double> truth;
  std::vector<Tree> trees = stand_with_noisy_far_stems(truth);
  trees.erase(trees.begin(), trees.begin() + 50);
  trees[20].dbh_sd_m = NAN;
  trees[21].dbh_m = NAN;
  const std::vector<double> expected = expected_diameters(trees, 0.05);
  EXPECT_EQ(expected[15], trees[15].dbh_m);
  EXPECT_EQ(expected[20], trees[20].dbh_m);
  EXPECT_TRUE(std::isnan(expected[21]));
  EXPECT_TRUE(expected_diameters({}, 0.05).empty());
}

TEST(ExpectedDiameters, KeepTheHeightCurveSteep) {
  std::vector<double> truth;
  const std::vector<Tree> trees = stand_with_noisy_far_stems(truth);
  const auto flat = fit_height_curve(trees);
  const StandTrees stand = stand_trees(trees, {});
  ASSERT_TRUE(flat && stand.curve);
  const auto rise = [](const HeightCurve& curve) { return curve.at(0.33) - curve.at(0.17); };
  const double wanted = true_height(0.33) - true_height(0.17);
  EXPECT_LT(rise(*flat), 0.7 * wanted);
  EXPECT_NEAR(rise(*stand.curve), wanted, 0.2 * wanted);
  // A tree without a height gets that of its expected diameter.
  EXPECT_NEAR(stand.trees[0].height_m.value, true_height(truth[0]), 0.5);
}

}  // namespace
}  // namespace understory
