#include "understory/registration/loam/ring_clusters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "understory/registration/loam/ring_features.h"

namespace understory {
namespace {

// Rings 2 degrees apart, from the lowest up, columns 0.2 degrees apart.
class RingPicture {
 public:
  // A vertical face across the x axis at that distance: columns [first, last] of rings [low, high].
  void add_face(double distance_m, int first, int last, int low, int high) {
    for (int r = low; r <= high; ++r)
      for (int c = first; c <= last; ++c)
        add(distance_m, c, r);
  }
  // A point at that distance along x.
  void add(double distance_m, int column, int number) {
    const double azimuth = 0.2 * (column + 0.5) * kRadians;
    const double elevation = (2.0 * number - 15.0) * kRadians;
    const double y = distance_m * std::tan(azimuth);
    points.emplace_back(static_cast<float>(distance_m), static_cast<float>(y),
                        static_cast<float>(std::hypot(distance_m, y) * std::tan(elevation)));
    ring.push_back(static_cast<std::uint16_t>(number));
  }
  // How many points of each face are in clusters.
  [[nodiscard]] std::vector<char> clustered(const RingClustersConfig& config = {}) const {
    return clustered_points(points, RangeImage(points, ring), std::vector<char>(points.size(), 0),
                            config);
  }

  Points points;
  std::vector<std::uint16_t> ring;

 private:
  static constexpr double kRadians = std::numbers::pi / 180.0;
};

std::size_t count(const std::vector<char>& marks, std::size_t first, std::size_t end) {
  std::size_t sum = 0;
  for (std::size_t i = first; i < end; ++i)
    sum += marks[i] != 0 ? 1 : 0;
  return sum;
}

TEST(RingClusters, AWallCountsAndALeafBeforeItDoesNot) {
  RingPicture picture;
  picture.add_face(10.0, -40, -1, 4, 9);
  const std::size_t wall = picture.points.size();
  picture.add_face(6.0, 0, 3, 6, 6);  // four points of one ring
  const std::size_t leaf = picture.points.size();
  picture.add_face(10.0, 4, 40, 4, 9);
  const std::vector<char> marks = picture.clustered();
  EXPECT_EQ(count(marks, 0, wall), wall);
  EXPECT_EQ(count(marks, wall, leaf), 0U);
  EXPECT_EQ(count(marks, leaf, marks.size()), marks.size() - leaf);
}

// Fewer points than 30, and upright: a stem far away.
TEST(RingClusters, AFarStemCountsByItsRings) {
  RingPicture picture;
  picture.add_face(20.0, 0, 1, 5, 8);
  EXPECT_EQ(count(picture.clustered(), 0, 8), 8U);
  RingPicture lying;
  lying.add_face(20.0, 0, 7, 5, 5);
  EXPECT_EQ(count(lying.clustered(), 0, 8), 0U);
  EXPECT_EQ(count(lying.clustered({.min_points = 8}), 0, 8), 8U);
}

// Two faces side by side, the second 2 m behind: the line between their ends is seen edge-on.
TEST(RingClusters, AStepInRangeParts) {
  RingPicture picture;
  picture.add_face(8.0, 0, 3, 6, 7);
  picture.add_face(10.0, 4, 7, 6, 7);
  EXPECT_EQ(count(picture.clustered({.min_points = 16}), 0, 16), 0U);
  // One face, of as many points.
  RingPicture even;
  even.add_face(8.0, 0, 7, 6, 7);
  EXPECT_EQ(count(even.clustered({.min_points = 16}), 0, 16), 16U);
}

// A cloud has no first column, and a ring without points parts nothing.
TEST(RingClusters, GoOnBehindTheLidarAndOverAnEmptyRing) {
  RingPicture picture;
  picture.add_face(-8.0, -4, 3, 6, 6);
  picture.add_face(-8.0, -4, 3, 8, 8);
  EXPECT_EQ(count(picture.clustered({.min_points = 16, .angle_deg = 30.0}), 0, 16), 16U);
}

// Of a lidar with fewer columns than the image many stay empty.
TEST(RingClusters, AWallOfFewColumnsHangsTogether) {
  RingPicture picture;
  for (int column = -12; column < 12; column += 3)
    picture.add(10.0, column, 6);
  EXPECT_EQ(count(picture.clustered({.min_points = 8}), 0, 8), 8U);
}

TEST(RingClusters, PointsThatAreLeftOutJoinNothing) {
  RingPicture picture;
  picture.add_face(8.0, 0, 8, 6, 6);
  std::vector<char> left_out(9, 0);
  left_out[4] = 1;
  const std::vector<char> marks = clustered_points(
      picture.points, RangeImage(picture.points, picture.ring), left_out, {.min_points = 5});
  EXPECT_EQ(count(marks, 0, 9), 0U);
}

// LeGO-LOAM matches what is in large clusters; LOAM matches all.
TEST(RingClusters, SmallOnesHaveNoFeatures) {
  RingPicture picture;
  picture.add_face(10.0, -60, -20, 6, 7);
  const std::size_t wall = picture.points.size();
  picture.add_face(6.0, 0, 12, 6, 6);
  const auto features_of = [&](bool ground) {
    const auto found = RingFeatureFinder({}, ground).find({&picture.points, &picture.ring});
    std::size_t far = 0;
    std::size_t small = 0;
    for (std::size_t i = 0; i < found.size(); ++i)
      (i < wall ? far : small) += found[i] == PointFeature::kNone ? 0 : 1;
    return std::pair(far, small);
  };
  EXPECT_GT(features_of(false).second, 0U);
  EXPECT_EQ(features_of(true).second, 0U);
  EXPECT_EQ(features_of(true).first, features_of(false).first);
}

}  // namespace
}  // namespace understory
