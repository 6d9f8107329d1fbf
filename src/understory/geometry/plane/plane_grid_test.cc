#include "understory/geometry/plane/plane_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "understory/util/random.h"

namespace understory {
namespace {

SparsePoints some_points(int count, double reach_m, std::uint64_t seed) {
  Random random(seed);
  SparsePoints points;
  for (int i = 0; i < count; ++i)
    points.emplace_back(random.uniform(-reach_m, reach_m), random.uniform(-reach_m, reach_m),
                        random.uniform(-2.0, 2.0));
  return points;
}

double squared(const Eigen::Vector3d& d, double height_weight) {
  return d.x() * d.x() + d.y() * d.y() + height_weight * d.z() * d.z();
}

// Places inside and far outside of the grid, in the plane and in space.
TEST(PlaneGridSearch, TheNearestAndTheNextAreThoseOfAllPoints) {
  const SparsePoints points = some_points(120, 30.0, 7);
  const PlaneGrid grid(points);
  Random random(8);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d at(random.uniform(-80.0, 80.0), random.uniform(-80.0, 80.0),
                             random.uniform(-3.0, 3.0));
    for (const double weight : {0.0, 1.0}) {
      std::vector<double> all;
      for (const Eigen::Vector3d& point : points)
        all.push_back(squared(point - at, weight));
      std::sort(all.begin(), all.end());
      const PlaneGrid::Lone found = grid.nearest_and_others(at, weight);
      EXPECT_DOUBLE_EQ(found.nearest.squared_m2, all[0]);
      EXPECT_LE(found.others_m, std::sqrt(all[1]) * (1.0 + 1e-12));
      EXPECT_GE(found.others_m, std::sqrt(all[0]) * (1.0 - 1e-12));
    }
  }
}

TEST(PlaneGridSearch, NothingIsFoundBeyondTheLimitOrInAnEmptyGrid) {
  const PlaneGrid grid({{0.0, 0.0, 0.0}, {10.0, 0.0, 0.0}});
  EXPECT_EQ(grid.nearest({4.0, 0.0, 0.0}, 3.9, 0.0).index, -1);
  EXPECT_EQ(grid.nearest({4.0, 0.0, 0.0}, 4.1, 0.0).index, 0);
  EXPECT_EQ(PlaneGrid({}).nearest({0.0, 0.0, 0.0}, 1e9, 0.0).index, -1);
  EXPECT_EQ(PlaneGrid({}).nearest_and_others({0.0, 0.0, 0.0}, 0.0).nearest.index, -1);
}

// A regression: a pose of NaN, from two scans a nanosecond apart, led out of the cells.
TEST(PlaneGridSearch, NothingIsNearAPlaceThatIsNoNumber) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const PlaneGrid grid({{0.0, 0.0, 0.0}, {10.0, 0.0, 0.0}, {10.0, 10.0, 0.0}});
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector3d at(5.0, 5.0, 0.0);
      at[axis] = bad;
      EXPECT_EQ(grid.nearest(at, 100.0, 0.0).index, -1);
      EXPECT_EQ(grid.nearest_and_others(at, 0.0).nearest.index, -1);
    }
  }
}

// Of two points at one distance the first one is found, so results do not depend on the cells.
TEST(PlaneGridSearch, OfEqualPointsItIsTheFirst) {
  const PlaneGrid grid({{1.0, 0.0, 0.0}, {-1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}});
  EXPECT_EQ(grid.nearest(Eigen::Vector3d::Zero(), 5.0, 0.0).index, 0);
}

TEST(PlaneGridSearch, EveryPointWithinARadiusIsVisitedOnce) {
  const SparsePoints points = some_points(200, 20.0, 9);
  const PlaneGrid grid(points);
  const Eigen::Vector3d at(3.0, -4.0, 0.0);
  std::multiset<int> visited;
  grid.around(at, 6.0, [&](int index) { visited.insert(index); });
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const bool near = (points[static_cast<std::size_t>(i)] - at).head<2>().norm() <= 6.0;
    EXPECT_LE(visited.count(i), 1U) << i;
    EXPECT_GE(visited.count(i), near ? 1U : 0U) << i;
  }
}

}  // namespace
}  // namespace understory
