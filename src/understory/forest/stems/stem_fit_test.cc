#include "understory/forest/stems/stem_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kTaper = -0.01;

// The surface of a leaning, tapering stem through (1, 2), seen over `arc_deg`.
std::vector<SlicePoint> stem_points(double radius, double slope, double arc_deg, int count,
                                    double noise_m, Random& random) {
  std::vector<SlicePoint> points;
  const double axis_length = std::sqrt(1.0 + slope * slope);
  for (int i = 0; i < count; ++i) {
    const double along = random.uniform(-0.75, 2.1);  // over breast height
    const double angle = random.uniform(0.0, arc_deg) * M_PI / 180.0;
    const double r = radius + kTaper * along + random.normal(0.0, noise_m);
    // Across the axis: u is in the plane of the lean, v is horizontal.
    const double u = r * std::cos(angle);
    const double v = r * std::sin(angle);
    points.push_back({static_cast<float>(1.0 + (slope * along + u) / axis_length),
                      static_cast<float>(2.0 + v),
                      static_cast<float>(1.3 + (along - slope * u) / axis_length), 2});
  }
  return points;
}

// A start as the rings give it: some centimetres off.
StemFit start_of_rings(double radius, double slope) {
  StemFit start;
  start.centre = {1.02, 1.985};
  start.slope = {slope + 0.01, -0.01};
  start.radius_m = radius + 0.015;
  start.taper = kTaper;
  for (float height = 0.625F; height < 3.5F; height += 0.25F)
    start.slices.push_back({height, 1.0F, 2.0F, static_cast<float>(radius), 0.005F, 200.0F});
  return start;
}

TEST(StemFit, PlaceLeanAndRadiusOfALeaningStem) {
  Random random(1);
  const auto points = stem_points(0.18, 0.15, 360.0, 800, 0.004, random);
  const StemFitResult fit = fit_stem(points, start_of_rings(0.18, 0.15), {});
  ASSERT_TRUE(fit.converged);
  EXPECT_LT((fit.stem.centre - Eigen::Vector2d(1.0, 2.0)).norm(), 0.003);
  EXPECT_NEAR(fit.stem.slope.x(), 0.15, 0.005);
  EXPECT_NEAR(fit.stem.slope.y(), 0.0, 0.005);
  EXPECT_NEAR(fit.stem.radius_m, 0.18, 0.002);
  EXPECT_NEAR(fit.stem.taper, kTaper, 0.003);
  EXPECT_NEAR(fit.stem.rms_m, 0.004, 0.001);
  EXPECT_GT(fit.stem.arc_deg, 345.0);
}

TEST(StemFit, ItsStandardDeviationsHold) {
  Random random(2);
  int within = 0;
  constexpr int kStems = 60;
  for (int i = 0; i < kStems; ++i) {
    const auto points = stem_points(0.18, 0.0, 160.0, 300, 0.006, random);
    const StemFitResult fit = fit_stem(points, start_of_rings(0.18, 0.0), {});
    ASSERT_TRUE(fit.converged);
    const double sd = std::sqrt(fit.stem.covariance(2, 2));
    EXPECT_GT(sd, 0.0);
    within += std::abs(fit.stem.radius_m - 0.18) < 3.0 * sd ? 1 : 0;
  }
  EXPECT_GE(within, kStems - 8);
}

TEST(StemFit, TheEvidenceTellsAStemFromFoliage) {
  Random random(3);
  const StemFitResult stem =
      fit_stem(stem_points(0.18, 0.0, 360.0, 800, 0.004, random), start_of_rings(0.18, 0.0), {});
  EXPECT_EQ(stem.evidence.inside, 0);
  EXPECT_GE(stem.evidence.on, 760);
  EXPECT_NEAR(stem.evidence.returns, 2 * stem.evidence.on, 4);
  EXPECT_GE(stem.evidence.slices, 10);
  EXPECT_GT(stem.evidence.even_arc_deg, 300.0);
  EXPECT_LT(stem.evidence.inside_ratio, 0.05);
  std::vector<SlicePoint> foliage;
  for (int i = 0; i < 3000; ++i)
    foliage.push_back({static_cast<float>(random.uniform(0.6, 1.4)),
                       static_cast<float>(random.uniform(1.6, 2.4)),
                       static_cast<float>(random.uniform(0.5, 3.5)), 1});
  const StemFitResult bush = fit_stem(foliage, start_of_rings(0.18, 0.0), {});
  EXPECT_GT(bush.evidence.inside, 100);
}

TEST(StemFit, RefiningKeepsTheRadiusOfPointsThatScatter) {
  Random random(4);
  double refined = 0.0;
  constexpr int kStems = 10;
  for (int i = 0; i < kStems; ++i) {
    const auto points = stem_points(0.1, 0.0, 360.0, 600, 0.02, random);
    const StemFitResult fit = fit_stem(points, start_of_rings(0.1, 0.0), {});
    ASSERT_TRUE(fit.converged);
    const StemFitResult better = refine_stem(points, fit, {});
    ASSERT_TRUE(better.converged);
    refined += better.stem.radius_m / kStems;
  }
  EXPECT_NEAR(refined, 0.1, 0.003);
}

TEST(StemFit, NoPointsAreNoStem) {
  EXPECT_FALSE(fit_stem({}, start_of_rings(0.18, 0.0), {}).converged);
}

// Two passes that saw another half each, moved apart along x.
TEST(StemFit, ItsOutlineTellsOfTwoPasses) {
  Random random(11);
  auto points = stem_points(0.15, 0.0, 360.0, 2000, 0.004, random);
  const StemFit round = fit_stem(points, start_of_rings(0.15, 0.0), {}).stem;
  ASSERT_TRUE(round.oval.allFinite());
  EXPECT_LT(round.oval.norm(), 0.001);
  for (SlicePoint& point : points)
    point.x += point.x > 1.0F ? 0.05F : 0.0F;
  const StemFit apart = fit_stem(points, start_of_rings(0.15, 0.0), {}).stem;
  ASSERT_TRUE(apart.oval.allFinite());
  EXPECT_NEAR(apart.oval.x(), 2.0 / (3.0 * M_PI) * 0.05, 0.003);
  EXPECT_NEAR(apart.oval.y(), 0.0, 0.002);
}

// Noise along one line of sight lies all around a thin stem, and is no outline.
TEST(StemFit, NoiseOfOneViewIsNoOutline) {
  Random random(12);
  const StemFit thick =
      fit_stem(stem_points(0.05, 0.0, 360.0, 2000, 0.015, random), start_of_rings(0.05, 0.0), {})
          .stem;
  EXPECT_FALSE(thick.oval.allFinite()) << "scatters by " << thick.rms_m;
  auto points = stem_points(0.15, 0.0, 180.0, 2000, 0.004, random);
  for (const SlicePoint& point : stem_points(0.15, 0.0, 360.0, 60, 0.004, random))
    points.push_back(point);
  const StemFit one_view = fit_stem(points, start_of_rings(0.15, 0.0), {}).stem;
  EXPECT_GT(one_view.arc_deg, 300.0);
  EXPECT_FALSE(one_view.oval.allFinite()) << "nearly all points are on one side";
}

}  // namespace
}  // namespace understory
