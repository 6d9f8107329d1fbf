#include "understory/georeference/coordinate_system.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

TEST(CoordinateSystem, TheUnitInThePlaneIsTold) {
  EXPECT_EQ(metres_per_unit("EPSG:25832"), 1.0);
  EXPECT_NEAR(metres_per_unit("EPSG:2276"), 0.3048006096, 1e-9);  // Texas, US survey feet
  EXPECT_EQ(metres_per_unit("EPSG:4326"), 0.0);                   // degrees
  EXPECT_TRUE(std::isnan(metres_per_unit("")));
  EXPECT_TRUE(std::isnan(metres_per_unit("no such system")));
}

}  // namespace
}  // namespace understory
