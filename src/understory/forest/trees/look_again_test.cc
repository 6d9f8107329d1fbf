#include "understory/forest/trees/look_again.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace understory {
namespace {

// A weak stem that was seen from one direction, by 60 degrees on both sides of it.
StandingStem weak_stem(double x, double y, double seen_from_deg) {
  StandingStem stem{{x, y}, 0.15, true, {}};
  for (int side = 0; side < 36; ++side) {
    const double off = std::remainder(10.0 * side + 5.0 - seen_from_deg, 360.0);
    if (std::abs(off) < 62.0) stem.seen.set(static_cast<std::size_t>(side));
  }
  return stem;
}

bool anywhere(const Eigen::Vector2d&) {
  return true;
}

double direction_deg(const Eigen::Vector2d& way) {
  return std::atan2(way.y(), way.x()) * 180.0 / std::numbers::pi;
}

TEST(LookAgain, ThePlaceLiesOnTheSideThatWasNotSeen) {
  const StandingStem stem = weak_stem(10.0, 20.0, 0.0);  // from the east
  EXPECT_TRUE(lacks_a_side(stem));
  EXPECT_EQ(newly_seen_deg(stem, {15.0, 20.0}), 0) << "the old side";
  EXPECT_EQ(newly_seen_deg(stem, {5.0, 20.0}), 120) << "the opposite one";
  const auto places = places_to_look({stem}, anywhere);
  ASSERT_EQ(places.size(), 1U) << "one stem alone is told too, where there is no other";
  EXPECT_EQ(places[0].stems, std::vector<std::size_t>{0});
  const Eigen::Vector2d way = places[0].place - stem.place;
  EXPECT_GE(way.norm(), 2.0);
  EXPECT_LE(way.norm(), 8.0);
  EXPECT_GE(newly_seen_deg(stem, places[0].place), 60);
  EXPECT_GT(std::abs(direction_deg(way)), 60.0);
}

// Four stems in a square that were all seen from outside: from the middle all four unseen sides.
TEST(LookAgain, OnePlaceServesAllThatItShows) {
  const std::vector<StandingStem> stems = {weak_stem(0.0, 0.0, -135.0), weak_stem(8.0, 0.0, -45.0),
                                           weak_stem(8.0, 8.0, 45.0), weak_stem(0.0, 8.0, 135.0)};
  const auto places = places_to_look(stems, anywhere);
  ASSERT_EQ(places.size(), 1U);
  EXPECT_EQ(places[0].stems.size(), 4U);
}

TEST(LookAgain, AnotherStemHidesWhatIsBehindIt) {
  std::vector<StandingStem> stems = {weak_stem(0.0, 0.0, 0.0), weak_stem(0.0, 1.5, 0.0)};
  const auto open = places_to_look(stems, anywhere);
  ASSERT_EQ(open.size(), 1U);
  // A wall of stems on the whole unseen side.
  for (double y = -12.0; y < 13.0; y += 0.9)
    stems.push_back({{-1.0, y}, 0.5, false, {}});
  for (const LookPlace& place : places_to_look(stems, anywhere))
    EXPECT_GT(place.place.x(), -1.0);
}

TEST(LookAgain, PlacesAreOutsideOfStemsAndOnTheGround) {
  std::vector<StandingStem> stems = {weak_stem(0.0, 0.0, 0.0), weak_stem(0.0, 3.0, 0.0)};
  const Eigen::Vector2d first = places_to_look(stems, anywhere)[0].place;
  stems.push_back({first, 0.2, false, {}});
  const auto places = places_to_look(stems, anywhere);
  ASSERT_FALSE(places.empty());
  EXPECT_GT((places[0].place - first).norm(), 0.7);
  EXPECT_TRUE(places_to_look(stems, [](const Eigen::Vector2d&) { return false; }).empty());
}

TEST(LookAgain, AStemSeenAllRoundIsLookedAtFromAnySide) {
  StandingStem stem = weak_stem(0.0, 0.0, 0.0);
  stem.seen.set();
  EXPECT_FALSE(lacks_a_side(stem));
  EXPECT_EQ(places_to_look({stem}, anywhere).size(), 1U);
  stem.weak = false;
  EXPECT_TRUE(places_to_look({stem}, anywhere).empty());
}

}  // namespace
}  // namespace understory
