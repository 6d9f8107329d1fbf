#include "understory/features/tree_tops.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

// Points on the upper side of a cone-shaped crown.
void add_crown(const Eigen::Vector3f& top, float radius, int count, Random& random,
               std::vector<Eigen::Vector3f>& points) {
  points.push_back(top);
  for (int k = 0; k < count; ++k) {
    const double r = radius * std::sqrt(random.uniform());
    const double angle = random.uniform(0.0, 2.0 * M_PI);
    points.emplace_back(top.x() + static_cast<float>(r * std::cos(angle)),
                        top.y() + static_cast<float>(r * std::sin(angle)),
                        top.z() - 0.1F - static_cast<float>(1.5 * r + 0.2 * random.uniform()));
  }
}

// P2 (1) against the definition: the mean of the products of the deviations, entry by entry.
TEST(TreeTops, ScatterIsEquation1) {
  Random random(1);
  std::vector<Eigen::Vector3f> points;
  for (int k = 0; k < 40; ++k)
    points.emplace_back(3.0 * random.normal(), random.normal(), 0.1 * random.normal());
  const Eigen::Matrix3d scatter = scatter_matrix(points);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double products = 0.0;
      double mean_i = 0.0;
      double mean_j = 0.0;
      for (const Eigen::Vector3f& point : points) {
        products += static_cast<double>(point[i]) * static_cast<double>(point[j]) / 40.0;
        mean_i += static_cast<double>(point[i]) / 40.0;
        mean_j += static_cast<double>(point[j]) / 40.0;
      }
      EXPECT_NEAR(scatter(i, j), products - mean_i * mean_j, 1e-5);
    }
  }
}

TEST(TreeTops, CrownsAreKeptAndWiresAreNot) {
  Random random(2);
  std::vector<Eigen::Vector3f> points;
  add_crown({0.0F, 0.0F, 12.0F}, 1.4F, 80, random, points);
  add_crown({5.0F, 1.0F, 9.0F}, 1.4F, 80, random, points);
  for (int k = 0; k < 200; ++k)  // a wire, highest in its middle
    points.emplace_back(-20.0F + 0.05F * static_cast<float>(k), 8.0F,
                        14.0F - 0.001F * static_cast<float>(std::abs(k - 100)));
  const std::vector<TreeTop> tops = find_tree_tops(points, {});
  ASSERT_EQ(tops.size(), 2U);
  EXPECT_EQ(tops[0].point, Eigen::Vector3f(0.0F, 0.0F, 12.0F));
  EXPECT_EQ(tops[1].point, Eigen::Vector3f(5.0F, 1.0F, 9.0F));
  EXPECT_GT(tops[0].smallest_eigenvalue_m2, 0.01);
  TreeTopConfig all;
  all.least_eigenvalue_m2 = -1.0;
  EXPECT_GT(find_tree_tops(points, all).size(), 2U);
  const std::vector<Eigen::Vector3f> kept = top_points(points, tops);
  EXPECT_EQ(kept.size(), tops[0].neighbours.size() + tops[1].neighbours.size());
}

TEST(TreeTops, OfARasterAreItsCrowns) {
  Raster canopy;
  canopy.cell_m = 0.5;
  canopy.columns = canopy.rows = 80;
  canopy.z0 = 2.0;
  canopy.values.assign(80 * 80, std::nanf(""));
  const std::vector<Eigen::Vector3d> trees{
      {10.2, 10.1, 20.0}, {14.0, 11.0, 15.0}, {30.3, 25.6, 8.0}};
  for (int row = 0; row < 80; ++row) {
    for (int column = 0; column < 80; ++column) {
      double highest = -1.0;
      for (const Eigen::Vector3d& tree : trees) {
        const double away =
            std::hypot(0.5 * (column + 0.5) - tree.x(), 0.5 * (row + 0.5) - tree.y());
        if (away < 2.0) highest = std::max(highest, tree.z() - away * away);
      }
      if (highest > 0.0)
        canopy.values[canopy.index(column, row)] = static_cast<float>(highest - 2.0);
    }
  }
  const std::vector<CanopyTop> tops = find_canopy_tops(canopy, {});
  ASSERT_EQ(tops.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_LT((tops[k].at - trees[k].head<2>()).norm(), 0.25);
    EXPECT_NEAR(tops[k].height_m, trees[k].z(), 0.3);
  }
}

}  // namespace
}  // namespace understory
