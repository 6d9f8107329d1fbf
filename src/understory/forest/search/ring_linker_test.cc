#include "understory/forest/search/ring_linker.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// A ring of a stem through (x, y) at breast height that leans by `slope` along x.
Ring ring_of(double x, double y, double slope, double radius, int slice) {
  Ring ring;
  ring.slice = slice;
  ring.height_m = 0.625 + 0.25 * slice;
  ring.circle.centre = {x + slope * (ring.height_m - 1.3), y};
  ring.circle.radius_m = radius;
  ring.circle.on = 40;
  ring.circle.even_deg = 200.0;
  return ring;
}

TEST(RingLinker, RingsOfALeaningStemAreOneStem) {
  std::vector<Ring> rings;
  for (int slice = 0; slice < 12; ++slice)
    rings.push_back(ring_of(5.0, -3.0, 0.2, 0.15, slice));
  const std::vector<StemFit> stems = link_rings(rings, 3, 25.0);
  ASSERT_EQ(stems.size(), 1U);
  EXPECT_EQ(stems[0].slices.size(), 12U);
  EXPECT_NEAR(stems[0].centre.x(), 5.0, 0.01);
  EXPECT_NEAR(stems[0].centre.y(), -3.0, 1e-9);
  EXPECT_NEAR(stems[0].slope.x(), 0.2, 0.01);
  EXPECT_NEAR(stems[0].radius_m, 0.15, 1e-9);
}

TEST(RingLinker, TwoStemsBesideEachOtherStayTwo) {
  std::vector<Ring> rings;
  for (int slice = 0; slice < 10; ++slice) {
    rings.push_back(ring_of(0.0, 0.0, 0.0, 0.15, slice));
    rings.push_back(ring_of(0.5, 0.0, 0.0, 0.1, slice));
  }
  const std::vector<StemFit> stems = link_rings(rings, 3, 25.0);
  ASSERT_EQ(stems.size(), 2U);
  for (const StemFit& stem : stems) {
    EXPECT_EQ(stem.slices.size(), 10U);
    EXPECT_NEAR(stem.radius_m, stem.centre.x() < 0.25 ? 0.15 : 0.1, 1e-9);
  }
}

TEST(RingLinker, AStrayRingBelongsToNoStem) {
  std::vector<Ring> rings;
  for (int slice = 0; slice < 8; ++slice)
    rings.push_back(ring_of(0.0, 0.0, 0.0, 0.15, slice));
  rings.push_back(ring_of(0.3, 0.1, 0.0, 0.15, 4));  // beside
  rings.push_back(ring_of(0.0, 0.0, 0.0, 0.4, 9));   // far too large
  const std::vector<StemFit> stems = link_rings(rings, 3, 25.0);
  ASSERT_EQ(stems.size(), 1U);
  EXPECT_EQ(stems[0].slices.size(), 8U);
  EXPECT_NEAR(stems[0].centre.x(), 0.0, 1e-9);
}

TEST(RingLinker, TooFewSlicesOrTooMuchLeanIsNoStem) {
  std::vector<Ring> rings = {ring_of(0.0, 0.0, 0.0, 0.15, 0), ring_of(0.0, 0.0, 0.0, 0.15, 1)};
  EXPECT_TRUE(link_rings(rings, 3, 25.0).empty());
  EXPECT_EQ(link_rings(rings, 2, 25.0).size(), 1U);
  rings.clear();
  for (int slice = 0; slice < 12; ++slice)
    rings.push_back(ring_of(0.0, 0.0, 1.0, 0.15, slice));  // 45 degrees
  EXPECT_TRUE(link_rings(rings, 4, 10.0).empty());
  EXPECT_TRUE(link_rings({}, 3, 25.0).empty());
}

}  // namespace
}  // namespace understory
