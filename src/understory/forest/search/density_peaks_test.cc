#include "understory/forest/search/density_peaks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Points = std::vector<Eigen::Vector2f>;

void add_cluster(Random& random, double x, double y, double spread_m, int count, Points& points) {
  for (int i = 0; i < count; ++i)
    points.emplace_back(static_cast<float>(x + random.normal(0.0, spread_m)),
                        static_cast<float>(y + random.normal(0.0, spread_m)));
}

void add_even_points(Random& random, double half_m, int per_m2, Points& points) {
  const int count = static_cast<int>(4.0 * half_m * half_m) * per_m2;
  for (int i = 0; i < count; ++i)
    points.emplace_back(static_cast<float>(random.uniform(-half_m, half_m)),
                        static_cast<float>(random.uniform(-half_m, half_m)));
}

double clearest_near(const std::vector<DensityPeak>& peaks, const Eigen::Vector2d& place) {
  double contrast = 0.0;
  for (const DensityPeak& peak : peaks) {
    if ((peak.place - place).norm() < 0.02) contrast = std::max(contrast, peak.contrast);
  }
  return contrast;
}

TEST(DensityPeaks, LieWherePointsStandDenserThanAround) {
  Random random(3);
  Points points;
  add_even_points(random, 2.0, 300, points);
  add_cluster(random, 0.61, -0.37, 0.02, 20, points);
  add_cluster(random, -1.2, 1.1, 0.3, 300, points);  // a dense bush without a core
  const std::vector<DensityPeak> peaks = find_density_peaks(points, {});
  const double found = clearest_near(peaks, {0.61, -0.37});
  EXPECT_GT(found, 5.0);
  for (const DensityPeak& peak : peaks) {
    const bool elsewhere = (peak.place - Eigen::Vector2d(0.61, -0.37)).norm() > 0.1;
    EXPECT_TRUE(!elsewhere || peak.contrast < 0.8 * found) << peak.place.transpose();
  }
}

// Blocks have their borders at multiples of 8 m.
TEST(DensityPeaks, AreTheSameAcrossTheBorderOfABlock) {
  for (const double x : {-8.0, 0.0, 3.0, 8.01}) {
    Random random(5);
    Points points;
    add_cluster(random, x, 0.0, 0.02, 40, points);
    add_cluster(random, x + 0.25, 0.0, 0.05, 40, points);
    const std::vector<DensityPeak> peaks = find_density_peaks(points, {});
    EXPECT_GT(clearest_near(peaks, {x, 0.0}), 5.0) << x;
    const auto close = std::count_if(peaks.begin(), peaks.end(), [&](const DensityPeak& peak) {
      return (peak.place - Eigen::Vector2d(x, 0.0)).norm() < 0.03;
    });
    EXPECT_EQ(close, 1) << x;
  }
}

// Blocks one after the other use the same memory. The second cluster has the place of the first one
// in its own block, but for three centimetres, and is weaker.
TEST(DensityPeaks, OfABlockKnowNothingOfTheBlocksBefore) {
  constexpr double kBlockM = 8.0;
  Random random(9);
  Points strong;
  add_cluster(random, 4.0, 4.0, 0.02, 90, strong);
  Points weak;
  add_cluster(random, 4.03 + 2.0 * kBlockM, 4.0, 0.02, 30, weak);
  std::vector<DensityPeak> apart = find_density_peaks(strong, {});
  const std::vector<DensityPeak> second = find_density_peaks(weak, {});
  ASSERT_FALSE(apart.empty());
  ASSERT_FALSE(second.empty());
  apart.insert(apart.end(), second.begin(), second.end());
  Points both = strong;
  both.insert(both.end(), weak.begin(), weak.end());
  const std::vector<DensityPeak> together = find_density_peaks(both, {});
  ASSERT_EQ(together.size(), apart.size());
  for (std::size_t i = 0; i < apart.size(); ++i) {
    EXPECT_EQ(together[i].place, apart[i].place);
    EXPECT_EQ(together[i].contrast, apart[i].contrast);
  }
}

TEST(DensityPeaks, DependOnNeitherOrderNorThreads) {
  Random random(7);
  Points points;
  add_even_points(random, 9.0, 60, points);
  std::vector<DensityPeak> one;
  with_threads(1, [&] { one = find_density_peaks(points, {}); });
  std::reverse(points.begin(), points.end());
  std::vector<DensityPeak> other;
  with_threads(3, [&] { other = find_density_peaks(points, {}); });
  ASSERT_FALSE(one.empty());
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].place, other[i].place);
    EXPECT_EQ(one[i].contrast, other[i].contrast);
  }
}

}  // namespace
}  // namespace understory
