#include "understory/georeference/systems/default_system.h"

#include <gtest/gtest.h>

#include "understory/georeference/systems/coordinate_system.h"

namespace understory {
namespace {

struct Town {
  const char* name;
  double latitude_deg;
  double longitude_deg;
};

TEST(DefaultSystem, FinlandHasItsOwn) {
  for (const Town& town :
       std::initializer_list<Town>{{"Helsinki", 60.17, 24.94},     {"Hanko", 59.823, 22.968},
                                   {"Mariehamn", 60.097, 19.935},  {"Utö", 59.78, 21.37},
                                   {"Vaasa", 63.096, 21.616},      {"Tornio", 65.8481, 24.1466},
                                   {"Ylitornio", 66.319, 23.672},  {"Pello", 66.776, 23.966},
                                   {"Muonio", 67.958, 23.68},      {"Karesuvanto", 68.447, 22.49},
                                   {"Kilpisjärvi", 69.047, 20.79}, {"Utsjoki", 69.908, 27.028},
                                   {"Näätämö", 69.664, 29.135},    {"Salla", 66.832, 28.667},
                                   {"Kuusamo", 65.966, 29.186},    {"Kuhmo", 64.13, 29.52},
                                   {"Ilomantsi", 62.67, 30.93},    {"Imatra", 61.19, 28.77},
                                   {"Hamina", 60.57, 27.2},        {"Evo", 61.2, 25.1}}) {
    const GeodeticPlace place{town.latitude_deg, town.longitude_deg, 100.0};
    EXPECT_EQ(default_system(place, HeightWish::kEllipsoid), "EPSG:3067") << town.name;
  }
}

TEST(DefaultSystem, NeighboursHaveTheUtmZone) {
  for (const Town& town : std::initializer_list<Town>{{"Tallinn", 59.437, 24.745},
                                                      {"Saint Petersburg", 59.93, 30.31},
                                                      {"Haparanda", 65.8355, 24.137},
                                                      {"Kirkenes", 69.727, 30.045},
                                                      {"Karasjok", 69.47, 25.51},
                                                      {"Kautokeino", 69.01, 23.04},
                                                      {"Karesuando", 68.441, 22.47},
                                                      {"Pajala", 67.21, 23.37},
                                                      {"Övertorneå", 66.388, 23.65},
                                                      {"Luleå", 65.58, 22.15},
                                                      {"Umeå", 63.83, 20.26},
                                                      {"Stockholm", 59.33, 18.07},
                                                      {"Vyborg", 60.71, 28.75},
                                                      {"Svetogorsk", 61.11, 28.88},
                                                      {"Kostomuksha", 64.59, 30.58},
                                                      {"Suursaari", 60.05, 27.0},
                                                      {"Nikel", 69.41, 30.22}}) {
    const GeodeticPlace place{town.latitude_deg, town.longitude_deg, 100.0};
    EXPECT_FALSE(is_in_finland(place)) << town.name;
    EXPECT_EQ(default_system(place, HeightWish::kEllipsoid), utm_zone(place)) << town.name;
  }
  EXPECT_EQ(default_system({-33.4, -70.6, 500.0}, HeightWish::kEllipsoid), "EPSG:32719");
}

// Understands what a grid that is not installed would do: then there is no vertical part.
TEST(DefaultSystem, HeightsAboveTheGeoidWherePROJHasTheGrid) {
  const GeodeticPlace evo{61.2, 25.1, 150.0};
  const std::string system = default_system(evo, HeightWish::kGeoid);
  EXPECT_EQ(system.rfind("EPSG:3067", 0), 0U) << system;
  if (system != "EPSG:3067") {
    const auto at = CoordinateSystem(system).from_place(evo);
    ASSERT_TRUE(at.has_value());
    EXPECT_NEAR(at->z(), 150.0 - 18.5, 1.5);  // the geoid is 18.5 m above the ellipsoid there
  }
  EXPECT_EQ(with_heights("EPSG:3067+5773", evo, HeightWish::kGeoid), "EPSG:3067+5773");
  EXPECT_EQ(with_heights("EPSG:3067", evo, HeightWish::kEllipsoid), "EPSG:3067");
}

}  // namespace
}  // namespace understory
