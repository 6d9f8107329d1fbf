#include "understory/forest/cell_index.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "understory/util/random.h"

namespace understory {
namespace {

CellIndex::Points scattered(std::size_t count, float width_m, float depth_m, Random& random) {
  CellIndex::Points points;
  for (std::size_t i = 0; i < count; ++i)
    points.emplace_back(random.uniform(0.0, width_m), random.uniform(0.0, depth_m));
  return points;
}

std::vector<std::uint32_t> ids_of(const CellIndex& index,
                                  const std::vector<CellIndex::Range>& ranges) {
  std::vector<std::uint32_t> ids;
  for (const auto& [begin, end] : ranges) {
    for (std::uint32_t i = begin; i < end; ++i)
      ids.push_back(index.id(i));
  }
  return ids;
}

TEST(LivePoints, KeepTheirOrderWhereOthersGo) {
  LivePoints live(11);
  for (const std::uint32_t gone : {0U, 4U, 5U, 10U})
    live.remove(gone);
  ASSERT_EQ(live.size(), 7U);
  std::vector<std::uint32_t> left;
  for (std::size_t k = 0; k < live.size(); ++k)
    left.push_back(live.at(k));
  EXPECT_EQ(left, (std::vector<std::uint32_t>{1, 2, 3, 6, 7, 8, 9}));
  EXPECT_FALSE(live.holds(5));
  EXPECT_TRUE(live.holds(6));
}

// An index from which points were taken answers as one that was made of those that are left.
TEST(CellIndex, ForgettingIsAsGoodAsSortingAnew) {
  Random random(1);
  const CellIndex::Points points = scattered(4000, 20.0F, 3.0F, random);  // rows of 250 cells
  const Eigen::Vector2f low = Eigen::Vector2f::Zero();
  LivePoints live(points.size());
  CellIndex index(points, live, low, 0.08F);
  for (int turn = 0; turn < 60; ++turn) {
    const Eigen::Vector2f place(random.uniform(0.0, 20.0), random.uniform(0.0, 3.0));
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      if (live.holds(i) && (points[i] - place).norm() < 0.3F) live.remove(i);
    }
    EXPECT_GT(index.forget(live, place, 0.3F), 0U);
    const CellIndex anew(points, live, low, 0.08F);
    const Eigen::Vector2f asked(random.uniform(0.0, 20.0), random.uniform(0.0, 3.0));
    std::vector<CellIndex::Range> here;
    std::vector<CellIndex::Range> there;
    ASSERT_EQ(index.square(asked, 0.9F, here), anew.square(asked, 0.9F, there));
    ASSERT_EQ(ids_of(index, here), ids_of(anew, there));
    ASSERT_EQ(index.ring(asked, 0.3F, 0.5F, here), anew.ring(asked, 0.3F, 0.5F, there));
    ASSERT_EQ(ids_of(index, here), ids_of(anew, there));
  }
}

TEST(CellIndex, GivesAllPointsNearAPlace) {
  Random random(2);
  const CellIndex::Points points = scattered(3000, 9.0F, 7.0F, random);
  const CellIndex index(points, LivePoints(points.size()), Eigen::Vector2f::Zero(), 0.3F);
  const Eigen::Vector2f place(4.0F, 3.0F);
  std::vector<CellIndex::Range> ranges;
  const std::uint32_t count = index.square(place, 0.5F, ranges);
  const std::vector<std::uint32_t> found = ids_of(index, ranges);
  EXPECT_EQ(found.size(), count);
  EXPECT_LT(count, 300U);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if ((points[i] - place).cwiseAbs().maxCoeff() > 0.5F) continue;
    EXPECT_NE(std::find(found.begin(), found.end(), i), found.end());
  }
}

}  // namespace
}  // namespace understory
