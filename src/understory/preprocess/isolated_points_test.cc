#include "understory/preprocess/isolated_points.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

constexpr int kRings = 4;
constexpr int kColumns = 360;

// A round wall 5 m away, a point a degree (9 cm), column by column.
Scan round_wall() {
  Scan scan;
  scan.ring_count = kRings;
  for (int column = 0; column < kColumns; ++column) {
    for (int ring = 0; ring < kRings; ++ring) {
      ScanPoint point;
      const double azimuth = column * 0.017453292519943295;
      point.x = static_cast<float>(5.0 * std::cos(azimuth));
      point.y = static_cast<float>(5.0 * std::sin(azimuth));
      point.z = static_cast<float>(ring);
      point.ring = static_cast<std::uint16_t>(ring);
      scan.points.push_back(point);
    }
  }
  return scan;
}

std::size_t place(int column, int ring) {
  return static_cast<std::size_t>(column * kRings + ring);
}

void pull_in(ScanPoint& point, float share) {
  point.x *= share;
  point.y *= share;
  point.z *= share;
}

TEST(IsolatedPoints, AFlakeBeforeAWallGoes) {
  Scan scan = round_wall();
  pull_in(scan.points[place(100, 2)], 0.4F);
  std::vector<std::uint8_t> keep;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 1U);
  ASSERT_EQ(keep.size(), scan.points.size());
  for (std::size_t i = 0; i < keep.size(); ++i)
    EXPECT_EQ(keep[i], i == place(100, 2) ? 0 : 1) << i;
}

// The ends of a ring have one neighbour, and a stem of two returns is company for itself. What a
// box already took out stays out.
TEST(IsolatedPoints, WhatHasCompanyStays) {
  Scan scan = round_wall();
  pull_in(scan.points[place(50, 1)], 0.4F);
  pull_in(scan.points[place(51, 1)], 0.4F);
  std::vector<std::uint8_t> keep(scan.points.size(), 1);
  keep[7] = 0;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 0U);
  EXPECT_EQ(keep[7], 0);
  EXPECT_EQ(keep[place(0, 0)], 1);
  EXPECT_EQ(keep[place(kColumns - 1, 3)], 1);
}

TEST(IsolatedPoints, FarPointsMayStandAlone) {
  Scan scan = round_wall();
  pull_in(scan.points[place(100, 2)], 2.0F);
  std::vector<std::uint8_t> keep;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 0U);
  EXPECT_TRUE(keep.empty());
}

// The flake goes; the wall behind it, the weaker echo of the same beam, has the wall beside it.
TEST(IsolatedPoints, ASecondReturnBehindAFlakeStays) {
  Scan scan = round_wall();
  ScanPoint flake = scan.points[place(100, 2)];
  pull_in(flake, 0.4F);
  scan.points[place(100, 2)].return_index = 1;
  scan.points.insert(scan.points.begin() + static_cast<std::ptrdiff_t>(place(100, 2)), flake);
  std::vector<std::uint8_t> keep;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 1U);
  EXPECT_EQ(keep[place(100, 2)], 0);
  EXPECT_EQ(keep[place(100, 2) + 1], 1);
}

TEST(IsolatedPoints, WithoutAnOrderNothingGoes) {
  Scan scan = round_wall();
  for (std::size_t i = 0; i < scan.points.size(); ++i)  // 7 has no factor of the number of points
    std::swap(scan.points[i], scan.points[i * 7919 % scan.points.size()]);
  std::vector<std::uint8_t> keep;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 0U);
  scan = round_wall();
  scan.ring_count = 0;
  pull_in(scan.points[place(100, 2)], 0.4F);
  EXPECT_EQ(drop_isolated(scan, {}, keep), 0U);
  scan.points.clear();
  scan.ring_count = kRings;
  EXPECT_EQ(drop_isolated(scan, {}, keep), 0U);
}

}  // namespace
}  // namespace understory
