#include "understory/forest/trees/tree_sheets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/forest/trees/thin_coverage.h"

namespace understory {
namespace {

StemFit stem_with_radius(double x, double y, double radius_m) {
  StemFit stem;
  stem.centre = {x, y};
  stem.radius_m = radius_m;
  stem.rms_m = 0.005;
  stem.arc_deg = 360.0;
  return stem;
}

// Points on the surface of a stem over some of its sides.
std::vector<SlicePoint> surface_of(const StemFit& stem, int from_deg, int to_deg) {
  std::vector<SlicePoint> points;
  for (int degree = from_deg; degree < to_deg; degree += 2) {
    const double angle = degree * std::numbers::pi / 180.0;
    for (const double height : {0.6, 1.0, 1.3, 1.8, 2.4}) {
      const Eigen::Vector2d place = stem.centre + (height - 1.3) * stem.slope +
                                    (stem.radius_m + (height - 1.3) * stem.taper) *
                                        Eigen::Vector2d(std::cos(angle), std::sin(angle));
      points.push_back({static_cast<float>(place.x()), static_cast<float>(place.y()),
                        static_cast<float>(height)});
    }
  }
  return points;
}

TEST(TreeSheets, TellFromWhichSidesAStemWasSeen) {
  StemFit stem = stem_with_radius(3.0, -4.0, 0.2);
  stem.slope = {0.1, -0.05};
  const std::vector<StemFit> stems = {stem, stem_with_radius(9.0, -4.0, 0.1)};
  const SheetCollector collector(stems, surface_of(stem, 31, 120), most_doubtful(stems));
  ASSERT_EQ(collector.seen().size(), 2U);
  for (std::size_t side = 0; side < 36; ++side)
    EXPECT_EQ(collector.seen()[0].test(side), side >= 3 && side < 12) << side;
  EXPECT_TRUE(collector.seen()[1].none());
}

TEST(TreeSheets, ACrossSectionIsARingAlsoOfALeaningStem) {
  StemFit stem = stem_with_radius(3.0, -4.0, 0.2);
  stem.slope = {0.2, 0.1};
  const std::vector<StemFit> stems = {stem};
  SheetCollector collector(stems, surface_of(stem, 0, 360), most_doubtful(stems));
  const std::vector<TreeSheet> sheets = collector.take();
  ASSERT_EQ(sheets.size(), 1U);
  ASSERT_EQ(sheets[0].section.size(), 250U) << "of 540 points within the layer";
  for (const Eigen::Vector2f& point : sheets[0].section)
    EXPECT_NEAR(point.norm(), 0.2F, 0.004F);
  EXPECT_TRUE(sheets[0].front.empty());
}

TEST(TreeSheets, AreTheSameForAnyOrderOfPoints) {
  const std::vector<StemFit> stems = {stem_with_radius(0.0, 0.0, 0.1)};
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 6000; ++i) {
    const double angle = 0.7 * i;
    const double away = 0.05 + 0.2 * (i % 7);
    points.emplace_back(away * std::cos(angle), away * std::sin(angle), 0.004 * i);
  }
  SheetCollector one(stems, {}, most_doubtful(stems));
  SheetCollector other(stems, {}, most_doubtful(stems));
  for (const Eigen::Vector3d& p : points)
    one.add(0, p.head<2>(), p.z());
  std::reverse(points.begin(), points.end());
  for (const Eigen::Vector3d& p : points) {
    other.add(0, p.head<2>(), p.z());
    other.add(0, p.head<2>(), p.z());  // seen twice: counts once
  }
  const TreeSheet a = one.take()[0];
  const TreeSheet b = other.take()[0];
  ASSERT_EQ(a.front.size(), 550U) << "250 near the stem and 300 around it";
  ASSERT_EQ(b.front.size(), a.front.size());
  double mean_height = 0.0;
  for (std::size_t i = 0; i < a.front.size(); ++i) {
    EXPECT_EQ(a.front[i].place, b.front[i].place);
    EXPECT_EQ(a.front[i].stem, a.front[i].place.head<2>().norm() < 0.16F);
    mean_height += static_cast<double>(a.front[i].place.z()) / 550.0;
  }
  EXPECT_NEAR(mean_height, 12.0, 1.0) << "from all heights";
}

TEST(ThinCoverage, CellsWithFewPointsAreThin) {
  CoverageGrid grid;
  for (int i = 0; i < 80; ++i)
    grid.add({1.0, 1.0}, false);
  for (int i = 0; i < 79; ++i)
    grid.add({-1.0, 1.0}, true);
  const ThinCoverage thin = grid.thin();
  ASSERT_EQ(thin.corners.size(), 1U) << "80 points on 16 square metres are enough";
  EXPECT_EQ(thin.corners[0], Eigen::Vector2d(-4.0, 0.0));
  EXPECT_DOUBLE_EQ(thin.share, 0.5);
  EXPECT_EQ(thin.dense_share, 0.0);
  EXPECT_EQ(thin.near_breast_per_m2, 0.0);
}

TEST(ThinCoverage, DenseCellsTellWhatStandsOnThem) {
  CoverageGrid grid;
  for (int i = 0; i < 320; ++i)  // 20 a square metre
    grid.add({1.0, 1.0}, i < 32);
  CoverageGrid other;
  for (int i = 0; i < 319; ++i)
    other.add({-1.0, 1.0}, true);
  grid.add(other);
  const ThinCoverage thin = grid.thin();
  EXPECT_DOUBLE_EQ(thin.dense_share, 0.5);
  EXPECT_DOUBLE_EQ(thin.near_breast_per_m2, 2.0);
}

}  // namespace
}  // namespace understory
