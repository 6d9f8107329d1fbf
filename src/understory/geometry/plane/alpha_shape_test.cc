#include "understory/geometry/plane/alpha_shape.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <random>
#include <set>

#include "understory/util/parallel.h"

namespace understory {
namespace {

using Eigen::Vector2d;

std::vector<Vector2d> blob(const Vector2d& at, double sd, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, sd);
  std::vector<Vector2d> points;
  for (int i = 0; i < count; ++i)
    points.emplace_back(at.x() + noise(random), at.y() + noise(random));
  return points;
}

TEST(AlphaClusters, TellTreesApartAndLeaveOutSinglePoints) {
  std::vector<Vector2d> points = blob({0.0, 0.0}, 0.05, 40, 1);
  const auto second = blob({2.0, 0.0}, 0.05, 30, 2);
  points.insert(points.end(), second.begin(), second.end());
  points.emplace_back(50.0, 50.0);
  points.emplace_back(-3.0, 1.5);
  points.emplace_back(-3.9, 1.5);  // within twice the radius, but two points make no triangle
  const std::vector<int> clusters = alpha_clusters(points, 0.5);
  for (std::size_t i = 0; i < 40; ++i)
    EXPECT_EQ(clusters[i], 0);
  for (std::size_t i = 40; i < 70; ++i)
    EXPECT_EQ(clusters[i], 1);
}

// The definition itself, by all triples. A triangle belongs to the shape if its circle is not
// larger than the radius and holds no other point.
std::vector<std::set<std::size_t>> by_all_triples(const std::vector<Vector2d>& p, double radius) {
  std::vector<std::set<std::size_t>> clusters;
  for (std::size_t a = 0; a < p.size(); ++a) {
    for (std::size_t b = a + 1; b < p.size(); ++b) {
      for (std::size_t c = b + 1; c < p.size(); ++c) {
        Eigen::Matrix2d m;
        m << (p[b] - p[a]).transpose(), (p[c] - p[a]).transpose();
        const Vector2d centre = p[a] + m.inverse() * (0.5 * Vector2d((p[b] - p[a]).squaredNorm(),
                                                                     (p[c] - p[a]).squaredNorm()));
        const double r = (centre - p[a]).norm();
        if (r > radius) continue;
        bool empty = true;
        for (std::size_t d = 0; d < p.size(); ++d)
          empty &= d == a || d == b || d == c || (p[d] - centre).norm() > r;
        if (!empty) continue;
        std::set<std::size_t> joined = {a, b, c};
        std::erase_if(clusters, [&](const std::set<std::size_t>& other) {
          const bool touches = other.contains(a) || other.contains(b) || other.contains(c);
          if (touches) joined.insert(other.begin(), other.end());
          return touches;
        });
        clusters.push_back(joined);
      }
    }
  }
  return clusters;
}

TEST(AlphaClusters, AgreesWithTheDefinition) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(0.0, 8.0);
  for (int trial = 0; trial < 5; ++trial) {
    std::vector<Vector2d> points;
    for (int i = 0; i < 90; ++i)
      points.emplace_back(place(random), place(random));
    const std::vector<int> found = alpha_clusters(points, 0.5);
    const auto expected = by_all_triples(points, 0.5);
    EXPECT_GT(expected.size(), 3U);
    for (const auto& cluster : expected) {
      const int number = found[*cluster.begin()];
      EXPECT_GE(number, 0);
      for (std::size_t i = 0; i < points.size(); ++i)
        EXPECT_EQ(found[i] == number, cluster.contains(i)) << i;
    }
  }
}

TEST(AlphaClusters, ASpotWithoutSpreadIsACluster) {
  const std::vector<Vector2d> points(20, Vector2d(3.0, 4.0));
  EXPECT_EQ(alpha_clusters(points, 0.5), std::vector<int>(20, 0));
  EXPECT_TRUE(alpha_clusters({}, 0.5).empty());
}

TEST(AlphaClusters, SameForAnyNumberOfThreads) {
  std::vector<Vector2d> points;
  for (unsigned tree = 0; tree < 200; ++tree) {
    const auto sights = blob({3.0 * (tree % 20), 3.0 * std::floor(tree / 20.0)}, 0.2, 30, tree);
    points.insert(points.end(), sights.begin(), sights.end());
  }
  std::vector<int> one;
  std::vector<int> two;
  with_threads(1, [&] { one = alpha_clusters(points, 0.5); });
  with_threads(2, [&] { two = alpha_clusters(points, 0.5); });
  EXPECT_EQ(one, two);
}

}  // namespace
}  // namespace understory
