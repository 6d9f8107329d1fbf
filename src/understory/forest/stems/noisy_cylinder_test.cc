#include "understory/forest/stems/noisy_cylinder.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// Points of a stem seen from one side, as far beams with a wide footprint give them: evenly over
// its width, displaced to all sides.
std::vector<SlicePoint> seen_from_one_side(double radius, double noise, int count, Random& random) {
  std::vector<SlicePoint> points;
  for (int i = 0; i < count; ++i) {
    const double h = random.uniform(0.5, 3.5);
    const double r = radius - 0.008 * (h - 1.3);
    const double across = random.uniform(-r, r);
    const double x = across + random.normal(0.0, noise) + 0.02 * (h - 1.3);
    const double y = -std::sqrt(r * r - across * across) + random.normal(0.0, noise);
    points.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(h), 1});
  }
  return points;
}

StemFit start_at(double radius, double x, double y) {
  StemFit start;
  start.centre = {x, y};
  start.slope = {0.02, 0.0};
  start.radius_m = radius;
  start.taper = -0.008;
  start.rms_m = 0.02;
  return start;
}

TEST(NoisyCylinder, ScatterAsLargeAsAThirdOfTheRadiusDoesNotMakeTheStemThicker) {
  Random random(1);
  double sum = 0.0;
  constexpr int kStems = 40;
  for (int i = 0; i < kStems; ++i) {
    const std::vector<SlicePoint> points = seen_from_one_side(0.075, 0.025, 400, random);
    // Distances alone lead there: a circle that is too large and too far back.
    const NoisyCylinder fit = fit_noisy_cylinder(points, start_at(0.1, 0.0, 0.02), {});
    ASSERT_TRUE(fit.converged);
    EXPECT_NEAR(fit.radius_m, 0.075, 0.03);
    EXPECT_NEAR(fit.scatter_m, 0.025, 0.006);
    sum += fit.radius_m;
  }
  // From one side the fit is a fifth of the scatter too thin: neighbouring directions share the
  // view.
  EXPECT_NEAR(sum / kStems, 0.075, 0.006);
}

// The same where the noise lies along the beams, which come from the side of negative y.
std::vector<SlicePoint> seen_with_noisy_ranges(double radius, double noise, int count,
                                               Random& random) {
  std::vector<SlicePoint> points = seen_from_one_side(radius, 0.008, count, random);
  for (SlicePoint& point : points)
    point.y += static_cast<float>(random.normal(0.0, noise));
  return points;
}

TEST(NoisyCylinder, NoiseOfRangesThatIsKnownDoesNotMakeTheStemThinner) {
  Random random(5);
  double known = 0.0;
  double unknown = 0.0;
  constexpr int kStems = 20;
  for (int i = 0; i < kStems; ++i) {
    const std::vector<SlicePoint> points = seen_with_noisy_ranges(0.12, 0.04, 400, random);
    NoisyCylinderConfig config;
    config.stray_reach_m = 0.18;
    unknown += fit_noisy_cylinder(points, start_at(0.11, 0.0, 0.0), config).radius_m / kStems;
    config.range_noise_m = 0.04;
    const NoisyCylinder fit = fit_noisy_cylinder(points, start_at(0.11, 0.0, 0.0), config);
    ASSERT_TRUE(fit.converged);
    EXPECT_EQ(fit.range_noise_m, 0.04);
    EXPECT_NEAR(fit.scatter_m, 0.008, 0.004);
    known += fit.radius_m / kStems;
  }
  // From one side it is an eighth of the noise too thin: neighbouring directions share the view.
  EXPECT_NEAR(known, 0.12, 0.006);
  EXPECT_LT(unknown, 0.105);
}

// Wide beams and errors of heading shift points sideways more than along the beams.
TEST(NoisyCylinder, ScatterToTheSideIsFoundBesideTheNoiseOfRanges) {
  Random random(7);
  constexpr double kScatter = 0.018;
  constexpr double kNoise = 0.012;
  const double along = std::hypot(kNoise, std::sqrt(0.6) * kScatter);
  double radius = 0.0;
  double scatter = 0.0;
  constexpr int kStems = 100;
  for (int i = 0; i < kStems; ++i) {
    std::vector<SlicePoint> points = seen_from_one_side(0.12, 0.0, 400, random);
    for (SlicePoint& point : points) {
      point.x += static_cast<float>(random.normal(0.0, kScatter));
      point.y += static_cast<float>(random.normal(0.0, along));
    }
    NoisyCylinderConfig config;
    config.range_noise_m = kNoise;
    const NoisyCylinder fit = fit_noisy_cylinder(points, start_at(0.12, 0.0, 0.0), config);
    ASSERT_TRUE(fit.converged);
    radius += fit.radius_m / kStems;
    scatter += fit.scatter_m / kStems;
  }
  // As much to all sides would fit with 1.5 cm.
  EXPECT_NEAR(scatter, kScatter, 0.0015);
  // From one side it is a sixth of the scatter too thin: neighbouring directions share the view.
  EXPECT_NEAR(radius, 0.12, 0.004);
}

TEST(NoisyCylinder, NoiseOfRangesIsFound) {
  Random random(6);
  for (const double noise : {0.0, 0.012, 0.03, 0.05}) {
    NoisyCylinderConfig config;
    config.stray_reach_m = 0.2;
    config.range_noise_m = 0.02;
    config.find_range_noise = true;
    config.cycles = 40;
    const NoisyCylinder fit = fit_noisy_cylinder(seen_with_noisy_ranges(0.15, noise, 600, random),
                                                 start_at(0.14, 0.0, 0.0), config);
    ASSERT_TRUE(fit.converged) << noise;
    EXPECT_NEAR(fit.range_noise_m, noise, 0.005) << noise;
  }
}

TEST(NoisyCylinder, LittleScatterLeavesPlaceAndRadiusToMillimetres) {
  Random random(2);
  Eigen::Vector2d centre(0.0, 0.0);
  double radius = 0.0;
  constexpr int kStems = 20;
  for (int i = 0; i < kStems; ++i) {
    const std::vector<SlicePoint> points = seen_from_one_side(0.2, 0.01, 500, random);
    const NoisyCylinder fit = fit_noisy_cylinder(points, start_at(0.18, 0.02, -0.02), {});
    ASSERT_TRUE(fit.converged);
    EXPECT_NEAR(fit.slope.x(), 0.02, 0.005);
    EXPECT_NEAR(fit.taper, -0.008, 0.006);
    centre += fit.centre / kStems;
    radius += fit.radius_m / kStems;
  }
  EXPECT_NEAR(radius, 0.2, 0.0025);
  EXPECT_NEAR(centre.x(), 0.0, 0.001);
  EXPECT_NEAR(centre.y(), 0.0, 0.003);
}

TEST(NoisyCylinder, ALeaningStemIsMeasuredAcrossItsAxis) {
  // A steep lean: the horizontal section is 15 % longer than the diameter.
  Random random(3);
  const Eigen::Vector3d axis = Eigen::Vector3d(0.57, 0.0, 1.0).normalized();
  const Eigen::Vector3d u = axis.cross(Eigen::Vector3d::UnitY()).normalized();
  std::vector<SlicePoint> points;
  for (int i = 0; i < 500; ++i) {
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const double r = 0.15 + random.normal(0.0, 0.004);
    const Eigen::Vector3d p = random.uniform(-1.0, 2.5) * axis +
                              r * (std::cos(turn) * u + std::sin(turn) * Eigen::Vector3d::UnitY());
    points.push_back(
        {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z() + 1.3), 1});
  }
  StemFit start = start_at(0.14, 0.0, 0.01);
  start.slope = {0.57, 0.0};
  NoisyCylinderConfig config;
  config.usual_taper = 0.0;
  const NoisyCylinder fit = fit_noisy_cylinder(points, start, config);
  ASSERT_TRUE(fit.converged);
  EXPECT_NEAR(fit.radius_m, 0.15, 0.002);
}

TEST(NoisyCylinder, TooFewPointsDoNotConverge) {
  Random random(4);
  EXPECT_FALSE(fit_noisy_cylinder(seen_from_one_side(0.1, 0.01, 5, random), start_at(0.1, 0, 0), {})
                   .converged);
}

}  // namespace
}  // namespace understory
