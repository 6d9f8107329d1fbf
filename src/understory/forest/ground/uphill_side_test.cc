#include "understory/forest/ground/uphill_side.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace understory {
namespace {

// 20 x 20 cells of half a metre that rise by `slope` to the north.
Raster hillside(double slope) {
  Raster terrain;
  terrain.cell_m = 0.5;
  terrain.columns = terrain.rows = 20;
  terrain.z0 = 100.0;
  for (int row = 0; row < terrain.rows; ++row) {
    for (int column = 0; column < terrain.columns; ++column)
      terrain.values.push_back(static_cast<float>(slope * (row + 0.5) * terrain.cell_m));
  }
  return terrain;
}

TEST(UphillSide, RisesWithSlopeAndRadius) {
  EXPECT_NEAR(uphill_rise_m(hillside(0.4), {5.0, 5.0}, 0.25), 0.1, 1e-4);
  EXPECT_NEAR(uphill_rise_m(hillside(0.4), {5.0, 5.0}, 0.1), 0.04, 1e-4);
  EXPECT_NEAR(uphill_rise_m(hillside(-0.4), {5.0, 5.0}, 0.25), 0.1, 1e-4);
}

TEST(UphillSide, IsTheAxisWhereTheGroundIsEvenOrUnknown) {
  EXPECT_EQ(uphill_rise_m(hillside(0.0), {5.0, 5.0}, 0.25), 0.0);
  Raster unknown = hillside(0.4);
  for (float& value : unknown.values)
    value = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(uphill_rise_m(unknown, {5.0, 5.0}, 0.25), 0.0);
}

}  // namespace
}  // namespace understory
