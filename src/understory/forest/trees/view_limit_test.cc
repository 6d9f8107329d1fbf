#include "understory/forest/trees/view_limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "understory/util/random.h"

namespace understory {
namespace {

// A stand of 200 trees of 15 m and less, to 40 m from the path. From 1 m above the ground the
// scanner sees up by the slope.
struct Stand {
  std::vector<TreeInView> trees;
  std::vector<double> true_heights;

  explicit Stand(double slope) {
    Random random(5);
    for (int i = 0; i < 200; ++i) {
      const double dbh = random.uniform(0.06, 0.3);
      const double height = 15.0 * std::sqrt(dbh / 0.3) + random.normal(0.0, 0.7);
      const double away = random.uniform(1.0, 40.0);
      const double seen = 1.0 + slope * away + random.normal(0.0, 0.3);
      trees.push_back({std::min(height, seen), dbh, away});
      true_heights.push_back(height);
    }
  }
};

TEST(ViewLimit, ASteepViewLeavesHeightsAsTheyAre) {
  const Stand stand(20.0);
  const std::vector<char> ends = ends_with_the_view(stand.trees);
  EXPECT_EQ(std::count(ends.begin(), ends.end(), 1), 0);
}

TEST(ViewLimit, AFlatViewCutsTheTreesBesideThePath) {
  const Stand stand(0.4);
  const std::vector<char> ends = ends_with_the_view(stand.trees);
  int low = 0;
  int low_and_told = 0;
  int right = 0;
  int right_and_told = 0;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const bool is_low = stand.trees[i].height_m < stand.true_heights[i] - 1.0;
    (is_low ? low : right) += 1;
    (is_low ? low_and_told : right_and_told) += ends[i];
  }
  EXPECT_GT(low, 60);
  EXPECT_GT(low_and_told, 0.8 * low);
  // Near its end the view shows tops, too.
  EXPECT_LT(right_and_told, 0.4 * right);
}

TEST(ViewLimit, TreesThatEndFarBelowTheViewAreComplete) {
  Stand stand(0.4);
  // 10 m from the path the view ends at 5 m.
  const std::size_t first = stand.trees.size();
  for (int i = 0; i < 5; ++i)
    stand.trees.push_back({1.5, 0.06, 10.0 + 0.1 * i});
  stand.trees.push_back({4.8, 0.2, 10.0});
  const std::vector<char> ends = ends_with_the_view(stand.trees);
  for (std::size_t i = first; i + 1 < ends.size(); ++i)
    EXPECT_EQ(ends[i], 0) << i;
  EXPECT_EQ(ends.back(), 1);
}

TEST(ViewLimit, FewTreesAndUnknownOnesTellNothing) {
  Stand stand(0.4);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  std::vector<TreeInView> few(stand.trees.begin(), stand.trees.begin() + 50);
  const std::vector<char> of_few = ends_with_the_view(few);
  EXPECT_EQ(std::count(of_few.begin(), of_few.end(), 1), 0);
  const std::vector<char> before = ends_with_the_view(stand.trees);
  stand.trees.push_back({unknown, 0.2, 2.0});
  stand.trees.push_back({8.0, unknown, 2.0});
  std::vector<char> after = ends_with_the_view(stand.trees);
  EXPECT_EQ(after.back(), 0);
  after.resize(before.size());
  EXPECT_EQ(after, before);
  EXPECT_TRUE(ends_with_the_view({}).empty());
}

}  // namespace
}  // namespace understory
