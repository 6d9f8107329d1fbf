#include "understory/forest/ground/height_column.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// A tree of 20 m: its crown between 8 and 20 m.
HeightColumn tree() {
  HeightColumn column;
  for (std::size_t metre = 0; metre < 8; ++metre)
    column.points[metre] = 50;  // stem
  for (std::size_t metre = 8; metre < 20; ++metre)
    column.points[metre] = 400;
  return column;
}

TEST(HeightColumn, TheTopIsWherePointsSuddenlyBecomeFew) {
  HeightColumn column = tree();
  EXPECT_EQ(column.top(0, HeightColumn::kMetres), 19);
  for (std::size_t metre = 20; metre < 60; ++metre)
    column.points[metre] = 3;  // ghosts in the sky
  EXPECT_EQ(column.top(0, HeightColumn::kMetres), 19);
}

TEST(HeightColumn, AThinTipBelongsToTheTree) {
  HeightColumn column = tree();
  column.points[20] = 40;
  column.points[21] = 12;
  EXPECT_EQ(column.top(0, HeightColumn::kMetres), 21);
}

// A sparse lidar sees the stem beside it a hundred times as often as the tip far above.
TEST(HeightColumn, ATipOfFewPointsBelongsToTheTreeWhereItEndsSuddenly) {
  HeightColumn column;
  column.points = {4385, 4372, 3647, 3028, 2162, 1334, 1126, 731, 362,
                   440,  304,  138,  76,   36,   32,   18,   7};
  EXPECT_EQ(column.connected_end(0, 3), 13) << "the rest is under a hundredth of the fullest metre";
  EXPECT_EQ(column.top(0, 13), 16);
}

TEST(HeightColumn, WhatHangsAboveAGapIsNoTip) {
  HeightColumn column;
  column.points = {4385, 4372, 3647, 3028, 2162, 1334, 1126, 731, 362, 440, 304, 138, 76, 36};
  column.points[25] = 30;
  EXPECT_EQ(column.top(0, 13), 13);
}

TEST(HeightColumn, GhostsThatThinOutAreNoTip) {
  HeightColumn column;
  column.points = {14026, 4148, 3411, 2412, 1611, 1418, 1135, 586, 561, 349, 249, 123, 21,
                   6,     4,    3,    2,    4,    3,    2,    1,   1,   1,   0,   1};
  EXPECT_EQ(column.top(0, column.connected_end(0, 3)), 12);
}

TEST(HeightColumn, WhatHangsTogetherEndsAtAWideGap) {
  HeightColumn column = tree();
  EXPECT_EQ(column.connected_end(3, 3), 20);
  column.points[22] = 300;  // a gap of two metres: another layer of the crown
  EXPECT_EQ(column.connected_end(3, 3), 23);
  column.points[27] = 300;  // of four: a bird, another crown
  EXPECT_EQ(column.connected_end(3, 3), 23);
  column.points[30] = 1;
  EXPECT_EQ(column.connected_end(3, 10), 28) << "a single ghost is no end of a crown";
}

TEST(HeightColumn, NothingAboveIsNoTop) {
  const HeightColumn empty;
  EXPECT_EQ(empty.connected_end(5, 3), 5);
}

TEST(HeightColumn, TheLastMetreTakesAllThatIsHigher) {
  EXPECT_EQ(HeightColumn::metre_of(0.99), 0U);
  EXPECT_EQ(HeightColumn::metre_of(1.0), 1U);
  EXPECT_EQ(HeightColumn::metre_of(500.0), static_cast<std::size_t>(HeightColumn::kMetres - 1));
}

}  // namespace
}  // namespace understory
