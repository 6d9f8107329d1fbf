#include "understory/forest/trees/double_images.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector2d;

StemFit stem_at(const Vector2d& centre, double radius_m) {
  StemFit stem;
  stem.centre = centre;
  stem.radius_m = radius_m;
  stem.covariance = Eigen::Matrix3d::Identity() * 1e-6;
  return stem;
}

// Stems on a grid of 4 m, moved about.
std::vector<StemFit> scattered_stand(int rows, std::uint64_t seed) {
  Random random(seed);
  std::vector<StemFit> stems;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < rows; ++j)
      stems.push_back(stem_at({4.0 * i + random.uniform(), 4.0 * j + random.uniform()},
                              random.uniform(0.05, 0.2)));
  }
  return stems;
}

// The same with a second image of the stems from `from` on.
std::vector<StemFit> seen_twice(std::vector<StemFit> stems, const Vector2d& apart,
                                std::size_t from = 0) {
  const std::size_t count = stems.size();
  for (std::size_t i = from; i < count; ++i)
    stems.push_back(stem_at(stems[i].centre + apart, stems[i].radius_m * 1.02));
  return stems;
}

TEST(DoubleImages, AStandThatIsSeenTwiceIsToldWithItsOffset) {
  const DoubleImages images = find_double_images(seen_twice(scattered_stand(5, 1), {0.2, 0.15}));
  EXPECT_EQ(images.trees, 50U);
  EXPECT_NEAR(images.apart_m, 0.25, 1e-9);
  EXPECT_NE(complaint_of(images).find("50 of 50 trees stand twice in the cloud, 25 cm apart"),
            std::string::npos)
      << complaint_of(images);
}

TEST(DoubleImages, APartThatIsSeenTwiceIsMarked) {
  const std::vector<StemFit> stems = seen_twice(scattered_stand(6, 2), {0.0, -0.3}, 30);
  const DoubleImages images = find_double_images(stems);
  EXPECT_EQ(images.trees, 12U);
  for (std::size_t i = 0; i < stems.size(); ++i)
    EXPECT_EQ(images.twice[i] != 0, i >= 30) << i;
  EXPECT_FALSE(complaint_of(images).empty());
}

TEST(DoubleImages, ACloudLaidOnItselfFarOffIsTold) {
  for (const Vector2d& apart : {Vector2d(0.0, 0.7), Vector2d(-0.8, 0.6), Vector2d(2.0, 1.5)}) {
    const DoubleImages images = find_double_images(seen_twice(scattered_stand(5, 6), apart));
    EXPECT_GE(images.trees, 44U) << apart.transpose();
    EXPECT_NEAR(images.apart_m, apart.norm(), 0.01);
    EXPECT_NE(complaint_of(images).find("stand twice"), std::string::npos);
  }
}

TEST(DoubleImages, NeighboursAreNoImagesOfEachOther) {
  for (std::uint64_t seed = 10; seed < 30; ++seed) {
    // 2,500 trees a hectare.
    std::vector<StemFit> dense = scattered_stand(8, seed);
    for (StemFit& stem : dense)
      stem.centre *= 0.5;
    EXPECT_EQ(complaint_of(find_double_images(dense)), "") << seed;
  }
}

TEST(DoubleImages, PlantedRowsAreNoImages) {
  Random random(7);
  std::vector<StemFit> rows, pairs_of_rows;
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 10; ++j) {
      const double radius = 0.1 + 0.02 * random.normal();
      const Vector2d moved(0.03 * random.normal(), 0.03 * random.normal());
      rows.push_back(stem_at(Vector2d(2.0 * i, 2.5 * j) + moved, radius));
      pairs_of_rows.push_back(
          stem_at(Vector2d(2.5 * i, 4.0 * (j / 2) + 1.2 * (j % 2)) + moved, radius));
    }
  }
  EXPECT_EQ(complaint_of(find_double_images(rows)), "");
  EXPECT_EQ(complaint_of(find_double_images(pairs_of_rows)), "");
}

TEST(DoubleImages, ForksAndRowsAreNoImages) {
  Random random(3);
  std::vector<StemFit> forks = scattered_stand(6, 4);
  for (std::size_t i = 0; i < 36; ++i) {
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const Vector2d apart = random.uniform(0.2, 0.5) * Vector2d(std::cos(turn), std::sin(turn));
    forks.push_back(stem_at(forks[i].centre + apart, forks[i].radius_m));
  }
  EXPECT_LT(find_double_images(forks).trees, 8U);
  EXPECT_EQ(complaint_of(find_double_images(forks)), "");

  std::vector<StemFit> rows;  // a plantation, half a metre apart along rows of 3 m
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 20; ++j)
      rows.push_back(stem_at({3.0 * i, 0.5 * j + random.uniform(-0.03, 0.03)}, 0.04));
  }
  EXPECT_EQ(complaint_of(find_double_images(rows)), "");
  EXPECT_EQ(find_double_images({}).trees, 0U);
}

TEST(DoubleImages, StemsOfOtherDiametersAreNoImages) {
  std::vector<StemFit> stems = seen_twice(scattered_stand(5, 5), {0.3, 0.0});
  for (std::size_t i = 25; i < 50; ++i)
    stems[i].radius_m *= 1.4;
  EXPECT_EQ(find_double_images(stems).trees, 0U);
}

// Half circles `apart_m` along x: see StemFit::oval.
std::vector<StemFit> oval_stand(double apart_m, double noise_m, std::uint64_t seed) {
  Random random(seed);
  std::vector<StemFit> stems = scattered_stand(5, seed);
  for (StemFit& stem : stems)
    stem.oval = Vector2d(2.0 / (3.0 * M_PI) * apart_m, 0.0) +
                noise_m * Vector2d(random.normal(), random.normal());
  return stems;
}

TEST(DoubleImages, OutlinesThatAreLongInOneDirectionTellOfTwoScans) {
  const DoubleImages images = find_double_images(oval_stand(0.06, 0.002, 6));
  EXPECT_EQ(images.round, 25U);
  EXPECT_EQ(images.oval, 25U);
  EXPECT_NEAR(images.oval_apart_m, 0.06, 0.005);
  EXPECT_NE(complaint_of(images).find("scans lie 6 cm apart"), std::string::npos)
      << complaint_of(images);
}

TEST(DoubleImages, AStemAmongThemIsDoubtedThoughItsOwnOutlineWasNotSeen) {
  std::vector<StemFit> stems = oval_stand(0.06, 0.002, 6);
  stems.push_back(stem_at({8.2, 8.9}, 0.1));
  stems.push_back(stem_at({80.0, 80.0}, 0.1));
  const DoubleImages images = find_double_images(stems);
  EXPECT_EQ(images.oval, 25U);
  EXPECT_NEAR(images.oval_m[25], 0.06, 0.005);
  EXPECT_EQ(images.oval_m[26], 0.0) << "far away";
}

TEST(DoubleImages, OutlinesAsTreesGrowTellOfNothing) {
  EXPECT_EQ(find_double_images(oval_stand(0.015, 0.002, 7)).oval, 0U) << "not quite round";
  std::vector<StemFit> stems = scattered_stand(5, 8);
  Random random(9);
  for (StemFit& stem : stems) {  // long, each in its own direction
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    stem.oval = 0.015 * Vector2d(std::cos(turn), std::sin(turn));
  }
  EXPECT_EQ(complaint_of(find_double_images(stems)), "");
  EXPECT_EQ(find_double_images(scattered_stand(5, 10)).round, 0U) << "seen from one side";
}

}  // namespace
}  // namespace understory
