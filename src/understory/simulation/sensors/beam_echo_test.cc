#include "understory/simulation/sensors/beam_echo.h"

#include <gtest/gtest.h>

#include <vector>

namespace understory {
namespace {

Hit hit(float range_m, float reflectivity, Surface surface, int tree = 0) {
  return {range_m, 1.0F, reflectivity, tree, surface};
}

// Hits within a pulse's length are one echo at their mean by energy, and rays that met nothing take
// their share of the beam. This holds for every way to choose the number of rays.
TEST(BeamEcho, HitsWithinAPulseMerge) {
  for (const std::size_t rays : {3U, 8U}) {
    std::vector<Hit> hits(rays);
    hits[0] = hit(10.2F, 0.2F, Surface::kFoliage);
    hits[2] = hit(10.0F, 0.6F, Surface::kStem, 5);
    const BeamEcho echo = strongest_echo(hits, 0.25, nullptr);
    EXPECT_NEAR(echo.range_m, (0.2 * 10.2 + 0.6 * 10.0) / 0.8, 1e-5);
    EXPECT_NEAR(echo.energy, 0.8 / static_cast<double>(rays), 1e-6);
    EXPECT_EQ(echo.tree, 5);
    EXPECT_EQ(echo.surface, Surface::kStem);
  }
}

TEST(BeamEcho, HitsFartherApartAreTwoEchoes) {
  for (const std::size_t rays : {3U, 8U}) {
    std::vector<Hit> hits(rays);
    hits[0] = hit(10.3F, 0.2F, Surface::kFoliage);
    hits[2] = hit(10.0F, 0.6F, Surface::kStem, 5);
    BeamEcho second;
    const BeamEcho echo = strongest_echo(hits, 0.25, &second);
    EXPECT_FLOAT_EQ(echo.range_m, 10.0F);
    EXPECT_EQ(echo.tree, 5);
    EXPECT_FLOAT_EQ(second.range_m, 10.3F);
    EXPECT_EQ(second.surface, Surface::kFoliage);
  }
}

TEST(BeamEcho, NothingMetIsNoEcho) {
  const std::vector<Hit> hits(8);
  EXPECT_EQ(strongest_echo(hits, 0.25, nullptr).surface, Surface::kNone);
}

}  // namespace
}  // namespace understory
