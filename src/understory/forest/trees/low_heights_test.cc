#include "understory/forest/trees/low_heights.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

// Stems alone, as dense at all heights.
LowHeights stems_up_to(double end_m) {
  LowHeights heights;
  for (int i = 0; i < 10'000; ++i)
    heights.add(end_m * i / 10'000.0);
  return heights;
}

TEST(LowHeights, ACutEndsSuddenly) {
  EXPECT_TRUE(stems_up_to(1.8).end_in_a_cut());
  EXPECT_TRUE(stems_up_to(3.55).end_in_a_cut());
  EXPECT_FALSE(stems_up_to(8.0).end_in_a_cut());
}

TEST(LowHeights, YoungTreesThinOutToTheirTops) {
  LowHeights heights;
  for (int tree = 0; tree < 30; ++tree) {
    const double top = 2.0 + 0.05 * tree;
    for (int i = 0; i < 1'000; ++i) {
      const double u = i / 1'000.0;
      heights.add(top * (1.0 - std::sqrt(1.0 - u)));  // ever fewer
    }
  }
  EXPECT_FALSE(heights.end_in_a_cut());
}

TEST(LowHeights, AFewGhostsAboveACutAreNoTrees) {
  LowHeights heights = stems_up_to(3.0);
  for (int i = 0; i < 5; ++i)
    heights.add(20.0);
  EXPECT_TRUE(heights.end_in_a_cut());
  LowHeights crowns;
  for (int i = 0; i < 500; ++i)
    crowns.add(12.0);
  heights.add(crowns);
  EXPECT_FALSE(heights.end_in_a_cut());
}

}  // namespace
}  // namespace understory
