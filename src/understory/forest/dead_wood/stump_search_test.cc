#include "understory/forest/dead_wood/stump_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// Points of the search: heights above the ground, noise of 1 cm.
class StumpScene {
 public:
  // The side of an upright cylinder between two heights.
  void add_wall(const Eigen::Vector2d& centre, double radius_m, double from_m, double to_m,
                double narrower_per_m = 0.0, double seen_rad = 2.0 * M_PI) {
    for (double height = from_m; height < to_m; height += 0.02) {
      for (double angle = 0.0; angle < seen_rad; angle += 0.02 / radius_m) {
        const double radius = radius_m - narrower_per_m * (height - from_m);
        add(centre.x() + radius * std::cos(angle), centre.y() + radius * std::sin(angle), height);
      }
    }
  }
  // The face of a cut.
  void add_top(const Eigen::Vector2d& centre, double radius_m, double height_m) {
    for (double x = -radius_m; x < radius_m; x += 0.02) {
      for (double y = -radius_m; y < radius_m; y += 0.02) {
        if (std::hypot(x, y) < radius_m) add(centre.x() + x, centre.y() + y, height_m);
      }
    }
  }
  void add_plants(const Eigen::Vector2d& centre, int count) {
    for (int i = 0; i < count; ++i)
      add(centre.x() + random_.normal(0.0, 0.25), centre.y() + random_.normal(0.0, 0.25),
          random_.uniform(0.05, 0.7));
  }
  std::vector<StumpFit> search(const std::vector<StemFit>& stems = {}) {
    return find_stumps(points_, stems, {}, {});
  }

 private:
  void add(double x, double y, double height) {
    points_.push_back({static_cast<float>(x + random_.normal(0.0, 0.01)),
                       static_cast<float>(y + random_.normal(0.0, 0.01)),
                       static_cast<float>(height), 1});
  }
  Random random_{5};
  std::vector<SlicePoint> points_;
};

TEST(StumpSearch, FindsAStumpWithItsCut) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.16, 0.05, 0.4);
  scene.add_top({3.0, 4.0}, 0.16, 0.4);
  scene.add_plants({6.0, 4.0}, 800);
  const std::vector<StumpFit> found = scene.search();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR((found[0].centre - Eigen::Vector2d(3.0, 4.0)).norm(), 0.0, 0.01);
  EXPECT_NEAR(found[0].diameter_m, 0.32, 0.015);
  EXPECT_NEAR(found[0].height_m, 0.4, 0.02);
  EXPECT_LT(found[0].diameter_sd_m, 0.02);
}

TEST(StumpSearch, WhatGoesOnUpwardsIsNone) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.12, 0.05, 2.3);  // a tree that is not in the list
  scene.add_wall({8.0, 4.0}, 0.05, 0.05, 0.9);  // a post
  EXPECT_TRUE(scene.search().empty());
}

TEST(StumpSearch, IsAMetreHighAtMost) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.2, 0.05, 0.9);
  EXPECT_EQ(scene.search().size(), 1U);
  scene.add_wall({3.0, 4.0}, 0.2, 0.9, 1.3);  // a broken stem: a snag
  EXPECT_TRUE(scene.search().empty());
}

TEST(StumpSearch, StandsOnTheGround) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.15, 0.45, 0.8);
  EXPECT_TRUE(scene.search().empty());
}

// A third of it is too little to tell it from what else is round.
TEST(StumpSearch, ShowsMoreThanOneSide) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.15, 0.05, 0.4, 0.0, 0.35 * M_PI);
  EXPECT_TRUE(scene.search().empty());
}

TEST(StumpSearch, ABoulderIsNone) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.35, 0.05, 0.4, 0.8);
  EXPECT_TRUE(scene.search().empty());
}

TEST(StumpSearch, PlantsAreNone) {
  StumpScene scene;
  for (int i = 0; i < 40; ++i)
    scene.add_plants({0.9 * i, 0.3 * i}, 150 + 20 * i);
  EXPECT_TRUE(scene.search().empty());
}

TEST(StumpSearch, TheFootOfAListedTreeIsNone) {
  StumpScene scene;
  scene.add_wall({3.0, 4.0}, 0.16, 0.05, 0.4);
  StemFit tree;
  tree.centre = {3.05, 4.0};
  tree.radius_m = 0.15;
  EXPECT_EQ(scene.search().size(), 1U);
  EXPECT_TRUE(scene.search({tree}).empty());
}

TEST(StumpSearch, NothingIsFoundInNothing) {
  EXPECT_TRUE(StumpScene().search().empty());
}

}  // namespace
}  // namespace understory
