#include "understory/output/copc/copc_octree.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

using Key = std::tuple<int, int, int, int>;

class CopcOctreeTest : public ::testing::Test {
 protected:
  // The nodes over a cube from `low` on; each point has its number as tree_id.
  std::map<Key, std::vector<LasPointSteps>> built(const std::vector<LasPointSteps>& points,
                                                  const CopcCube& cube, const CopcShape& shape,
                                                  std::uint64_t waiting) {
    PointCells cells(folder_ / "map.copc.laz", 8, waiting);
    for (const LasPointSteps& point : points)
      cells.add(point);
    cells.settle();
    std::map<Key, std::vector<LasPointSteps>> nodes;
    build_copc_octree(
        cells, cube, shape, folder_ / "map.copc.laz", {}, [&](std::vector<CopcNode>&& some) {
          for (CopcNode& node : some) {
            const Key key{node.key.level, node.key.at[0], node.key.at[1], node.key.at[2]};
            EXPECT_EQ(nodes.count(key), 0U);
            nodes[key] = std::move(node.points);
          }
        });
    EXPECT_TRUE(std::filesystem::is_empty(folder_.path())) << "nothing stays on the disk";
    return nodes;
  }

  static std::vector<LasPointSteps> cloud(std::size_t count) {
    std::mt19937 random(3);
    std::vector<LasPointSteps> points(count);
    for (std::size_t i = 0; i < count; ++i) {
      // A slope with a thick clump on it.
      const auto spread = i % 3 == 0 ? 200U : 60'000U;
      points[i].x = static_cast<std::int32_t>(random() % spread) - 30'000;
      points[i].y = static_cast<std::int32_t>(random() % spread) - 30'000;
      points[i].z = points[i].x / 4 + static_cast<std::int32_t>(random() % 500);
      points[i].tree_id = static_cast<std::uint32_t>(i);
    }
    return points;
  }
  const CopcCube cube_{{-30'001, -30'001, -30'001}, 60'002.7};

  static void expect_whole(const std::map<Key, std::vector<LasPointSteps>>& nodes,
                           std::size_t count, const CopcCube& cube) {
    std::set<std::uint32_t> seen;
    for (const auto& [key, points] : nodes) {
      const auto [level, x, y, z] = key;
      EXPECT_FALSE(points.empty());
      EXPECT_TRUE(level == 0 || nodes.count({level - 1, x / 2, y / 2, z / 2}) == 1)
          << "no way to it";
      const std::array<int, 3> at{x, y, z};
      for (const LasPointSteps& point : points) {
        const CopcCube::Place place = cube.place({point.x, point.y, point.z});
        for (std::size_t axis = 0; axis < 3; ++axis)
          EXPECT_EQ(static_cast<int>(place[axis] >> (CopcCube::kBits - level)), at[axis]);
        EXPECT_TRUE(seen.insert(point.tree_id).second) << "point " << point.tree_id << " twice";
      }
    }
    EXPECT_EQ(seen.size(), count);
  }

  test::TemporaryFolder folder_;
};

TEST_F(CopcOctreeTest, EveryPointLiesOnceInTheCubeOfItsNode) {
  const std::vector<LasPointSteps> points = cloud(30'000);
  for (const std::uint64_t in_memory : {700ULL, 5'000ULL, 1'000'000ULL}) {
    const auto nodes = built(points, cube_, {in_memory, 300, 20}, 1'000);
    EXPECT_GT(nodes.size(), 20U);
    expect_whole(nodes, points.size(), cube_);
  }
}

TEST_F(CopcOctreeTest, TheDiskChangesNothing) {
  const std::vector<LasPointSteps> points = cloud(20'000);
  const auto in_memory = built(points, cube_, {2'000, 300, 20}, 1'000'000);
  const auto on_disk = built(points, cube_, {2'000, 300, 20}, 100);
  ASSERT_EQ(in_memory.size(), on_disk.size());
  for (const auto& [key, node] : in_memory) {
    const std::vector<LasPointSteps>& other = on_disk.at(key);
    ASSERT_EQ(node.size(), other.size());
    for (std::size_t i = 0; i < node.size(); ++i)
      EXPECT_EQ(node[i].tree_id, other[i].tree_id);
  }
}

// The level of detail: the root shows the whole cloud, evenly.
TEST_F(CopcOctreeTest, TheRootHasOnePointInACellAtMost) {
  const auto nodes = built(cloud(30'000), cube_, {5'000, 300, 1}, 1'000'000);
  std::set<std::tuple<int, int, int>> cells;
  const std::vector<LasPointSteps>& root = nodes.at({0, 0, 0, 0});
  EXPECT_GT(root.size(), 1'000U);
  for (const LasPointSteps& point : root) {
    const auto cell = [](std::int32_t value) {
      return static_cast<int>(128.0 * (value + 30'001.0) / 60'002.7);
    };
    EXPECT_TRUE(cells.insert({cell(point.x), cell(point.y), cell(point.z)}).second);
  }
}

TEST_F(CopcOctreeTest, ThousandsAtOnePlaceAndTheEndsOfTheNumbersAreKept) {
  std::vector<LasPointSteps> points(4'000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].x = points[i].y = points[i].z = 7;
    points[i].tree_id = static_cast<std::uint32_t>(i);
  }
  points[100].x = points[100].y = points[100].z = std::numeric_limits<std::int32_t>::max();
  points[3'000].x = points[3'000].z = std::numeric_limits<std::int32_t>::min();
  constexpr std::int64_t kLow = std::numeric_limits<std::int32_t>::min();
  const CopcCube cube({kLow, kLow, kLow}, 4'294'967'295.001);
  expect_whole(built(points, cube, {500, 100, 10}, 300), points.size(), cube);
}

TEST(CopcCubeTest, PlacesLieInTheCubeAndInTheOrderOfTheSteps) {
  const CopcCube cube({10, 20, 30}, 7.001);
  EXPECT_EQ(cube.place({10, 20, 30}), (CopcCube::Place{0, 0, 0}));
  EXPECT_EQ(cube.place({9, 5, 1'000})[2], (1U << 30) - 1) << "beyond it, on its border";
  EXPECT_EQ(cube.place({17, 20, 30})[0] >> 29, 1U);
  EXPECT_DOUBLE_EQ(cube.side_steps(3), 7.001 / 8.0);
  EXPECT_EQ(cube.deepest(), 3);
}

}  // namespace
}  // namespace understory
