#include "understory/geometry/plane/plot_shape.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

TEST(PlotShape, ACirclesPolygonHasItsArea) {
  const PlotShape plot = circle_plot("a", {3'000'000.0, 7'000'000.0}, 15.0);
  EXPECT_NEAR(plot.area_m2(), M_PI * 225.0, 1e-6);
  EXPECT_TRUE(plot.contains({3'000'014.9, 7'000'000.0}));
  EXPECT_FALSE(plot.contains({3'000'015.1, 7'000'000.0}));
  EXPECT_NEAR(plot.distance_to_border({3'000'005.0, 7'000'000.0}), 10.0, 0.005);
}

TEST(PlotShape, ARadiusAlongASlopeCoversLessOfTheMap) {
  // Independent: a point of the map lies in the plot where its distance along the plane is less.
  const Eigen::Vector2d gradient(0.3, -0.5);
  const PlotShape plot = circle_plot("a", {10.0, 20.0}, 9.0, slope_squeeze(gradient));
  EXPECT_NEAR(plot.area_m2(), M_PI * 81.0 / std::sqrt(1.0 + gradient.squaredNorm()), 1e-9);
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d off(random.uniform(-10.0, 10.0), random.uniform(-10.0, 10.0));
    const double along = std::hypot(off.norm(), gradient.dot(off));
    if (std::abs(along - 9.0) < 0.01) continue;
    EXPECT_EQ(plot.contains(plot.centre + off), along < 9.0) << off.transpose();
  }
}

TEST(PlotShape, HolesAreOutside) {
  PlotShape plot;
  plot.rings = {{{0, 0}, {10, 0}, {10, 10}, {0, 10}}, {{4, 4}, {6, 4}, {6, 6}, {4, 6}}};
  orient(plot.rings[0], true);
  orient(plot.rings[1], false);
  EXPECT_NEAR(plot.area_m2(), 96.0, 1e-12);
  EXPECT_FALSE(plot.contains({5.0, 5.0}));
  EXPECT_TRUE(plot.contains({3.0, 5.0}));
  EXPECT_NEAR(plot.distance_to_border({5.0, 5.5}), 0.5, 1e-12);
  EXPECT_EQ(plot.crossings(5.0).size(), 4U);
  EXPECT_EQ(plot.box(), Eigen::Vector4d(0, 0, 10, 10));
}

}  // namespace
}  // namespace understory
