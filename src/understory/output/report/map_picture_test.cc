#include "understory/output/report/map_picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "understory/output/inventory_files.h"
#include "understory/output/report/png_test_support.h"

namespace understory {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// The colour over a place.
std::array<int, 3> colour_at(const MapPicture& picture, double x, double y) {
  const test::DecodedPng png = test::decode_png(picture.png());
  const double cell_m = picture.width_m() / png.width;
  const auto column = static_cast<std::size_t>((x - picture.x0()) / cell_m);
  const auto row = static_cast<std::size_t>((picture.y0() + picture.height_m() - y) / cell_m);
  const auto index = static_cast<std::uint8_t>(png.rows.at(row).at(column));
  if (index == 0) return {-1, -1, -1};  // transparent
  std::array<int, 3> colour{};
  for (std::size_t i = 0; i < 3; ++i)
    colour[i] = static_cast<std::uint8_t>(png.palette.at(3U * index + i));
  return colour;
}
bool is_grey(const std::array<int, 3>& c) {
  return c[0] >= 0 && c[0] == c[1] && c[1] == c[2];
}
bool is_green(const std::array<int, 3>& c) {
  return c[1] > c[0] && c[1] > c[2];
}

TEST(MapPicture, NorthIsUpAndEastIsRight) {
  MapPicture picture(0.5);
  picture.add(0.25, 0.25, 10.0, 0.0);    // ground
  picture.add(20.25, 0.25, 15.0, 5.0);   // a bush in the east
  picture.add(0.25, 30.25, 30.0, 20.0);  // a crown in the north
  EXPECT_TRUE(is_grey(colour_at(picture, 0.25, 0.25)));
  EXPECT_TRUE(is_green(colour_at(picture, 20.25, 0.25)));
  EXPECT_TRUE(is_green(colour_at(picture, 0.25, 30.25)));
  EXPECT_EQ(colour_at(picture, 20.25, 30.25)[0], -1) << "nothing was seen there";
  EXPECT_GT(colour_at(picture, 0.25, 30.25)[1], colour_at(picture, 20.25, 0.25)[1])
      << "the higher, the lighter";
}

// A regression: the column of a point 10^10 m away is no integer, and the program ended.
TEST(MapPicture, PointsFarBeyondTheEarthAreLeftOut) {
  MapPicture picture(0.5);
  for (const double far : {1e9, 1e10, 1e30, std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()}) {
    picture.add(far, 0.0, 0.0, 0.0);
    picture.add(0.0, -far, 0.0, 0.0);
  }
  EXPECT_TRUE(picture.empty());
  picture.add(3.9e7, 3.9e7, 0.0, 0.0);
  picture.add(-3.9e7, -3.9e7, 0.0, 0.0);
  EXPECT_FALSE(picture.empty());
}

TEST(MapPicture, TheGroundIsLitFromTheNorthWest) {
  MapPicture picture(0.5);
  for (int j = -10; j < 10; ++j) {
    for (int i = -10; i < 10; ++i) {
      // A ridge from south to north: up on its western side, down on its eastern one.
      const double x = 0.5 * i + 0.25;
      picture.add(x, 0.5 * j + 0.25, 5.0 - 0.3 * std::abs(x), 0.0);
    }
  }
  EXPECT_NE(colour_at(picture, -2.25, 0.25), colour_at(picture, 2.25, 0.25));
  EXPECT_EQ(colour_at(picture, -2.25, 0.25), colour_at(picture, -3.25, 1.25));
}

TEST(MapPicture, ItDoesNotDependOnTheOrderOfPoints) {
  MapPicture forwards(0.5, 200);
  MapPicture backwards(0.5, 200);
  const auto add = [](MapPicture& picture, int i) {
    picture.add(0.37 * i, -0.11 * i, 100.0 + 0.01 * i, i % 3 == 0 ? 4.0 : 0.1);
  };
  for (int i = -500; i < 500; ++i)
    add(forwards, i);
  for (int i = 499; i >= -500; --i)
    add(backwards, i);
  EXPECT_EQ(forwards.png(), backwards.png());
  EXPECT_EQ(forwards.content_box(), backwards.content_box());
}

TEST(MapPicture, ItStaysSmallHoweverLargeTheStand) {
  MapPicture picture(0.05, 300);
  for (int i = 0; i < 2000; ++i)
    picture.add(i, 0.5 * i, 0.0, 0.0);
  const test::DecodedPng png = test::decode_png(picture.png());
  EXPECT_LE(std::max(png.width, png.height), 300);
  EXPECT_GE(std::max(png.width, png.height), 100) << "and not smaller than it has to be";
  const std::array<double, 4> box = picture.content_box();
  EXPECT_LE(box[0], 0.0);
  EXPECT_GE(box[2], 1999.0);
  EXPECT_NEAR(box[3], 999.5, 2.0 * picture.cell_m());
  EXPECT_TRUE(is_grey(colour_at(picture, 1000.0, 500.0)));
}

TEST(MapPicture, PointsWithoutAPlaceAreLeftOut) {
  MapPicture picture;
  picture.add(kNan, 0.0, 0.0, 0.0);
  picture.add(0.0, std::numeric_limits<double>::infinity(), 0.0, 0.0);
  EXPECT_TRUE(picture.empty());
  picture.add(0.0, 0.0, 0.0, kNan);  // the ground is not known there
  EXPECT_FALSE(picture.empty());
  EXPECT_TRUE(is_green(colour_at(picture, 0.02, 0.02)));
}

}  // namespace
}  // namespace understory
