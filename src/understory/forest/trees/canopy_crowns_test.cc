#include "understory/forest/trees/canopy_crowns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace understory {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Cone {
  Eigen::Vector2d top;
  double height_m;
  double radius_m;
};

// Cones that fall to half of their height at their edge, on open ground. A cell has the highest of
// 25 points, as in a canopy model.
Raster canopy_of(const std::vector<Cone>& cones) {
  Raster canopy;
  canopy.x0 = 100.0;
  canopy.y0 = 200.0;
  canopy.cell_m = 0.5;
  canopy.columns = canopy.rows = 60;
  canopy.values.assign(60 * 60, 0.0F);
  for (int row = 0; row < canopy.rows; ++row) {
    for (int column = 0; column < canopy.columns; ++column) {
      float& value = canopy.values[canopy.index(column, row)];
      for (int part = 0; part < 25; ++part) {
        const Eigen::Vector2d at(canopy.x0 + 0.5 * (column + 0.1 + 0.2 * (part % 5)),
                                 canopy.y0 + 0.5 * (row + 0.1 + 0.2 * (part / 5)));
        for (const Cone& cone : cones) {
          const double off = (at - cone.top).norm() / cone.radius_m;
          if (off <= 1.0)
            value = std::max(value, static_cast<float>(cone.height_m * (1.0 - 0.5 * off)));
        }
      }
    }
  }
  return canopy;
}

TEST(CanopyCrowns, TopsHeightsAndAreasOfSingleTrees) {
  const std::vector<Cone> cones = {{{108.0, 206.0}, 20.0, 2.5}, {{119.0, 219.0}, 12.0, 2.0}};
  const CanopyCrowns found = find_canopy_crowns(canopy_of(cones), {});
  ASSERT_EQ(found.crowns.size(), 2U);
  for (std::size_t i = 0; i < cones.size(); ++i) {
    EXPECT_LT((found.crowns[i].top - cones[i].top).norm(), 0.3) << i;
    EXPECT_NEAR(found.crowns[i].height_m, cones[i].height_m, 2.0) << i;
    const double area = M_PI * cones[i].radius_m * cones[i].radius_m;
    EXPECT_NEAR(found.crowns[i].area_m2, area, 0.15 * area) << i;
    EXPECT_EQ(found.at(cones[i].top), static_cast<std::int32_t>(i));
  }
  EXPECT_EQ(found.at({113.0, 213.0}), CanopyCrowns::kNone) << "open ground between them";
  EXPECT_EQ(found.at({0.0, 0.0}), CanopyCrowns::kNone) << "outside of the raster";
}

TEST(CanopyCrowns, CrownsThatTouchPartAlongTheValley) {
  // The valley of two like cones is the middle between them.
  const std::vector<Cone> cones = {{{110.0, 215.0}, 18.0, 3.5}, {{115.0, 215.0}, 18.0, 3.5}};
  const CanopyCrowns found = find_canopy_crowns(canopy_of(cones), {});
  ASSERT_EQ(found.crowns.size(), 2U);
  EXPECT_EQ(found.at({111.8, 215.2}), 0);
  EXPECT_EQ(found.at({113.2, 215.2}), 1);
  EXPECT_NEAR(found.crowns[0].area_m2, found.crowns[1].area_m2, 2.0);
}

TEST(CanopyCrowns, GapsAndPitsMakeNoTops) {
  const std::vector<Cone> cones = {{{115.0, 215.0}, 20.0, 4.0}};
  Raster canopy = canopy_of(cones);
  // Pulses through the crown, and cells without any, around the top and at its side.
  for (const auto& [column, row, value] :
       {std::tuple{31, 30, 3.0F}, {29, 29, kNaN}, {27, 32, kNaN}, {33, 27, 1.0F}})
    canopy.values[canopy.index(column, row)] = value;
  const CanopyCrowns found = find_canopy_crowns(canopy, {});
  ASSERT_EQ(found.crowns.size(), 1U);
  EXPECT_NEAR(found.crowns[0].area_m2, M_PI * 16.0, 5.0);
  EXPECT_EQ(found.at({115.75, 215.25}), 0) << "a pit belongs to the crown around it";
}

TEST(CanopyCrowns, NothingLowIsATree) {
  EXPECT_TRUE(find_canopy_crowns(canopy_of({{{115.0, 215.0}, 2.5, 1.5}}), {}).crowns.empty());
  EXPECT_TRUE(find_canopy_crowns(Raster{}, {}).crowns.empty());
}

TEST(CanopyCrowns, ATopAtTheBorderMayBeCut) {
  const CanopyCrowns found =
      find_canopy_crowns(canopy_of({{{100.1, 215.0}, 20.0, 3.0}, {{104.0, 225.0}, 20.0, 3.0}}), {});
  ASSERT_EQ(found.crowns.size(), 2U);
  EXPECT_TRUE(found.crowns[0].cut);
  EXPECT_FALSE(found.crowns[1].cut);
}

TEST(CanopyCrowns, NoCrownReachesFartherThanThatOfATree) {
  // A roof, or a canopy without valleys: 30 m wide.
  Raster canopy = canopy_of({});
  for (float& value : canopy.values)
    value = 10.0F;
  canopy.values[canopy.index(30, 30)] = 10.5F;
  const CanopyCrowns found = find_canopy_crowns(canopy, {});
  for (const CanopyCrown& crown : found.crowns)
    EXPECT_LE(crown.area_m2, M_PI * 3.8 * 3.8);
}

}  // namespace
}  // namespace understory
