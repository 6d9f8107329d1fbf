#include "understory/graph/self_correction/blur_change.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// 500 trees on 100 by 100 m, each seen 40 times. The stand is of `stand`, the noise of `sights`.
SparsePoints sights(double sd_m, std::uint64_t stand, std::uint64_t sights) {
  Random trees(stand);
  Random noise(sights);
  SparsePoints points;
  for (int tree = 0; tree < 500; ++tree) {
    const Eigen::Vector3d foot(trees.uniform(0.0, 100.0), trees.uniform(-50.0, 50.0), 0.0);
    for (int k = 0; k < 40; ++k)
      points.push_back(foot + sd_m * Eigen::Vector3d(noise.normal(), noise.normal(), 0.0));
  }
  return points;
}

TEST(BlurChange, AnEqualMapHasNotChanged) {
  const SparsePoints map = sights(0.05, 1, 2);
  const BlurChange change = blur_change(map, map, {});
  EXPECT_EQ(change.ratio, 1.0);
  EXPECT_EQ(change.deviations, 0.0);
  EXPECT_EQ(blur_change({}, {}, {}).deviations, 0.0);
}

TEST(BlurChange, TellsASmallBlurSurely) {
  const SparsePoints sharp = sights(0.050, 1, 2);
  const SparsePoints blurred = sights(0.055, 1, 2);
  const BlurChange worse = blur_change(sharp, blurred, {});
  EXPECT_GT(worse.ratio, 1.01);
  EXPECT_GT(worse.deviations, 5.0);
  EXPECT_LT(blur_change(blurred, sharp, {}).deviations, -5.0);
}

// Other sights of the same sharpness, and the map moved as a whole: chance alone.
TEST(BlurChange, ChanceIsSeldomMoreThanTwoDeviations) {
  int beyond = 0;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const SparsePoints first = sights(0.05, k, 100 + k);
    SparsePoints moved = first;
    for (Eigen::Vector3d& point : moved)
      point += Eigen::Vector3d(0.037, -0.081, 0.0);
    beyond += std::abs(blur_change(first, sights(0.05, k, 200 + k), {}).deviations) > 2.0 ? 1 : 0;
    beyond += std::abs(blur_change(first, moved, {}).deviations) > 2.0 ? 1 : 0;
  }
  EXPECT_LE(beyond, 4);
}

}  // namespace
}  // namespace understory
