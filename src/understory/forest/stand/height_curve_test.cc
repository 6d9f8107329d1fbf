#include "understory/forest/stand/height_curve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/forest/stand/test_heights.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using test::true_height;

Tree measured_tree(double dbh_m, double height_m) {
  Tree tree;
  tree.dbh_m = dbh_m;
  tree.height_m = height_m;
  return tree;
}

TEST(HeightCurve, FindsTheCurveThatHeightsLieOn) {
  std::vector<Tree> trees = {measured_tree(0.2, NAN), measured_tree(NAN, 12.0)};
  for (int i = 0; i < 12; ++i)
    trees.push_back(measured_tree(0.06 + 0.03 * i, true_height(0.06 + 0.03 * i)));
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->trees, 12U);
  EXPECT_NEAR(curve->at(0.25), true_height(0.25), 1e-9);
  EXPECT_NEAR(curve->sd_m, 0.3, 1e-9) << "no stand is without scatter";
}

TEST(HeightCurve, ItsDeviationIsThatOfTheTrees) {
  Random random(5);
  std::vector<Tree> trees;
  for (int i = 0; i < 400; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    trees.push_back(measured_tree(dbh, true_height(dbh) + random.normal(0.0, 1.1)));
  }
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_NEAR(curve->sd_m, 1.1, 0.12);
  EXPECT_NEAR(curve->at(0.3), true_height(0.3), 0.25);
}

TEST(HeightCurve, SingleHeightsThatAreFarOffDoNotMoveIt) {
  Random random(6);
  std::vector<Tree> trees;
  for (int i = 0; i < 60; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    const double cut = i % 6 == 0 ? random.uniform(6.0, 10.0) : 0.0;  // tops that were not seen
    trees.push_back(
        measured_tree(dbh, std::max(2.0, true_height(dbh) - cut + random.normal(0.0, 0.5))));
  }
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_NEAR(curve->at(0.15), true_height(0.15), 0.4);
  EXPECT_NEAR(curve->at(0.3), true_height(0.3), 0.4);
  EXPECT_NEAR(curve->sd_m, 0.6, 0.2);
}

// A tree that took the top of its neighbour.
TEST(HeightCurve, AHeightFarAboveItHasNoSay) {
  Random random(8);
  std::vector<Tree> trees;
  for (int i = 0; i < 40; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    trees.push_back(measured_tree(dbh, true_height(dbh) + random.normal(0.0, 0.5)));
  }
  const auto without = fit_height_curve(trees);
  trees.push_back(measured_tree(0.12, true_height(0.12) + 9.0));
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(without && curve);
  EXPECT_NEAR(curve->at(0.12), without->at(0.12), 0.02);
  EXPECT_NEAR(curve->sd_m, without->sd_m, 0.05);
}

// Lower bounds of which many are right: they tell where the curve is, those far below do not.
TEST(HeightCurve, LowerBoundsCountWhereTheyEndNearTheCurve) {
  Random random(7);
  std::vector<Tree> trees;
  std::vector<Tree> right;
  for (int i = 0; i < 300; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    const double height = true_height(dbh) + random.normal(0.0, 1.0);
    const bool hidden = random.uniform(0.0, 1.0) < 0.4;
    trees.push_back(measured_tree(dbh, hidden ? height * random.uniform(0.2, 1.0) : height));
    const bool flagged = random.uniform(0.0, 1.0) < (hidden ? 0.8 : 0.5);
    trees.back().height_is_lower_bound = flagged ? 1.0 : 0.0;
    if (!hidden) right.push_back(measured_tree(dbh, height));
  }
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->trees + curve->lower_bounds, trees.size());
  EXPECT_NEAR(curve->at(0.15), true_height(0.15), 0.4);
  EXPECT_NEAR(curve->at(0.35), true_height(0.35), 0.4);
  EXPECT_NEAR(curve->sd_m, 1.0, 0.3);
}

TEST(HeightCurve, ItsOwnDeviationIsThatOfManyCurves) {
  std::vector<double> found;
  double stated = 0.0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Random random(seed);
    std::vector<Tree> trees;
    for (int i = 0; i < 30; ++i) {
      const double dbh = random.uniform(0.1, 0.3);
      trees.push_back(measured_tree(dbh, true_height(dbh) + random.normal(0.0, 1.0)));
    }
    const auto curve = fit_height_curve(trees);
    ASSERT_TRUE(curve);
    found.push_back(curve->at(0.35) - true_height(0.35));
    stated += curve->own_sd_at(0.35) / 100.0;
  }
  double squares = 0.0;
  for (const double error : found)
    squares += error * error / 100.0;
  EXPECT_NEAR(std::sqrt(squares) / stated, 1.0, 0.3);
}

TEST(HeightCurve, TheHeightOfALowerBoundIsTheMeanOfBothKinds) {
  std::vector<Tree> trees;
  for (int i = 0; i < 30; ++i)
    trees.push_back(
        measured_tree(0.1 + 0.01 * i, true_height(0.1 + 0.01 * i) + (i % 2 == 0 ? 1 : -1)));
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  const double mean = curve->at(0.2);
  for (const double bound : {mean - 4.0, mean - 2.5, mean + 1.0}) {
    double chance = 0.0;
    double first = 0.0;
    double second = 0.0;
    const auto density = [&](double h) {
      const double z = (h - mean) / curve->sd_m;
      return std::exp(-0.5 * z * z) / std::sqrt(2.0 * M_PI) / curve->sd_m;
    };
    for (double h = bound + 5e-4; h < mean + 20.0; h += 1e-3) {
      // The view may end anywhere below the curve.
      const double goes_on = (1.0 - curve->bounds_that_end) * density(h) / mean;
      chance += 1e-3 * goes_on;
      first += 1e-3 * h * goes_on;
      second += 1e-3 * h * h * goes_on;
    }
    const double ends = curve->bounds_that_end * density(bound);
    const double all = ends + chance;
    first = (first + ends * bound) / all;
    second = (second + ends * bound * bound) / all;
    const HeightAbove height = curve->above(0.2, bound);
    EXPECT_NEAR(height.height_m, first, 1e-3);
    EXPECT_NEAR(height.sd_m, std::sqrt(second - first * first), 2e-3);
  }
  EXPECT_NEAR(curve->above(0.2, 2.0).height_m, mean, 1e-6) << "a bound that tells nothing";
  EXPECT_GE(curve->above(0.2, 60.0).height_m, 60.0);
}

// A lidar that cannot look up shows the true tops of few trees, and calls many others seen.
TEST(HeightCurve, LiesAtTheTallTreesWhereMostTopsAreHidden) {
  Random random(9);
  std::vector<Tree> trees;
  for (int i = 0; i < 120; ++i) {
    const double dbh = random.uniform(0.1, 0.4);
    const double height = true_height(dbh) + random.normal(0.0, 0.8);
    const bool hidden = random.uniform(0.0, 1.0) < 0.65;
    trees.push_back(measured_tree(dbh, hidden ? height * random.uniform(0.4, 1.0) : height));
  }
  const auto curve = fit_height_curve(trees);
  ASSERT_TRUE(curve);
  for (const double dbh : {0.15, 0.25, 0.35})
    EXPECT_NEAR(curve->at(dbh) / true_height(dbh), 1.0, 0.06) << dbh;
  EXPECT_NEAR(curve->seen_that_end, 0.4, 0.15);
  EXPECT_FALSE(curve->is_likely_height(0.3, 0.7 * true_height(0.3)));
  EXPECT_TRUE(curve->is_likely_height(0.3, true_height(0.3)));
  EXPECT_TRUE(curve->is_likely_height(0.3, 1.4 * true_height(0.3))) << "too high is not hidden";
}

TEST(HeightCurve, IsNotGuessedFromFewOrEqualTrees) {
  std::vector<Tree> few(7, measured_tree(0.2, 15.0));
  few.back() = measured_tree(0.4, 22.0);
  EXPECT_FALSE(fit_height_curve(few));
  EXPECT_FALSE(fit_height_curve(std::vector<Tree>(20, measured_tree(0.2, 15.0))));
}

}  // namespace
}  // namespace understory
