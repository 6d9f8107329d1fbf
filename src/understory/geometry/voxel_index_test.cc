#include "understory/geometry/voxel_index.h"

#include <gtest/gtest.h>

#include <map>

#include "understory/util/random.h"

namespace understory {
namespace {

// Keys from a small range, so that they come and go and lie in each other's way.
TEST(VoxelIndex, AgreesWithAnOrderedMapThroughAddingAndErasing) {
  Random random(4);
  VoxelIndex index;
  std::map<std::uint64_t, std::uint32_t> expected;
  const auto coordinate = [&] { return static_cast<int>(random.uniform(-8.0, 8.0)); };
  for (int step = 0; step < 20'000; ++step) {
    const std::uint64_t key = voxel_key(coordinate(), coordinate(), coordinate());
    const bool more = expected.size() < 900;
    if (expected.count(key) != 0 && !more) {
      index.erase(key);
      expected.erase(key);
    } else {
      index.set(key, static_cast<std::uint32_t>(step));
      expected[key] = static_cast<std::uint32_t>(step);
    }
    if (step % 500 != 0) continue;
    ASSERT_EQ(index.size(), expected.size());
    for (int x = -8; x < 8; ++x) {
      for (int y = -8; y < 8; ++y) {
        for (int z = -8; z < 8; ++z) {
          const auto found = expected.find(voxel_key(x, y, z));
          ASSERT_EQ(index.find(voxel_key(x, y, z)),
                    found == expected.end() ? VoxelIndex::kNone : found->second);
        }
      }
    }
  }
  EXPECT_GT(expected.size(), 500U);
  index.clear();
  EXPECT_EQ(index.size(), 0U);
  EXPECT_EQ(index.find(voxel_key(1, 2, 3)), VoxelIndex::kNone);
}

}  // namespace
}  // namespace understory
