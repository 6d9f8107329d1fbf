#include "understory/forest/ground/unseen_ground.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace understory {
namespace {

// Waves of that height, 40 x 30 m in cells of half a metre, seen but for a square of 8 m.
Raster waves_with_a_gap(double height_m) {
  Raster raster;
  raster.x0 = 100.0;
  raster.cell_m = 0.5;
  raster.columns = 80;
  raster.rows = 60;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const bool gap = column >= 40 && column < 56 && row >= 20 && row < 36;
      const double z = 0.2 * column + height_m * std::sin(0.4 * column) * std::cos(0.3 * row);
      raster.values.push_back(gap ? std::numeric_limits<float>::quiet_NaN()
                                  : static_cast<float>(z));
    }
  }
  return raster;
}

TEST(UnseenGround, IsSureWhereItWasSeenAndLessSoFartherAway) {
  const UnseenGround ground(waves_with_a_gap(0.3));
  EXPECT_EQ(ground.sd_m(105.0, 5.0), 0.0);
  const double border = ground.sd_m(120.25, 14.25);
  const double middle = ground.sd_m(123.75, 14.25);
  EXPECT_GT(border, 0.0);
  EXPECT_NEAR(middle / border, 8.0, 1e-9);  // 4 m and half a metre
}

TEST(UnseenGround, IsAsUnsureAsTheGroundIsRough) {
  const double low = UnseenGround(waves_with_a_gap(0.1)).sd_m(123.75, 14.25);
  EXPECT_NEAR(UnseenGround(waves_with_a_gap(0.3)).sd_m(123.75, 14.25), 3.0 * low, 1e-3);
  // A slope is not rough.
  EXPECT_LT(UnseenGround(waves_with_a_gap(0.0)).sd_m(123.75, 14.25), 1e-4);
}

// Across the grid as along it: the corner of a ring is farther than its side.
TEST(UnseenGround, TakesTheNearestSeenCellInAnyDirection) {
  Raster raster = waves_with_a_gap(0.3);
  raster.values[raster.index(48, 24)] = 9.0F;  // one seen cell within the gap
  const UnseenGround ground(raster);
  const double side = ground.sd_m(124.25, 13.25) / 2.0;  // two cells north of it
  EXPECT_NEAR(ground.sd_m(125.25, 13.25) / side, std::hypot(2.0, 2.0), 1e-9);
}

TEST(UnseenGround, NothingSeenTellsNothing) {
  EXPECT_EQ(UnseenGround().sd_m(1.0, 2.0), 0.0);
  Raster few = waves_with_a_gap(0.3);
  few.columns = few.rows = 2;
  few.values.resize(4);
  EXPECT_EQ(UnseenGround(few).roughness_m(), 0.0);
}

}  // namespace
}  // namespace understory
