#include "understory/forest/ground/seen_ground.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace understory {
namespace {

// A slope that falls to the east, 60 x 40 cells of half a metre.
Raster sloping_raster() {
  Raster raster;
  raster.cell_m = 0.5;
  raster.columns = 60;
  raster.rows = 40;
  raster.values.resize(60 * 40);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < 60; ++column)
      raster.values[raster.index(column, row)] = -0.15F * static_cast<float>(column);
  }
  return raster;
}

constexpr float kNoGround = std::numeric_limits<float>::quiet_NaN();

TEST(SeenGround, WhatWasSeenAsAWholeStays) {
  Raster raster = sloping_raster();
  raster.values[raster.index(30, 20)] += 0.4F;  // a stone
  const Raster before = raster;
  drop_unseen_ground(raster);
  EXPECT_EQ(raster.values, before.values);
}

// East of column 35 every third cell has a stem's lowest point, ever higher above the slope.
TEST(SeenGround, StemsBeyondItDoNotCarryTheTerrain) {
  Raster raster = sloping_raster();
  for (int row = 0; row < 40; ++row) {
    for (int column = 35; column < 60; ++column) {
      float& z = raster.values[raster.index(column, row)];
      z = (row + column) % 3 == 0 && column > 37 ? z + 0.1F * static_cast<float>(column - 33)
                                                 : kNoGround;
    }
  }
  drop_unseen_ground(raster);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < 60; ++column) {
      const bool known = std::isfinite(raster.values[raster.index(column, row)]);
      EXPECT_EQ(known, column < 35) << column << ", " << row;
    }
  }
}

// The same cells on the slope itself are ground that few beams reached.
TEST(SeenGround, ThinGroundBeyondItStays) {
  Raster raster = sloping_raster();
  for (int row = 0; row < 40; ++row) {
    for (int column = 35; column < 60; ++column) {
      if ((row + column) % 3 != 0) raster.values[raster.index(column, row)] = kNoGround;
    }
  }
  const Raster before = raster;
  drop_unseen_ground(raster);
  for (std::size_t i = 0; i < raster.values.size(); ++i)
    EXPECT_EQ(std::isfinite(raster.values[i]), std::isfinite(before.values[i])) << i;
}

TEST(SeenGround, NoGroundAtAllIsNoError) {
  Raster raster = sloping_raster();
  raster.values.assign(raster.values.size(), kNoGround);
  drop_unseen_ground(raster);
  EXPECT_TRUE(std::isnan(raster.values[0]));
}

}  // namespace
}  // namespace understory
