#include "understory/forest/trees/occupied_space.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

constexpr double kThrough = forest_constants::sight_lines::kThroughMetre;

// A wall of 3 x 3 columns of 1 m, from 4 to 8 m above the ground, around (10, 0.5).
OccupiedSpace crown() {
  OccupiedSpace space;
  for (double x = 9.5; x < 12.0; x += 1.0) {
    for (double y = -0.5; y < 2.0; y += 1.0) {
      for (double up = 4.5; up < 8.0; up += 1.0)
        space.add({x, y}, up);
    }
  }
  return space;
}

TEST(SightLines, EachOccupiedMetreStopsAShareOfTheBeam) {
  const SightLines sight(crown());
  const PlaceAbove low{{0.5, 0.5}, 2.0};
  EXPECT_DOUBLE_EQ(sight.clear_share(low, {{20.5, 0.5}, 2.0}), 1.0);  // below it
  // Level through three cubes.
  EXPECT_NEAR(sight.clear_share({{0.5, 0.5}, 6.0}, {{20.5, 0.5}, 6.0}), std::pow(kThrough, 3.0),
              1e-12);
  // Upwards: at x = 9.5, 10.5 and 11.5 the beam is 8.3, 9 and 9.7 m high, and free.
  EXPECT_DOUBLE_EQ(sight.clear_share(low, {{20.5, 0.5}, 16.0}), 1.0);
  // The cube of the target itself and that of its last metre count for nothing.
  EXPECT_NEAR(sight.clear_share({{0.5, 0.5}, 6.0}, {{10.5, 0.5}, 6.0}), 1.0, 1e-12);
}

TEST(SightLines, AViewFallsWithTheSquareOfTheDistance) {
  const SightLines sight(crown());
  const PlaceAbove top{{0.5, 20.5}, 12.0};
  const PlaceAbove near{{0.5, 10.5}, 12.0};
  const PlaceAbove far{{20.5, 20.5}, 12.0};
  EXPECT_NEAR(sight.view_of(top, {near}), 1.0, 1e-12);
  EXPECT_NEAR(sight.view_of(top, {far}), 0.25, 1e-12);
  EXPECT_NEAR(sight.view_of(top, {near, far}), 1.25, 1e-12);
  EXPECT_EQ(sight.view_of(top, {}), 0.0);
}

TEST(OccupiedSpace, IsTheSameInParts) {
  OccupiedSpace parts;
  OccupiedSpace low;
  low.add({1.5, 1.5}, 3.5);
  OccupiedSpace high;
  high.add({1.5, 1.5}, 63.9);
  high.add({1.5, 1.5}, 64.1);  // left out
  high.add({1.5, 1.5}, -0.1);  // the same
  parts.add(low);
  parts.add(high);
  EXPECT_EQ(*parts.columns().find(1.2, 1.8), std::uint64_t{1} << 3 | std::uint64_t{1} << 63);
}

}  // namespace
}  // namespace understory
