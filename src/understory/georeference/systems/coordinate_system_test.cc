#include "understory/georeference/systems/coordinate_system.h"

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

TEST(CoordinateSystem, TheWayBackEndsAtThePlace) {
  const CoordinateSystem system("EPSG:3067");
  const GeodeticPlace place{63.318, 30.193, 160.0};
  const auto back = system.to_place(*system.from_place(place));
  ASSERT_TRUE(back);
  EXPECT_NEAR(back->latitude_deg, place.latitude_deg, 1e-9);
  EXPECT_NEAR(back->longitude_deg, place.longitude_deg, 1e-9);
  EXPECT_NEAR(back->height_m, place.height_m, 1e-3);
}

}  // namespace
}  // namespace understory
