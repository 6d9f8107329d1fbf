#include "understory/registration/cell_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "understory/util/random.h"

namespace understory::internal {
namespace {

using Place = CellBlocks::Place;

// Cells around the origin, some of them taken away again, beside a plain map of the same.
struct BlocksAndMap {
  CellBlocks blocks;
  std::map<Place, std::uint32_t> plain;
};

Place random_place(Random& random) {
  const auto one = [&] { return static_cast<int>(random.uniform(-9.0, 9.0)); };
  return {one(), one(), one()};
}

BlocksAndMap random_cells(Random& random) {
  BlocksAndMap pair;
  for (std::uint32_t i = 0; i < 900; ++i) {
    const Place at = random_place(random);
    pair.blocks.set(at, i);
    pair.plain[at] = i;
  }
  for (int i = 0; i < 600; ++i) {
    const Place at = random_place(random);
    if (pair.plain.erase(at) != 0) pair.blocks.erase(at);
  }
  return pair;
}

int steps_apart(const Place& a, const Place& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

TEST(CellBlocks, FindTheCellsNearAPlace) {
  Random random(4);
  const BlocksAndMap pair = random_cells(random);
  ASSERT_GT(pair.plain.size(), 500U);
  std::vector<Place> places;
  for (const auto& [at, own] : pair.plain)
    places.push_back(at);
  // Also where there is none, in a block without any.
  for (int i = 8; i < 16; ++i)
    places.push_back({i, 2, -3});
  int reach = 0;
  for (const Place& at : places) {
    reach = (reach + 1) % 5;
    std::set<std::uint32_t> expected;
    for (const auto& [place, cell] : pair.plain) {
      if (steps_apart(place, at) <= reach) expected.insert(cell);
    }
    std::set<std::uint32_t> found;
    pair.blocks.for_each_near(at, reach, [&](std::uint32_t cell, int x, int y, int z) {
      EXPECT_TRUE(found.insert(cell).second);
      EXPECT_EQ(pair.plain.at({at[0] + x, at[1] + y, at[2] + z}), cell);
    });
    EXPECT_EQ(found, expected);
  }
}

TEST(CellBlocks, TellWhatAChangeAffects) {
  Random random(5);
  BlocksAndMap pair = random_cells(random);
  const auto reach_of = [](std::uint32_t cell) { return static_cast<int>(cell % 4); };
  for (int round = 0; round < 20; ++round) {
    std::vector<Place> changed;
    for (int i = 0; i < 6; ++i)
      changed.push_back(random_place(random));
    // Cells that went away count as changes too.
    if (!pair.plain.empty()) {
      changed.push_back(pair.plain.begin()->first);
      pair.blocks.erase(changed.back());
      pair.plain.erase(changed.back());
    }
    for (const Place& at : changed)
      pair.blocks.mark_changed(at);
    std::set<std::uint32_t> expected;
    for (const auto& [place, cell] : pair.plain) {
      for (const Place& at : changed) {
        if (reach_of(cell) > 0 && steps_apart(place, at) <= reach_of(cell)) expected.insert(cell);
      }
    }
    std::set<std::uint32_t> found;
    pair.blocks.for_each_affected(
        reach_of, [&](std::uint32_t cell) { EXPECT_TRUE(found.insert(cell).second); });
    EXPECT_EQ(found, expected);
    pair.blocks.forget_changes();
    pair.blocks.for_each_affected(reach_of, [](std::uint32_t) { FAIL() << "nothing changed"; });
  }
}

}  // namespace
}  // namespace understory::internal
