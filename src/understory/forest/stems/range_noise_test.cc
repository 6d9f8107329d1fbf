#include "understory/forest/stems/range_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/forest/stems/stem_axis.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kTrueRadius = 0.12;

// Stems in a row, seen from two places south of them, with noise along the beams.
std::vector<SlicePoint> row_of_stems(int count, double noise_m) {
  Random random(3);
  std::vector<SlicePoint> points;
  for (int k = 0; k < count; ++k) {
    for (const double from : {-0.6, 0.6}) {
      const Eigen::Vector2d view(std::sin(from), std::cos(from));
      const Eigen::Vector2d across(view.y(), -view.x());
      for (int i = 0; i < 600; ++i) {
        const double height = random.uniform(0.5, 3.5);
        const double r = kTrueRadius - 0.008 * (height - kBreastHeight);
        const double off = random.uniform(-r, r);
        const double depth = -std::sqrt(r * r - off * off) + random.normal(0.0, noise_m);
        const Eigen::Vector2d at = Eigen::Vector2d(2.0 * k, 0.0) + off * across + depth * view;
        points.push_back({static_cast<float>(at.x() + random.normal(0.0, 0.006)),
                          static_cast<float>(at.y() + random.normal(0.0, 0.006)),
                          static_cast<float>(height), 1});
      }
    }
  }
  return points;
}

// As a search finds them that takes the noise for scatter to all sides.
std::vector<StemFit> thin_fits(int count) {
  std::vector<StemFit> stems;
  for (int k = 0; k < count; ++k) {
    StemFit stem;
    stem.centre = {2.0 * k, -0.01};
    stem.radius_m = 0.1;
    stem.taper = -0.008;
    stem.scatter_m = 0.03;
    stem.arc_deg = 250.0;
    stem.returns = 1000;
    stems.push_back(stem);
  }
  return stems;
}

TEST(RangeNoise, StemsTellItAndAreMeasuredWithIt) {
  std::vector<SlicePoint> cloud = row_of_stems(4, 0.035);
  std::vector<StemFit> stems = thin_fits(4);
  const std::vector<StemFit> found = stems;
  const StemPoints points(cloud, found);
  std::vector<RangeNoiseFits> told;
  for (const std::size_t i : stems_for_range_noise(stems))
    told.push_back(fit_range_noise(points.around(stems[i]), stems[i]).value());
  ASSERT_EQ(told.size(), 4u);
  const double noise = range_noise_of(told);
  EXPECT_NEAR(noise, 0.035, 0.005);
  for (StemFit& stem : stems) {
    StemFit without = stem;
    measure_at_breast_height(points.around(stem), noise, stem);
    measure_at_breast_height(points.around(stem), 0.0, without);
    EXPECT_NEAR(stem.section_radius_m, kTrueRadius, 0.006);
    EXPECT_LT(without.section_radius_m, kTrueRadius - 0.008);
    EXPECT_EQ(stem.range_noise_m, noise);
    EXPECT_EQ(without.range_noise_m, 0.0);
  }
}

TEST(RangeNoise, ScatterToAllSidesIsNone) {
  std::vector<SlicePoint> cloud = row_of_stems(5, 0.0);
  Random random(4);
  for (SlicePoint& point : cloud) {
    point.x += static_cast<float>(random.normal(0.0, 0.03));
    point.y += static_cast<float>(random.normal(0.0, 0.03));
  }
  const std::vector<StemFit> stems = thin_fits(5);
  const StemPoints points(cloud, stems);
  std::vector<RangeNoiseFits> told;
  for (const StemFit& stem : stems)
    told.push_back(fit_range_noise(points.around(stem), stem).value());
  EXPECT_EQ(range_noise_of(told), 0.0);
}

TEST(RangeNoise, StemsDecideTogether) {
  const RangeNoiseFits along = {0.03, 0.02};
  const RangeNoiseFits to_all_sides = {0.02, -0.04};
  EXPECT_EQ(range_noise_of({along, along, to_all_sides}), 0.03);
  EXPECT_EQ(range_noise_of({along, to_all_sides, to_all_sides}), 0.0);
  EXPECT_EQ(range_noise_of({along, along}), 0.0);
  EXPECT_EQ(range_noise_of({{0.001, 0.1}, {0.002, 0.1}, {0.001, 0.1}}), 0.0);
}

TEST(RangeNoise, ThinStemsAndStemsOfFewReturnsAreNotAsked) {
  std::vector<StemFit> stems = thin_fits(5);
  stems[0].radius_m = 0.03;
  stems[1].returns = 150;
  stems[2].in_foliage = true;
  stems[3].below_sd_m = 0.01;
  stems[4].returns = 200;
  EXPECT_EQ(stems_for_range_noise(stems), std::vector<std::size_t>{4});
}

TEST(RangeNoise, PointsOfANeighbourAreLeftOut) {
  std::vector<SlicePoint> cloud;
  for (int i = 0; i < 36; ++i) {
    const double turn = i * M_PI / 18.0;
    for (const double x : {0.0, 0.25})
      cloud.push_back({static_cast<float>(x + 0.1 * std::cos(turn)),
                       static_cast<float>(0.1 * std::sin(turn)), 1.3F, 1});
  }
  std::vector<StemFit> stems = thin_fits(2);
  stems[0].centre = {0.0, 0.0};
  stems[1].centre = {0.25, 0.0};
  for (StemFit& stem : stems)
    stem.taper = 0.0;
  const StemPoints points(cloud, stems);
  EXPECT_EQ(points.around(stems[0]).size(), 36u);
  EXPECT_EQ(points.around(stems[1]).size(), 36u);
}

}  // namespace
}  // namespace understory
