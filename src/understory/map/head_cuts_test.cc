#include "understory/map/head_cuts.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

class HeadCuts : public ::testing::Test {
 protected:
  HeadCuts() {
    for (int i = 0; i < 100; ++i) {
      views.emplace_back();
      views.back().stamp = from_seconds(10.0 * i);
    }
  }
  void add_tree(double x, double y, int last_view) {
    trees.emplace_back();
    trees.back().point_in_world = {x, y, 0.3};
    trees.back().last_view = last_view;
  }
  std::vector<CutTree> matched(const std::vector<HeadCut>& cuts) const {
    return match_cuts(cuts, trees, felled, views, {});
  }

  std::vector<StemView> views;
  std::vector<MappedStem> trees;
  std::vector<FelledTree> felled;
};

TEST_F(HeadCuts, AreOfTheNearestTreeThatStoodNoLonger) {
  add_tree(0.0, 0.0, 99);  // nearest to the cut, but it stands to the end
  add_tree(0.9, 0.0, 40);
  add_tree(5.0, 0.0, 40);
  const auto found = matched({{from_seconds(400.0), {0.3, 0.1, 5.0}}});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].tree, 1);
  EXPECT_NEAR(found[0].distance_m, std::hypot(0.6, 0.1), 1e-9);
  EXPECT_EQ(matched({{from_seconds(200.0), {0.9, 0.0, 0.0}}})[0].tree, -1);  // seen long after it
}

// What is seen at a felled tree's place later, of another tree or of nothing, does not save it.
TEST_F(HeadCuts, WhatTheViewsMissedIsGone) {
  add_tree(0.0, 0.0, 99);
  EXPECT_EQ(matched({{from_seconds(400.0), {0.2, 0.0, 0.0}}})[0].tree, -1);
  felled.push_back({0, 38, 42, 30});
  EXPECT_EQ(matched({{from_seconds(400.0), {0.2, 0.0, 0.0}}})[0].tree, 0);
}

TEST_F(HeadCuts, TakeATreeOnce) {
  add_tree(0.0, 0.0, 40);
  add_tree(0.8, 0.0, 40);
  const auto found =
      matched({{from_seconds(395.0), {0.3, 0.0, 0.0}}, {from_seconds(400.0), {0.1, 0.0, 0.0}}});
  EXPECT_EQ(found[0].tree, 1);
  EXPECT_EQ(found[1].tree, 0);
}

}  // namespace
}  // namespace understory
