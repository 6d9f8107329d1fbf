#include "understory/geometry/plane/delaunay.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

using Eigen::Vector2d;

std::vector<Vector2d> random_points(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-40.0, 40.0);
  std::vector<Vector2d> points;
  for (int i = 0; i < n; ++i)
    points.emplace_back(uniform(random), uniform(random));
  return points;
}

double area(const std::vector<Vector2d>& p, const std::array<int, 3>& t) {
  const Vector2d a = p[static_cast<std::size_t>(t[1])] - p[static_cast<std::size_t>(t[0])];
  const Vector2d b = p[static_cast<std::size_t>(t[2])] - p[static_cast<std::size_t>(t[0])];
  return 0.5 * (a.x() * b.y() - a.y() * b.x());
}

// The definition itself: no point inside the circle around a triangle.
TEST(Delaunay, NoPointInsideAnyCircle) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto points = random_points(150, seed);
    const auto triangles = delaunay_triangles(points);
    ASSERT_GT(triangles.size(), 200U);
    for (const auto& t : triangles) {
      const Vector2d a = points[static_cast<std::size_t>(t[0])];
      const Vector2d b = points[static_cast<std::size_t>(t[1])] - a;
      const Vector2d c = points[static_cast<std::size_t>(t[2])] - a;
      ASSERT_GT(area(points, t), 0.0);
      const double d = 2.0 * (b.x() * c.y() - b.y() * c.x());
      const Vector2d centre((c.y() * b.squaredNorm() - b.y() * c.squaredNorm()) / d,
                            (b.x() * c.squaredNorm() - c.x() * b.squaredNorm()) / d);
      for (const Vector2d& point : points)
        ASSERT_GT((point - a - centre).norm(), centre.norm() * (1.0 - 1e-4) - 1e-3);
    }
  }
}

TEST(Delaunay, FillsTheHullOfAGrid) {
  std::vector<Vector2d> points;
  for (int x = 0; x < 8; ++x) {
    for (int y = 0; y < 5; ++y)
      points.emplace_back(3.0 * x, 3.0 * y);
  }
  points.push_back(points[7]);  // a double
  double covered = 0.0;
  for (const auto& t : delaunay_triangles(points))
    covered += area(points, t);
  EXPECT_NEAR(covered, 9.0 * 7 * 4, 1e-3);
  // Inner points have four neighbours at 3 m and some across at 4.24 m.
  const double l0 = mean_neighbour_distance(points);
  EXPECT_GT(l0, 3.0);
  EXPECT_LT(l0, 3.9);
}

TEST(Delaunay, LinesAndFewPointsHaveNone) {
  EXPECT_TRUE(delaunay_triangles({}).empty());
  EXPECT_TRUE(delaunay_triangles({{0, 0}, {1, 1}}).empty());
  EXPECT_TRUE(delaunay_triangles({{0, 0}, {1, 1}, {2, 2}, {3, 3}}).empty());
  EXPECT_EQ(mean_neighbour_distance({{0, 0}, {1, 1}, {2, 2}}), 0.0);
}

// Of a Poisson process the mean edge of the triangulation is 32 / (9 pi) / sqrt(density) = 1.132
// spacings (Miles 1970).
TEST(Delaunay, MeanDistanceOfARandomStand) {
  double sum = 0.0;
  for (unsigned seed = 1; seed <= 20; ++seed)
    sum += mean_neighbour_distance(random_points(1000, seed)) / 20;
  EXPECT_NEAR(sum, 1.132 * std::sqrt(6400.0 / 1000.0), 0.08);
}

TEST(Delaunay, NeighboursAreMutual) {
  const auto points = random_points(80, 3);
  const auto neighbours = natural_neighbours(points);
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    EXPECT_GE(neighbours[i].size(), 2U);
    for (const int j : neighbours[i]) {
      const auto& back = neighbours[static_cast<std::size_t>(j)];
      EXPECT_NE(std::find(back.begin(), back.end(), static_cast<int>(i)), back.end());
    }
  }
}

}  // namespace
}  // namespace understory
