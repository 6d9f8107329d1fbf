#include "understory/forest/ground/canopy.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

TEST(CanopyGrid, EachCellHasItsHighestPoint) {
  CanopyGrid grid(0.5);
  grid.add({0.1, 0.1}, 3.0);
  grid.add({0.2, 0.3}, 12.5);
  grid.add({0.3, 0.2}, 7.0);
  grid.add({-0.1, 1.1}, 0.0);
  const Raster canopy = grid.raster(1000.0, 2000.0);
  EXPECT_EQ(canopy.cell_m, 0.5);
  EXPECT_FLOAT_EQ(static_cast<float>(canopy.cell_value(1000.25, 2000.25)), 12.5F);
  EXPECT_EQ(canopy.cell_value(999.75, 2001.25), 0.0) << "ground is a height, too";
  EXPECT_TRUE(std::isnan(canopy.cell_value(999.75, 2000.25))) << "nothing was seen there";
}

// A crown up to 18 m, and a ghost of another pulse far above it.
TEST(CanopyCeiling, HoldsACrownAndNotAGhostAbove) {
  CanopyCeiling ceiling;
  const Eigen::Vector2d place(5.0, 5.0);
  for (int i = 0; i < 1800; ++i)
    ceiling.count(place, 0.01 * i);
  ceiling.count(place, 41.5);
  ceiling.count({25.0, 5.0}, 0.5);  // open ground
  ceiling.settle();
  EXPECT_TRUE(ceiling.holds(place, 0.0));
  EXPECT_TRUE(ceiling.holds(place, 17.9));
  EXPECT_FALSE(ceiling.holds(place, 41.5));
  EXPECT_FALSE(ceiling.holds({25.0, 5.0}, 17.0)) << "each square has its own";
  EXPECT_FALSE(ceiling.holds({100.0, 5.0}, 1.0)) << "nothing was counted there";
}

}  // namespace
}  // namespace understory
