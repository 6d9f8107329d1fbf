#include "understory/geometry/raster.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// Ground that rises by 1 m from each column to the next, 200 m above the sea.
Raster slope() {
  Raster ground;
  ground.x0 = 10.0;
  ground.columns = 3;
  ground.rows = 2;
  ground.z0 = 200.0;
  ground.values = {0.0F, 1.0F, 2.0F, 0.0F, 1.0F, 2.0F};
  return ground;
}

TEST(Raster, HeightsAboveTheGroundAreRaisedByIt) {
  Raster canopy;
  canopy.x0 = 10.5;
  canopy.cell_m = 0.5;
  canopy.columns = 3;
  canopy.rows = 1;
  canopy.values = {20.0F, kUnknown, 0.0F};
  const Raster surface = absolute_heights(slope(), canopy);
  EXPECT_EQ(surface.x0, 10.5);
  EXPECT_EQ(surface.cell_m, 0.5);
  EXPECT_NEAR(surface.cell_value(10.75, 0.25), 220.25, 1e-5) << "the slope between two centres";
  EXPECT_TRUE(std::isnan(surface.cell_value(11.25, 0.25)));
  EXPECT_NEAR(surface.cell_value(11.75, 0.25), 201.25, 1e-5);
}

TEST(Raster, WhereTheGroundIsNotKnownTheSurfaceIsNotEither) {
  Raster ground = slope();
  ground.values.assign(6, kUnknown);
  Raster canopy = slope();
  canopy.z0 = 0.0;
  for (const float value : absolute_heights(ground, canopy).values)
    EXPECT_TRUE(std::isnan(value));
}

}  // namespace
}  // namespace understory
