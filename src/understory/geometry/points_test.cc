#include "understory/geometry/points.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Points numbered(std::size_t n) {
  Points points;
  for (std::size_t i = 0; i < n; ++i)
    points.emplace_back(static_cast<float>(i), 0.0F, 0.0F);
  return points;
}

TEST(ThinEvenly, LeavesFewPointsAlone) {
  EXPECT_EQ(thin_evenly(numbered(199), 100, 4).size(), 199U);
  EXPECT_TRUE(thin_evenly({}, 100, 4).empty());
}

TEST(ThinEvenly, KeepsEnoughAndNeverDropsMoreThanItMay) {
  EXPECT_EQ(thin_evenly(numbered(200), 100, 4).size(), 100U);
  EXPECT_EQ(thin_evenly(numbered(399), 100, 4).size(), 133U);
  EXPECT_EQ(thin_evenly(numbered(100000), 100, 4).size(), 25000U);
}

TEST(ThinEvenly, TakesThemAtEqualSteps) {
  const Points thinned = thin_evenly(numbered(1000), 100, 4);
  for (std::size_t i = 0; i < thinned.size(); ++i)
    EXPECT_EQ(thinned[i].x(), static_cast<float>(4 * i));
}

}  // namespace
}  // namespace understory
