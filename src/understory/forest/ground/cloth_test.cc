#include "understory/forest/ground/cloth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace understory {
namespace {

constexpr int kSide = 40;
constexpr float kNoHeight = std::numeric_limits<float>::quiet_NaN();

// z over column and row.
template <typename Height>
std::vector<float> floor_of(const Height& height) {
  std::vector<float> floor;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column)
      floor.push_back(height(column, row));
  }
  return floor;
}
std::size_t at(int column, int row) {
  return static_cast<std::size_t>(row * kSide + column);
}

TEST(Cloth, LiesOnAnEvenSlope) {
  const auto floor = floor_of([](int column, int) { return 10.0F + 0.1F * column; });
  EXPECT_EQ(settle_cloth(floor, kSide, kSide, {}), floor);
}

// The lowest points below a dense crown are 6 m up: the cloth goes on at the height of the ground
// around.
TEST(Cloth, DoesNotFollowACrownUpwards) {
  const auto floor = floor_of(
      [](int column, int row) { return std::hypot(column - 20, row - 20) < 3.5 ? 6.0F : 0.0F; });
  const std::vector<float> cloth = settle_cloth(floor, kSide, kSide, {});
  EXPECT_LT(cloth[at(20, 20)], 1.5F);
  EXPECT_EQ(cloth[at(5, 5)], 0.0F);
  for (std::size_t i = 0; i < floor.size(); ++i)
    EXPECT_LE(cloth[i], floor[i]) << "never above the lowest points";
}

TEST(Cloth, SpansPlacesWithoutPoints) {
  const auto floor = floor_of([](int column, int row) {
    return std::hypot(column - 20, row - 20) < 4.0 ? kNoHeight : 3.0F;
  });
  const std::vector<float> cloth = settle_cloth(floor, kSide, kSide, {});
  EXPECT_NEAR(cloth[at(20, 20)], 3.0F, 0.5F);
}

TEST(Cloth, AStifferOneBulgesLess) {
  const auto floor = floor_of(
      [](int column, int row) { return std::hypot(column - 20, row - 20) < 5.0 ? 8.0F : 0.0F; });
  const float soft = settle_cloth(floor, kSide, kSide, {1, 500})[at(20, 20)];
  const float stiff = settle_cloth(floor, kSide, kSide, {3, 500})[at(20, 20)];
  EXPECT_LT(stiff, soft);
}

TEST(Cloth, WithoutAnyPointItStaysUnknown) {
  const std::vector<float> floor(16, kNoHeight);
  for (const float z : settle_cloth(floor, 4, 4, {}))
    EXPECT_TRUE(std::isnan(z));
  EXPECT_TRUE(settle_cloth({}, 0, 0, {}).empty());
}

}  // namespace
}  // namespace understory
