#include "understory/forest/slice/slice_stems.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

// Points of a ring, `arc` of it, scattered to all sides.
void add_ring(std::vector<SlicePoint>& points, const Eigen::Vector2d& centre, double radius_m,
              double arc_deg, int count, double scatter_m, std::uint64_t seed) {
  Random random(seed);
  for (int i = 0; i < count; ++i) {
    const double turn = arc_deg / 180.0 * M_PI * random.uniform();
    const Eigen::Vector2d at = centre + radius_m * Eigen::Vector2d(std::cos(turn), std::sin(turn));
    points.push_back({static_cast<float>(at.x() + scatter_m * random.normal()),
                      static_cast<float>(at.y() + scatter_m * random.normal()), 200.0F, 1});
  }
}

TEST(SliceStems, DiametersOfRingsAndPartsOfRings) {
  std::vector<SlicePoint> points;
  add_ring(points, {1.0, 1.0}, 0.15, 360.0, 300, 0.004, 1);
  add_ring(points, {3.0, 1.5}, 0.08, 200.0, 150, 0.004, 2);
  add_ring(points, {5.0, 2.0}, 0.30, 120.0, 300, 0.006, 3);
  const std::vector<SliceStem> found = measure_slice(points, {});
  ASSERT_EQ(found.size(), 3U);
  const std::vector<double> radii = {0.15, 0.08, 0.30};
  for (std::size_t i = 0; i < radii.size(); ++i) {
    const StemFit& stem = found[i].stem;
    EXPECT_NEAR(stem.radius_m, radii[i], 0.005) << i;
    EXPECT_LT(std::abs(stem.radius_m - radii[i]), 3.0 * std::sqrt(stem.covariance(2, 2))) << i;
    EXPECT_EQ(found[i].rings_apart_m, 0.0) << i;
  }
}

TEST(SliceStems, FullDiscsAndScatteredPointsAreNone) {
  std::vector<SlicePoint> points;
  Random random(4);
  for (int i = 0; i < 1'500; ++i) {  // a bush of 60 cm
    const double r = 0.3 * std::sqrt(random.uniform());
    const double turn = 2.0 * M_PI * random.uniform();
    points.push_back({static_cast<float>(1.0 + r * std::cos(turn)),
                      static_cast<float>(1.0 + r * std::sin(turn)), 0.0F, 1});
  }
  for (int i = 0; i < 1'500; ++i)
    points.push_back({static_cast<float>(3.0 + 2.0 * random.uniform()),
                      static_cast<float>(2.0 * random.uniform()), 0.0F, 1});
  for (const SliceStem& found : measure_slice(points, {}))
    ADD_FAILURE() << "a stem at " << found.stem.centre.transpose() << " of radius "
                  << found.stem.radius_m << ", arc " << found.stem.arc_deg << " degrees, spread "
                  << found.stem.rms_m;
}

TEST(SliceStems, AWallIsNone) {
  std::vector<SlicePoint> points;
  Random random(5);
  for (int i = 0; i < 2'000; ++i)
    points.push_back({static_cast<float>(6.0 * random.uniform()),
                      static_cast<float>(0.004 * random.normal()), 0.0F, 1});
  for (const SliceStem& found : measure_slice(points, {}))
    ADD_FAILURE() << "a stem at " << found.stem.centre.transpose() << " of radius "
                  << found.stem.radius_m << ", arc " << found.stem.arc_deg << " degrees, spread "
                  << found.stem.rms_m;
}

TEST(SliceStems, TwoRingsOfDriftAreSaidAndWidenTheDeviation) {
  std::vector<SlicePoint> points;
  add_ring(points, {1.0, 1.0}, 0.15, 360.0, 400, 0.003, 6);
  add_ring(points, {1.0, 1.0}, 0.19, 360.0, 400, 0.003, 7);
  const std::vector<SliceStem> found = measure_slice(points, {});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].rings_apart_m, 0.04, 0.008);
  EXPECT_GT(std::sqrt(found[0].stem.covariance(2, 2)), 0.015);
}

TEST(SliceStems, StemsThatTouchAreTwo) {
  std::vector<SlicePoint> points;
  add_ring(points, {1.0, 1.0}, 0.12, 360.0, 300, 0.003, 8);
  add_ring(points, {1.23, 1.0}, 0.11, 360.0, 300, 0.003, 9);
  const std::vector<SliceStem> found = measure_slice(points, {});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0].stem.radius_m, 0.12, 0.01);
  EXPECT_NEAR(found[1].stem.radius_m, 0.11, 0.01);
}

}  // namespace
}  // namespace understory
