#include "understory/graph/map_sharpness.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

TEST(MapSharpness, BlurRatioIsEquation30) {
  const SharpnessConfig config;
  // Three fine cells in two coarse ones: rounding is to the nearest grid point.
  const SparsePoints map = {
      {0.0, 0.0, 0.0}, {0.09, -0.09, 5.0}, {0.11, 0.0, 0.0}, {14.0, 0.0, 0.0}};
  EXPECT_NEAR(blur_ratio(map, config), 3.0 * 0.04 / (2.0 * 100.0), 1e-15);
  // In space the second point has a cell of its own, and the coarse cells are two and one more.
  EXPECT_NEAR(blur_ratio_3d(map, config), 4.0 * 0.008 / (3.0 * 1000.0), 1e-15);
  EXPECT_EQ(blur_ratio({}, config), 0.0);
  // So wide a map that the cells are counted by their names.
  SparsePoints wide = map;
  wide.emplace_back(4e5, 4e5, 0.0);
  EXPECT_NEAR(blur_ratio(wide, config), 4.0 * 0.04 / (3.0 * 100.0), 1e-15);
}

TEST(MapSharpness, BoxDimensionOfPointsLinesAndAreas) {
  const SharpnessConfig config;
  SparsePoints points;
  SparsePoints line;
  SparsePoints area;
  for (int i = 0; i < 400; ++i) {
    line.emplace_back(0.1 * i, 3.0, 0.0);
    points.emplace_back(8.0 * (i % 20), 8.0 * (i / 20), 0.0);
    for (int k = 0; k < 400; ++k)
      area.emplace_back(0.1 * i, 0.1 * k, 0.0);
  }
  EXPECT_NEAR(box_dimension(points, config, false), 0.0, 0.02);
  EXPECT_NEAR(box_dimension(line, config, false), 1.0, 0.05);
  EXPECT_NEAR(box_dimension(area, config, false), 2.0, 0.05);
  EXPECT_NEAR(box_dimension(area, config, true), 2.0, 0.05);
}

struct Stand {
  std::vector<SparsePoints> views;
  std::vector<Pose> poses;
};

// Views of 25 trees 4 m apart, a share of them seen, with noise.
Stand views_of_stand(int views, double noise_m, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, noise_m);
  Stand result;
  for (int v = 0; v < views; ++v) {
    const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * v, Eigen::Vector3d::UnitZ())),
                    {0.2 * v, 1.0, 2.0});
    SparsePoints points;
    for (int t = 0; t < 25; ++t)
      points.push_back(pose.inverse() * Eigen::Vector3d(4.0 * (t % 5) + noise(random),
                                                        4.0 * (t / 5) + noise(random), 0.0));
    result.views.push_back(points);
    result.poses.push_back(pose);
  }
  return result;
}

TEST(MapSharpness, RegistrationNoiseIsTheNoiseOfTheSights) {
  const Stand seen = views_of_stand(80, 0.05, 1);
  const RegistrationNoise noise = registration_noise(seen.views, seen.poses, {}, {});
  EXPECT_EQ(noise.trees, 25U);
  EXPECT_EQ(noise.sights, 2000U);
  // Two axes; a mean of 80 sights takes up an eightieth.
  EXPECT_NEAR(noise.pooled_m, 0.05 * std::sqrt(2.0 * 79.0 / 80.0), 0.002);
  EXPECT_NEAR(noise.mean_m, noise.pooled_m, 0.002);
  double squares = 0.0;
  for (const double value : noise.squares_m2)
    squares += value;
  EXPECT_NEAR(std::sqrt(squares / 2000.0), noise.pooled_m, 1e-12);
  // Fewer sights than a tree must have.
  const Stand few = views_of_stand(14, 0.05, 1);
  EXPECT_EQ(registration_noise(few.views, few.poses, {}, {}).trees, 0U);
  EXPECT_TRUE(std::isnan(registration_noise(few.views, few.poses, {}, {}).pooled_m));
  EXPECT_TRUE(std::isnan(registration_noise(few.views, few.poses, {}, {}).clusters_m));
}

TEST(MapSharpness, TwoTreesSideBySideAreNoNoise) {
  Stand seen = views_of_stand(80, 0.05, 4);
  const RegistrationNoise alone = registration_noise(seen.views, seen.poses, {}, {});
  // A neighbour 0.7 m beside the first tree: their sights run together.
  for (std::size_t v = 0; v < seen.views.size(); ++v)
    seen.views[v].push_back(seen.views[v].front() + Eigen::Vector3d(0.7, 0.0, 0.0));
  const RegistrationNoise noise = registration_noise(seen.views, seen.poses, {}, {});
  EXPECT_EQ(alone.joined, 0U);
  EXPECT_EQ(noise.joined, 1U);
  EXPECT_EQ(noise.trees, alone.trees - 1);
  EXPECT_NEAR(noise.pooled_m, alone.pooled_m, 0.002);
  // In the paper's e_C they count. The neighbour turns with the views: 80 of 2,080 sights lie 0.7 m
  // from the middle of the cluster, where its 80 others are.
  EXPECT_DOUBLE_EQ(alone.clusters_m, alone.pooled_m);
  EXPECT_DOUBLE_EQ(alone.clusters_mean_m, alone.mean_m);
  const double sight = 2.0 * 0.05 * 0.05;
  EXPECT_NEAR(noise.clusters_m, std::sqrt(sight + 80.0 / 2080.0 * 0.7 * 0.7), 0.003);
  EXPECT_NEAR(noise.clusters_mean_m,
              (24.0 * std::sqrt(sight) + std::sqrt(sight + 0.5 * 0.7 * 0.7)) / 25.0, 0.003);
  // A tree that is seen where it is not, in half of the views, does count.
  Stand bent = views_of_stand(80, 0.05, 4);
  for (std::size_t v = 0; v < 40; ++v)
    bent.poses[v] = Pose(Eigen::Quaterniond::Identity(), {0.4, 0.0, 0.0}) * bent.poses[v];
  const RegistrationNoise blurred = registration_noise(bent.views, bent.poses, {}, {});
  EXPECT_EQ(blurred.joined, 0U);
  EXPECT_GT(blurred.pooled_m, 2.5 * alone.pooled_m);
}

TEST(MapSharpness, ViewsThatHurtAreFoundAndLeftOut) {
  Stand seen = views_of_stand(60, 0.03, 2);
  for (const std::size_t bad : {7U, 31U})
    seen.poses[bad] = Pose(Eigen::Quaterniond::Identity(), {0.25, 0.1, 0.0}) * seen.poses[bad];
  const RegistrationNoise before = registration_noise(seen.views, seen.poses, {}, {});
  const std::vector<char> keep = views_worth_keeping(before, 9.0, 0.1);
  for (std::size_t v = 0; v < keep.size(); ++v)
    EXPECT_EQ(keep[v], v == 7 || v == 31 ? 0 : 1) << v;
  const RegistrationNoise after = registration_noise(seen.views, seen.poses, keep, {});
  EXPECT_LT(after.pooled_m, 0.9 * before.pooled_m);
  EXPECT_EQ(after.sights, 58U * 25U);
  // Never more than the share, the worst first; none if not asked for.
  const std::vector<char> one = views_worth_keeping(before, 9.0, 0.02);
  EXPECT_EQ(std::count(one.begin(), one.end(), 0), 1);
  const std::vector<char> all = views_worth_keeping(before, 0.0, 0.5);
  EXPECT_EQ(std::count(all.begin(), all.end(), 0), 0);
}

}  // namespace
}  // namespace understory
