#include "understory/util/stable_sort.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace understory {
namespace {

// Counts how often one of its objects does not lie where its alignment asks for.
struct alignas(64) Wide {
  Wide() { look(); }
  Wide(const Wide& other) : key(other.key), place(other.place) { look(); }
  Wide& operator=(const Wide& other) = default;
  ~Wide() = default;
  void look() const { misplaced += reinterpret_cast<std::uintptr_t>(this) % 64 != 0 ? 1 : 0; }

  int key = 0;
  int place = 0;
  static inline int misplaced = 0;
};

struct Narrow {
  int key = 0;
  int place = 0;
};

template <typename T>
class StableSort : public ::testing::Test {};
using Types = ::testing::Types<Wide, Narrow>;
TYPED_TEST_SUITE(StableSort, Types);

// More than 128 KB: malloc then gives memory of which only 16 bytes are sure to be aligned.
TYPED_TEST(StableSort, WhatIsEqualKeepsItsOrder) {
  std::vector<TypeParam> items(20'000);
  for (int i = 0; i < 20'000; ++i) {
    items[static_cast<std::size_t>(i)].key = i * 7919 % 100;
    items[static_cast<std::size_t>(i)].place = i;
  }
  sort_stably(items, [](const TypeParam& a, const TypeParam& b) { return a.key < b.key; });
  ASSERT_EQ(items.size(), 20'000U);
  for (std::size_t i = 1; i < items.size(); ++i) {
    const TypeParam& before = items[i - 1];
    const TypeParam& item = items[i];
    ASSERT_TRUE(before.key < item.key || (before.key == item.key && before.place < item.place))
        << i;
  }
  EXPECT_EQ(Wide::misplaced, 0);
}

}  // namespace
}  // namespace understory
