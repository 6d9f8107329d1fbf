#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// What stands before a stem hides its foot. Its diameter is then that of the stem above, with a
// larger deviation. What is hidden higher up may as well be a crown.
TEST(HiddenStems, AStemHiddenAroundBreastHeightIsMeasuredAbove) {
  TestPlot plot(15);
  plot.add_ground(12.0, 40);
  TestPlot::Stem stem{6.0, 6.0, 0.3};
  stem.points = 3000;
  plot.add_stem(stem);
  const auto hidden_to = [&](double top_m) {
    std::vector<Eigen::Vector3d> rest;
    for (const Eigen::Vector3d& p : plot.cloud) {
      const double height = p.z() - plot.ground(p.x(), p.y());
      if (height < 0.15 || height > top_m) rest.push_back(p);
    }
    return take_inventory(blocks_of(rest), {}).trees;
  };
  const std::vector<Tree> whole = hidden_to(0.15);
  ASSERT_EQ(whole.size(), 1U);
  const std::vector<Tree> above = hidden_to(1.8);
  ASSERT_EQ(above.size(), 1U);
  EXPECT_NEAR(above[0].dbh_m, 0.3, 2.0 * above[0].dbh_sd_m);
  EXPECT_NEAR(above[0].dbh_m, 0.3, 0.02);
  EXPECT_GT(above[0].dbh_sd_m, whole[0].dbh_sd_m);
  EXPECT_EQ(whole[0].quality, "good");
  EXPECT_EQ(above[0].quality, "breast_height_hidden");
  const std::vector<Tree> high = hidden_to(2.3);  // its deviation tells of the taper
  ASSERT_EQ(high.size(), 1U);
  EXPECT_NEAR(high[0].dbh_m, 0.3, 2.0 * high[0].dbh_sd_m);
  EXPECT_GT(high[0].dbh_sd_m, above[0].dbh_sd_m);
  // Less than a metre of it is a crown that may hang anywhere.
  for (const Tree& tree : hidden_to(2.8))
    EXPECT_TRUE(std::isnan(tree.dbh_m));
}

// A slim thing that ends where its heights are seen is a branch or a sign, not a stem.
TEST(HiddenStems, WhatHangsAndEndsIsNone) {
  for (const double top_m : {4.95, 6.0}) {
    TestPlot plot(15);
    plot.add_ground(12.0, 40);
    Random random(4);
    for (int i = 0; i < 900; ++i) {
      const double h = random.uniform(3.4, top_m);
      const double turn = random.uniform(0.0, 2.0 * M_PI);
      const double r = 0.05 + random.normal(0.0, 0.012);
      plot.cloud.emplace_back(6.0 + r * std::cos(turn), 6.0 + r * std::sin(turn),
                              plot.ground(6.0, 6.0) + h);
    }
    int stems = 0;
    for (const Tree& tree : take_inventory(blocks_of(plot.cloud), {}).trees)
      stems += std::isfinite(tree.dbh_m) ? 1 : 0;
    EXPECT_EQ(stems, top_m > 5.0 ? 1 : 0) << top_m;
  }
}

// A stem behind something shows only from 2.6 or 3.4 m on. Nothing lies below: a bush there would
// be what is seen.
TEST(HiddenStems, AStemWhoseFootIsHiddenIsListedWithWhatItsTaperMayDiffer) {
  TestPlot plot(15);
  plot.add_ground(12.0, 40);
  Random random(4);
  const auto add_piece = [&](double x, double from_m, double to_m) {
    for (int i = 0; i < 900; ++i) {
      const double h = random.uniform(from_m, to_m);
      const double turn = random.uniform(0.0, M_PI);
      const double r = 0.15 - 0.008 * (h - 1.3) + random.normal(0.0, 0.008);
      plot.cloud.emplace_back(x + 0.02 * h + r * std::cos(turn), 6.0 + r * std::sin(turn),
                              plot.ground(x, 6.0) + h);
    }
  };
  add_piece(3.0, 0.3, 6.0);
  add_piece(6.0, 2.6, 6.0);
  add_piece(9.0, 3.4, 6.0);
  const std::vector<Tree> trees = take_inventory(blocks_of(plot.cloud), {}).trees;
  ASSERT_EQ(trees.size(), 3U);
  double sd_before = 0.0;
  for (const double x : {3.0, 6.0, 9.0}) {
    const Tree* tree = nearest(trees, x, 6.0);
    ASSERT_NE(tree, nullptr) << x;
    EXPECT_NEAR(tree->dbh_m, 0.3, std::min(0.03, 2.0 * tree->dbh_sd_m)) << x;
    EXPECT_NEAR(tree->x, x, 0.05) << x;
    EXPECT_GT(tree->dbh_sd_m, sd_before) << x;
    sd_before = tree->dbh_sd_m;
  }
  // With a bush below the second and the third there is no shadow, and no stem.
  for (const double x : {6.0, 9.0})
    plot.add_bush(x, 6.0, 0.9, 4000);
  int stems = 0;
  for (const Tree& tree : take_inventory(blocks_of(plot.cloud), {}).trees)
    stems += std::isfinite(tree.dbh_m) ? 1 : 0;
  EXPECT_EQ(stems, 1);
}

}  // namespace
}  // namespace understory
