#include "understory/forest/stand/height_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

Tree tree_of(double dbh_m, double height_m) {
  Tree tree;
  tree.dbh_m = dbh_m;
  tree.height_m = height_m;
  return tree;
}

// In Naeslund's own units: 1.3 + d^2 / (1.2 + 0.19 d)^2, d in cm.
double true_height(double dbh_m) {
  const double d = 100.0 * dbh_m;
  return 1.3 + d * d / std::pow(1.2 + 0.19 * d, 2);
}

TEST(HeightCurve, FindsTheCurveThatHeightsLieOn) {
  std::vector<Tree> trees = {tree_of(0.2, NAN), tree_of(NAN, 12.0)};
  for (int i = 0; i < 12; ++i)
    trees.push_back(tree_of(0.06 + 0.03 * i, true_height(0.06 + 0.03 * i)));
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->trees, 12U);
  EXPECT_NEAR(curve->at(0.25), true_height(0.25), 1e-9);
  EXPECT_NEAR(curve->sd_m, 0.0, 1e-9);
}

TEST(HeightCurve, ItsDeviationIsThatOfTheTrees) {
  Random random(5);
  std::vector<Tree> trees;
  for (int i = 0; i < 400; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    trees.push_back(tree_of(dbh, true_height(dbh) + random.normal(0.0, 1.1)));
  }
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_NEAR(curve->sd_m, 1.1, 0.12);
  EXPECT_NEAR(curve->at(0.3), true_height(0.3), 0.25);
}

TEST(HeightCurve, IsNotGuessedFromFewOrEqualTrees) {
  std::vector<Tree> few(7, tree_of(0.2, 15.0));
  few.back() = tree_of(0.4, 22.0);
  EXPECT_FALSE(fit_height_curve(few));
  EXPECT_FALSE(fit_height_curve(std::vector<Tree>(20, tree_of(0.2, 15.0))));
}

}  // namespace
}  // namespace understory
