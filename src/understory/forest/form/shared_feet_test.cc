#include "understory/forest/form/shared_feet.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// A stem by its place on the ground and what it leans.
StemFit stem_from(const Eigen::Vector2d& foot, const Eigen::Vector2d& slope, double radius_m) {
  StemFit stem;
  stem.slope = slope;
  stem.centre = foot + 1.3 * slope;
  stem.radius_m = radius_m;
  return stem;
}

TEST(SharedFeet, StemsThatPartAboveTheGroundShareOne) {
  const std::vector<StemFit> stems = {
      stem_from({0.0, 0.0}, {-0.1, 0.0}, 0.06), stem_from({0.2, 0.0}, {0.15, 0.0}, 0.11),
      stem_from({0.1, 0.15}, {0.0, 0.2}, 0.05), stem_from({3.0, 0.0}, {0.1, 0.0}, 0.1)};
  EXPECT_EQ(shared_feet(stems), (std::vector<std::size_t>{1, 1, 1, 3}));
}

// A fork below breast height: the lines cross above the ground.
TEST(SharedFeet, ALowForkHasOne) {
  const std::vector<StemFit> stems = {stem_from({0.0, 0.0}, {0.0, 0.0}, 0.1),
                                      stem_from({-0.3, 0.0}, {0.35, 0.0}, 0.08)};
  EXPECT_EQ(shared_feet(stems), (std::vector<std::size_t>{0, 0}));
}

TEST(SharedFeet, NeighboursHaveTheirOwn) {
  const std::vector<StemFit> apart = {stem_from({0.0, 0.0}, {0.0, 0.0}, 0.1),
                                      stem_from({0.5, 0.0}, {0.1, 0.0}, 0.1)};
  EXPECT_EQ(shared_feet(apart), (std::vector<std::size_t>{0, 1}));
  // They touch and go up side by side: two stems that grew together are two trees.
  const std::vector<StemFit> upright = {stem_from({0.0, 0.0}, {0.0, 0.0}, 0.1),
                                        stem_from({0.2, 0.0}, {0.0, 0.0}, 0.1)};
  EXPECT_EQ(shared_feet(upright), (std::vector<std::size_t>{0, 1}));
  EXPECT_TRUE(shared_feet({}).empty());
}

}  // namespace
}  // namespace understory
